"""Observation equations: written once, generated as kernels, adjusted by least squares."""

from obseq.errors import CrsError, FormulaError, InputError, ObseqError, SingularSystemError

__all__ = ["CrsError", "FormulaError", "InputError", "ObseqError", "SingularSystemError"]
