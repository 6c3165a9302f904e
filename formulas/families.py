"""Any member of a family by its name, generated or not, registered or not."""

import difflib
from collections.abc import Callable

from obseq.errors import FormulaError
from obseq.formulas import (
    REGISTRY,
    clinometers,
    colinearity,
    distortion,
    plane,
    projections,
    radiometry,
    sensors,
)
from obseq.formulas.base import Formula

FAMILIES: tuple[Callable[[str], Formula | None], ...] = (
    distortion.from_name,
    projections.from_name,
    colinearity.from_name,
    sensors.from_name,
    plane.from_name,
    clinometers.from_name,
    radiometry.from_name,
)
"""Parsers of names: each gives the member of its family that has a name, None when there is none."""


def from_name(name: str) -> Formula | None:
    """The formula of a name: of the registry, else the member of a family; None when there is none."""
    for registered in REGISTRY:
        if registered.name == name:
            return registered
    members = (parse(name) for parse in FAMILIES)
    return next((member for member in members if member is not None), None)


def find(name: str) -> Formula | None:
    """The formula of the registry, else the member of a family, of a name; None when there is none."""
    for registered in REGISTRY:
        if registered.name == name:
            return registered
    members = (member for parse in FAMILIES if (member := parse(name)) is not None)
    return next(members, None)


def formula(name: str) -> Formula:
    """The formula of a name: of the registry, else the member of a family.

    Raises:
        FormulaError: No formula has that name; the message gives the nearest ones.
    """
    if (found := find(name)) is not None:
        return found
    known = [registered.name for registered in REGISTRY]
    near = ", ".join(difflib.get_close_matches(name, known, n=4, cutoff=0.5)) or "none"
    raise FormulaError(f"no formula is named {name!r}; nearest names: {near} (gencode --list gives all)")
