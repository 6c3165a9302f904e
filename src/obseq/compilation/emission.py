"""Names for what numba and llvmlite hand to those who write instructions; neither package has types."""

from typing import Any, TypeAlias

Context: TypeAlias = Any
"""Numba's context: of typing, or of the target."""

Builder: TypeAlias = Any
"""LLVM's builder of instructions, at its place in a function."""

Value: TypeAlias = Any
"""A value of LLVM's, a module, a machine: what instructions are made of."""

NumbaType: TypeAlias = Any
"""A type of numba's, or the types of a whole call."""

Emitter: TypeAlias = Any
"""What an intrinsic gives numba: the types of the call, and the function that writes it."""
