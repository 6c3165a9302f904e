"""Coded targets found in images, decoded and measured."""
