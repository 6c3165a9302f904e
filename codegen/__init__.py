"""From formulas to kernels: the stages are listed in `pipeline.py`, the files written in `files.py`."""

from obseq.packages import GENERATOR, require

require("obseq.codegen", "gencode", *GENERATOR)

from obseq.codegen.ondemand import compile_formula

__all__ = ["compile_formula"]
