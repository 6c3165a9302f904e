"""Kinds of observations, each one object: names and codes, unit, checks, equation, use for initial values."""
