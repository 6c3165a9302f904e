"""Scenes of OpenMVG."""
