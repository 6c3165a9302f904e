"""Rigid blocks and clinometers of a project."""
