"""Former places of public names, which still work, and say where the names are now."""

from __future__ import annotations

import importlib
import warnings
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable


def moved(module: str) -> Callable[[str], Any]:
    """The `__getattr__` of a module whose names are now those of `obseq.leastsquares`."""

    def find(name: str) -> Any:
        now = importlib.import_module("obseq.leastsquares")
        try:
            found = now.__getattr__(name)  # its home: a former place may have taken the name in the package
        except AttributeError:
            raise AttributeError(f"module {module!r} has no attribute {name!r}") from None
        message = f"{module} has moved: from obseq.leastsquares import {name}"
        warnings.warn(message, DeprecationWarning, stacklevel=2)
        return found

    return find
