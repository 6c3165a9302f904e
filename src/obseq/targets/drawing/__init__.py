"""Coded targets drawn: the picture, the sheet, its legend."""
