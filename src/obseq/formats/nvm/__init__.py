"""Models of VisualSFM."""
