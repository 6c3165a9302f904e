"""Gross errors: every observation is compared with the others before the adjustment; causes are named."""
