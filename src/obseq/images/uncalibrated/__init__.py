"""Resections of cameras of unknown calibration: six points off a plane, or four on one."""
