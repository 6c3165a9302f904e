"""Calibrated cameras of Pix4D."""
