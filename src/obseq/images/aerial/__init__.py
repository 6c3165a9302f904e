"""Aerial geometry on a map."""
