"""What all machine code depends on besides the text of functions."""

from __future__ import annotations

import numpy as np

INTERFACE = 3
"""Number of the way in which functions are compiled and called; a change makes all older code unusable."""

FAILED = -1
"""What machine code returns when the function itself gave up; loops never do."""

OBJECT_HEADER = object.__basicsize__
"""Bytes before the fields of a Python object."""

TYPE_NUMBERS = {
    name: np.dtype(name).num for name in ("bool", "uint8", "int32", "uint32", "int64", "uint64", "float64")
}
"""NumPy's numbers of the types of arrays, which differ between platforms."""

SETTINGS = (f"interface {INTERFACE}", f"header {OBJECT_HEADER}", f"types {sorted(TYPE_NUMBERS.items())}")
