"""Gross errors: every observation compared with the others before the adjustment, and the likely cause named."""
