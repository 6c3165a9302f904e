"""How the loops of the solvers are compiled."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar, cast

from numba import njit

if TYPE_CHECKING:
    from collections.abc import Callable

F = TypeVar("F", bound="Callable[..., Any]")


def compiled(function: F) -> F:
    """Compiles at the first call and keeps the result on disk; other threads run meanwhile.

    Numba looks at the file of the function to know whether what it kept is still valid, and at no other:
    a compiled function calls compiled functions of its own file only.
    """
    return cast("F", njit(cache=True, nogil=True, error_model="numpy")(function))


def compiled_sums(function: F) -> F:
    """As `compiled`, where sums may be taken in any order, hence by vectors."""
    options = {"reassoc", "nsz", "contract"}
    return cast("F", njit(cache=True, nogil=True, error_model="numpy", fastmath=options)(function))
