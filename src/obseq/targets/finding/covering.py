"""Which places of an image are covered by the sheets of targets that were found there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from obseq.arrays import BoolArray, FloatArray, FloatRows
    from obseq.targets.finding.fits import Placed


def covered_by(placed: Placed, edges: FloatArray, places: FloatRows) -> BoolArray:
    """(n,) which places (n, 2), pixels, lie on a sheet.

    Args:
        placed: where its drawing lies.
        edges: (4,) left, right, upper and lower edge of the sheet, units.
        places: pixels.
    """
    flat = (places - placed.centre) @ np.linalg.inv(placed.matrix).T
    depth = 1.0 - flat @ placed.perspective
    x, y = (flat / np.where(depth > 0.1, depth, np.nan)[:, None]).T
    left, right, top, bottom = edges
    return np.asarray((x > left) & (x < right) & (y > top) & (y < bottom))


class Covering:
    """Sheets that lie in an image; one is added at a time."""

    def __init__(self) -> None:
        self._sheets: list[tuple[Placed, FloatArray]] = []
        self._around = np.empty((0, 3))

    def __len__(self) -> int:
        return len(self._sheets)

    def add(self, placed: Placed, edges: FloatArray) -> None:
        """Adds a sheet with its edges (4,), units."""
        corners = np.array([[x, y] for x in edges[:2] for y in edges[2:]])
        reach = np.hypot(*(placed.pixels(corners) - placed.centre).T).max()
        self._sheets.append((placed, edges))
        self._around = np.vstack((self._around, [*placed.centre, reach]))

    def covers(self, places: FloatRows, since: int = 0) -> BoolArray:
        """(n,) which places (n, 2), pixels, lie on one of those that were added after some."""
        found = np.zeros(len(places), dtype=bool)
        around = self._around[since:]
        near = np.hypot(places[:, :1] - around[:, 0], places[:, 1:] - around[:, 1]) < around[:, 2]
        for k in np.flatnonzero(near.any(axis=0)).tolist():
            rows = np.flatnonzero(near[:, k])
            found[rows] |= covered_by(*self._sheets[since + k], places[rows])
        return found
