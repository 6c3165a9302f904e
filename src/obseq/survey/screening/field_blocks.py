"""Set-ups as they stand in a field book: what follows each other from one point, distances too."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.survey.model import FieldBook

    Rows = np.ndarray[tuple[int], np.dtype[np.intp]]

_APART = 4
"""Rows from one observation to the next beyond which they are not of one set-up."""


def blocks_of(book: FieldBook, rows: Rows) -> Iterator[Rows]:
    """Rows that follow each other in one file, from one point and of one station."""
    observations = book.observations
    origins, files, stations = (
        column[rows].tolist()
        for column in (observations.from_points, observations.file_indices, observations.stations)
    )
    block: dict[tuple[int, int], list[int]] = {}
    station: dict[tuple[int, int], int] = {}
    for row, origin, file, own in zip(rows.tolist(), origins, files, stations, strict=True):
        key = origin, file
        mine, before = block.setdefault(key, []), station.get(key, -1)
        if mine and (row - mine[-1] > _APART or (own >= 0 and before >= 0 and own != before)):
            yield np.array(mine, np.intp)
            mine, before = [], -1
            block[key] = mine
        mine.append(row)
        station[key] = own if own >= 0 else before
    yield from (np.array(mine, np.intp) for mine in block.values())
