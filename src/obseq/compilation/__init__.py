"""Machine code: what is compiled, its digest, and where compiled code comes from.

A loop is a plain Python function marked `compiled`. Its machine code carries a digest of its text and of all
that it calls. It is taken from the objects compiled ahead of time if one has that digest, else from the
user's cache, else numba compiles it, when it is first called.
"""

from obseq.compilation.digests import Function, Instruction
from obseq.compilation.loops import Loop, compiled

__all__ = ["Function", "Instruction", "Loop", "compiled"]
