"""What the observations and stations of a network are called in messages."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from obseq.arrays import IntArray
    from obseq.survey.model import FieldBook, Points


class Labels(Sequence[str]):
    """What observations are called in messages, made when somebody asks."""

    def __init__(self, book: FieldBook, rows: IntArray) -> None:
        self._book = book
        self._rows = rows

    def __len__(self) -> int:
        return len(self._rows)

    def __getitem__(self, index):  # type: ignore[no-untyped-def]
        return self._book.label(int(self._rows[index]))


def station_names(points: Points, book: FieldBook) -> list[str]:
    """Names of the stations for messages: their point, numbered when it has several."""
    seen: dict[str, int] = {}
    names = []
    for origin in book.stations.origins:
        name = points.names[origin]
        seen[name] = seen.get(name, 0) + 1
        names.append(f"station {name}" if seen[name] == 1 else f"station {name} ({seen[name]})")
    return names
