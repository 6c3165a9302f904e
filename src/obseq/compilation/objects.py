"""Machine code compiled ahead of time: libraries in the installed package, one per kind of processor.

A platform wheel has them; a source tree and a pure wheel have none. Functions are found by names that say
their digest, so that code of another text than the installed one is never run.
"""

from __future__ import annotations

import ctypes
import logging
import os
import sys
from functools import cache
from pathlib import Path

LOGGER = logging.getLogger(__name__)
FOLDER = Path(__file__).parent / "objects"
NONE = "none"

V3 = frozenset({"avx2", "bmi1", "bmi2", "f16c", "fma", "abm", "movbe"})
V4 = V3 | {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"}
LEVELS: dict[str, dict[str, frozenset[str]]] = {
    "x86_64": {"x86-64-v4": V4, "x86-64-v3": V3},
    "aarch64": {"generic": frozenset()},
}
"""Kinds of processors by machine, the best one first, with the features that each needs."""


def find(symbol: str) -> int:
    """Address of that function in the library for this processor; 0 when it is not there."""
    library = _library()
    function = getattr(library, symbol, None) if library else None
    return ctypes.cast(function, ctypes.c_void_p).value or 0 if function else 0


def level() -> str:
    """The kind of processor whose library is in use; `NONE` without one."""
    for name in levels_here():
        if path_of(name).is_file():
            return name
    return NONE


def path_of(level: str) -> Path:
    """The library for a kind of processor."""
    return FOLDER / f"{level}.so"


def levels_here() -> list[str]:
    """Kinds of processors that this one belongs to, the best first; none where features are not known."""
    has = _features()
    levels = LEVELS.get(os.uname().machine, {}) if sys.platform == "linux" else {}
    return [name for name, needed in levels.items() if needed <= has]


@cache
def _features() -> frozenset[str]:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return frozenset()
    return frozenset(next((line.split(":")[1].split() for line in lines if line.startswith("flags")), ()))


@cache
def _library() -> ctypes.CDLL | None:
    chosen = level()
    if chosen == NONE:
        return None
    try:
        return ctypes.CDLL(str(path_of(chosen)))
    except OSError as error:
        LOGGER.warning("%s cannot be loaded (%s): loops are compiled instead", path_of(chosen), error)
        return None
