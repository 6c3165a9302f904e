"""Vectors of GNSS as GVX."""
