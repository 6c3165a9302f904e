"""The units in which reports show lengths and angles; all numbers of records are in metres and radians."""

from __future__ import annotations

from collections.abc import Iterable

from obseq.errors import InputError
from obseq.records.record import Record

METRES = {"m": 1.0, "ft": 0.3048, "us-ft": 1200.0 / 3937.0}
"""Metres in each unit of length, named as PROJ does: `us-ft` is the foot of the United States' surveys."""
ANGLES = ("gon", "degree", "dms")
"""Units of angles; `dms`: degrees, minutes and seconds."""
STORED = "metres and radians"


def length_named(metres: float) -> str:
    """The unit of reports for a unit of files of so many metres; metres where reports have none."""
    return next((name for name, size in METRES.items() if size == metres), "m")


class ShownUnits(Record, frozen=True, omit_defaults=False):
    """Units of reports.

    Attributes:
        length: One of `METRES`.
        angle: One of `ANGLES`.
        stored: What the numbers of the record themselves are in.
    """

    length: str = "m"
    angle: str = "gon"
    stored: str = STORED

    def __post_init__(self) -> None:
        for word, known in ((self.length, tuple(METRES)), (self.angle, ANGLES)):
            if word not in known:
                raise InputError(f"unit {word!r} of reports is none of {', '.join(known)}")


METRIC = ShownUnits()


def chosen_units(words: Iterable[str], otherwise: ShownUnits) -> ShownUnits:
    """The units that words name, at most one of lengths and one of angles; `otherwise` for the rest.

    Raises:
        InputError: A word is no unit, or two are of the same quantity.
    """
    found: dict[str, str] = {}
    for word in words:
        quantity = "length" if word in METRES else "angle" if word in ANGLES else None
        if quantity is None or quantity in found:
            raise InputError(
                f"--units {word}: give one of {', '.join(METRES)}, or one of {', '.join(ANGLES)}, or one "
                "of each"
            )
        found[quantity] = word
    return ShownUnits(found.get("length", otherwise.length), found.get("angle", otherwise.angle))
