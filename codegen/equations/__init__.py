"""Equations as a reader sees them: in text and in LaTeX, on pages of formulas."""
