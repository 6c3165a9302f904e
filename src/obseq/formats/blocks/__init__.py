"""Blocks of images in tables of ours."""
