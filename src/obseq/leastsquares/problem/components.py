"""Components of a block of unknowns: by name or by number."""

from __future__ import annotations

from obseq.errors import InputError
from obseq.leastsquares.problem.arguments import whole


def component_number(known: tuple[str, ...], component: str | int, size: int, what: str) -> int:
    """Number of a component given by name or by number."""
    if isinstance(component, str):
        for number, name in enumerate(known):
            if component in called(name):
                return number
        raise InputError(f"{what}: no component {component!r}; there are {', '.join(known)}")
    number = whole(component, f"{what}, component")
    if not 0 <= number < size:
        raise InputError(f"{what}: no component {number}; they go from 0 to {size - 1}")
    return number


def called(component: str) -> tuple[str, str]:
    """What a component may be called: `rotation.x`, or `x`."""
    return component, component.rpartition(".")[2]
