"""Commands in MMVII's own words."""
