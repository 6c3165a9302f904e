"""Poses of images as text."""
