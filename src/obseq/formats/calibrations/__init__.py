"""Calibrations of cameras by other programs, without a block."""
