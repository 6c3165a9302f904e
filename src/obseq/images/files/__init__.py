"""Blocks in files: tables of ours, and the files of other programs, read into the same objects."""
