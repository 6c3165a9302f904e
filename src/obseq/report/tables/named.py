"""What reports call files, units and levels, and where something was read."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import PurePath
from typing import Protocol

from obseq.records.adjustment import AdjustmentRecord, ObservationRecord
from obseq.report.tables.columns import Column, choice, column

ANGLES = frozenset({"Hz", "Zen"})
"""Types that are angles in records that do not hold the unit of their observations (obseq 0.1.0)."""


class Read(Protocol):
    """What was read from a line of a file."""

    @property
    def file(self) -> str:
        """Its file; empty where it is from none."""

    @property
    def line(self) -> int:
        """Its line."""


def where(found: Sequence[Read]) -> list[Column]:
    """Columns of the file and the line of each; none where nothing is from a file."""
    names = short_names(row.file for row in found)
    if not any(names):
        return []
    lines = [row.line if row.file else None for row in found]
    return [
        choice("file", [names[row.file] or "-" for row in found], paper=False),
        column("line", "count", lines, paper=False, joined=True),
    ]


def short_names(files: Iterable[str]) -> dict[str, str]:
    """What tables call each file: its name without folders, unless two files have the same."""
    known = dict.fromkeys(files)
    count = Counter(PurePath(file).name for file in known)
    return {file: name if count[name := PurePath(file).name] == 1 else file for file in known}


def unit_of(row: ObservationRecord) -> str:
    """The unit of an observation: m or rad."""
    return row.unit or ("rad" if row.type in ANGLES else "m")


def ellipse_level(record: AdjustmentRecord, shape: str = "ellipse") -> str:
    """How the ellipses, or ellipsoids, are to be read."""
    standard = "39 % (standard)" if shape == "ellipse" else "20 % (standard)"
    level = standard if record.ellipse_level is None else f"{100.0 * record.ellipse_level:g} %"
    return f"{level}, {record.precision}" if record.precision else level
