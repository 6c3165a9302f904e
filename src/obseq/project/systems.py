"""Coordinate systems of the folders of a project that are opened together."""

from __future__ import annotations

from typing import TYPE_CHECKING

from obseq.crs import parse
from obseq.errors import InputError
from obseq.project.points import NO_SYSTEM, read_system
from obseq.project.reports import converted

if TYPE_CHECKING:
    from pathlib import Path

    from obseq.images import ControlPoints


def differ(first: str, second: str) -> bool:
    """Whether two definitions are of different systems; where one says nothing, nobody can tell."""
    return NO_SYSTEM not in (first, second) and first != second and parse(first) != parse(second)


def require_one(first: Path, second: Path) -> None:
    """Refuses two folders of different systems.

    Raises:
        InputError: they are, with their definitions.
    """
    one, other = read_system(first), read_system(second)
    if differ(one, other):
        raise InputError(
            f"{first} is in {one}, {second} in {other}: convert one of them (change-sysco converts points)"
        )


def brought_to(control: ControlPoints, points: Path, orientation: Path) -> tuple[ControlPoints, str]:
    """Points of a folder in the system of an orientation, and a sentence where they were converted.

    Raises:
        CrsError: a system is unknown, or nothing leads from one to the other.
    """
    given, wanted = read_system(points), read_system(orientation)
    if not differ(given, wanted):
        return control, ""
    told = f"points converted from {given} to {wanted}, the system of the orientation"
    return converted(control, given, wanted), told
