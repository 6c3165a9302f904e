"""Scenes of Meshroom (AliceVision)."""
