"""Options and commands in MMVII's own words."""
