"""Blocks of satellite images: rational polynomials, corrected image by image."""
