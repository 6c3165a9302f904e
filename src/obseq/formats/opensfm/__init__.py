"""Reconstructions of OpenSfM and ODM."""
