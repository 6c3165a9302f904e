"""Generated kernels: loading them, and evaluating them in batches."""

from obseq.kernels.calculator import Calculator, calculator
from obseq.kernels.loading import Kernel, formula_names, load

__all__ = ["Calculator", "Kernel", "calculator", "formula_names", "load"]
