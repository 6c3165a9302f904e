"""From formulas to kernels: the stages are listed in `pipeline.py`, the files written in `files.py`."""

from obseq.codegen.ondemand import compile_formula

__all__ = ["compile_formula"]
