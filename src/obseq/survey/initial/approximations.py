"""Approximate coordinates that the observations contradict so much that nothing good can start from them.

Gauss-Newton finds its way from a third of a sight length and of a radian. An approximation beyond that is
not used: the point is computed from the observations, and the approximation serves only where these cannot
place it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from obseq.arrays import Array, BoolArray, FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.records.adjustment import ReplacedRecord
from obseq.survey.initial.closed_forms import wrap
from obseq.survey.initial.known import Vertical
from obseq.survey.initial.relations import central_angle
from obseq.survey.kinds.kind import Start
from obseq.survey.kinds.registry import among, codes_for
from obseq.survey.model import FieldBook, Orientation

Rows = np.ndarray[tuple[int], np.dtype[np.intp]]

_MOST = 3
"""Points that one sentence names."""
_FAR = 0.3
"""Misfit, in radians or in parts of the length, from which an approximation is doubted."""


@dataclass(frozen=True)
class Approximations:
    """The observations between points that have coordinates, as far as they can be compared with them.

    Attributes:
        book: the observations.
        orientations: of each station, after the automatic-FIX rule.
        vertical: see `initial_values`.
    """

    book: FieldBook
    orientations: np.ndarray[tuple[int], np.dtype[np.int8]]
    vertical: Vertical | None

    def contradictions(self, coordinates: FloatArray, candidates: BoolArray) -> IntArray:
        """(n,) how many observations to located points contradict each candidate grossly.

        Args:
            coordinates: (n, 3) frame; NaN where unknown.
            candidates: (n,) points whose coordinates may be wrong.
        """
        count = np.zeros(len(candidates), np.int64)
        if not candidates.any():
            return count
        rows = self._comparable(np.asarray(np.isfinite(coordinates).all(axis=1)), candidates)
        wrong = rows[self._contradicted(rows, coordinates)]
        observations = self.book.observations
        for ends in (observations.from_points[wrong], observations.to_points[wrong]):
            count += np.bincount(ends, minlength=len(count))
        return np.where(candidates, count, 0)

    def _comparable(self, located: BoolArray, candidates: BoolArray) -> Rows:
        """Active observations between located points, one of them a candidate."""
        observations, n = self.book.observations, len(located)
        rows = np.flatnonzero(observations.active)
        ends = observations.from_points[rows], observations.to_points[rows]
        rows = rows[(ends[0] < n) & (ends[1] < n)]
        start, end = observations.from_points[rows], observations.to_points[rows]
        chosen = located[start] & located[end] & (candidates[start] | candidates[end])
        return np.asarray(rows[chosen])

    def _contradicted(self, rows: Rows, coordinates: FloatArray) -> BoolArray:
        observations = self.book.observations
        kinds, values = observations.types[rows], observations.values[rows]
        origins = observations.from_points[rows]
        offsets = coordinates[observations.to_points[rows]] - coordinates[origins]
        local = self._local(coordinates, origins, offsets)
        flat = np.hypot(local[:, 0], local[:, 1])
        rise = local[:, 2] + observations.to_heights[rows] - observations.from_heights[rows]
        length = np.hypot(flat, rise)
        # the last one is for observations without station
        is_plumb = np.append(self.orientations != Orientation.BASC.value, True)[observations.stations[rows]]
        zenith = np.abs(np.arctan2(flat, rise) - np.arccos(np.cos(values)))
        wrong = _gives(kinds, Start.DISTANCE) & (np.abs(length - values) > _FAR * np.abs(values))
        wrong |= _gives(kinds, Start.FLAT) & (np.abs(flat - values) > _FAR * np.abs(values))
        wrong |= _gives(kinds, Start.ZENITH) & is_plumb & (zenith > _FAR)
        shifts = _gives(kinds, Start.DX, Start.DY, Start.DZ)
        wrong |= shifts & (np.abs(values) > (1.0 + _FAR) * length + 1.0)
        readings = _gives(kinds, Start.HZ) & is_plumb & (flat > 0.0)
        wrong[readings] |= self._turned(rows[readings], np.arctan2(local[readings, 0], local[readings, 1]))
        return np.asarray(wrong)

    def _local(self, coordinates: FloatArray, origins: Array, offsets: FloatArray) -> FloatArray:
        """Offsets (k, 3) from some points (k,), in east, north, up there."""
        if self.vertical is None or not len(origins):
            return offsets
        points, which = np.unique(origins, return_inverse=True)
        return np.asarray(np.einsum("kij,kj->ki", self.vertical(coordinates[points])[which], offsets))

    def _turned(self, rows: Rows, azimuths: FloatArray) -> BoolArray:
        """Which readings disagree with the others of their station, given the azimuths of the coordinates."""
        observations = self.book.observations
        angles = (azimuths - observations.values[rows]).tolist()
        is_fixed = (self.orientations == Orientation.FIX.value).tolist()
        of_station: dict[int, list[int]] = {}
        for k, station in enumerate(observations.stations[rows].tolist()):
            of_station.setdefault(station, []).append(k)
        wrong = np.zeros(len(rows), np.bool_)
        for station, members in of_station.items():
            own = [angles[k] for k in members]
            g0 = 0.0 if is_fixed[station] else central_angle(own)
            far = [k for k, angle in zip(members, own, strict=True) if abs(wrap(angle - g0)) > _FAR]
            # of two readings that disagree, either may be the wrong one
            wrong[far if len(own) > 2 or not far else members] = True
        return wrong


def _gives(kinds: npt.NDArray[np.int16], *uses: Start) -> BoolArray:
    """Of observations of these kinds (codes), whether initial values have these things of them."""
    return among(kinds, codes_for(*uses))


def sentences_of(replaced: Sequence[ReplacedRecord]) -> tuple[str, ...]:
    """Which approximations were replaced: one sentence for all that are the same, such as 0 0 0."""
    alike: dict[tuple[float, ...], list[ReplacedRecord]] = {}
    for item in replaced:
        place = tuple(round(value, 6) + 0.0 for value in item.given)  # no zero is negative
        alike.setdefault(place, []).append(item)
    groups = sorted(alike.values(), key=len, reverse=True)
    return tuple(_of_one_place(group) if len(group) > 1 else group[0].sentence for group in groups)


def _of_one_place(group: Sequence[ReplacedRecord]) -> str:
    shown = ", ".join(f"{item.name} ({item.place})" for item in group[:_MOST])
    more = f" and {len(group) - _MOST} more" if len(group) > _MOST else ""
    given = ", ".join(f"{round(value, 3) + 0.0:.3f}" for value in group[0].given)
    return (
        f"{len(group)} points have the same approximate coordinates ({given}), up to "
        f"{max(item.moved for item in group):.3g} m from where their observations place them, which gave "
        f"better ones: {shown}{more}"
    )


def nearest_sights(book: FieldBook, coordinates: FloatArray, rows: Rows) -> FloatArray:
    """(k,) length of the shortest active observation of some points, at the coordinates (n, 3)."""
    observations, n = book.observations, len(coordinates)
    shortest = np.full(len(book.point_names), np.inf)
    active = np.flatnonzero(observations.active)
    start, end = observations.from_points[active], observations.to_points[active]
    inside = (start < n) & (end < n) & (start != end)
    start, end = start[inside], end[inside]
    lengths = np.linalg.norm(coordinates[end] - coordinates[start], axis=1)
    lengths = np.where(np.isfinite(lengths), lengths, np.inf)
    np.minimum.at(shortest, start, lengths)
    np.minimum.at(shortest, end, lengths)
    return shortest[rows]


def replaced(given: FloatArray, book: FieldBook, coordinates: FloatArray, hidden: BoolArray) -> Rows:
    """The points whose approximation (n, 3) has not been used, and is far from where they are now."""
    rows = np.flatnonzero(hidden & np.isfinite(coordinates).all(axis=1))
    moved = np.linalg.norm(coordinates[rows] - given[rows], axis=1)
    return np.asarray(rows[moved > _FAR * nearest_sights(book, coordinates, rows)])
