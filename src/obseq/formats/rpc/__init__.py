"""Rational polynomial coefficients of satellite images."""
