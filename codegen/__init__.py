"""From formulas to kernels: the stages are listed in `compiler.py`, the files written in `files.py`."""
