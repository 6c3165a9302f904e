"""Models of COLMAP."""
