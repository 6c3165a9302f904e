"""Data files of STAR*NET."""
