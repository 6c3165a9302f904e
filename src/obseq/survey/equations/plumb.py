"""The plumb line of each point: vertical of the frame, deflected where a deflection is given."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from obseq.arrays import FloatArray, IndexArray, IntArray
from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.geometry import rotation_x, rotation_y
from obseq.survey.equations.frame import RTL_HINT, Frame
from obseq.survey.kinds.registry import among, codes_where
from obseq.survey.model import FieldBook, Orientation, Points

LISTED = 8
"""Names given in a message before it says how many more there are."""


def deflecting(deflections: FloatArray) -> FloatArray:
    """(n, 3, 3) rotations from east, north, up to axes along the plumb line; deflections (n, 2) eta, xi."""
    eta, xi = deflections.T
    return np.asarray(rotation_y(-eta) @ rotation_x(xi))


@dataclass(frozen=True, eq=False)
class Plumb:
    """Plumb lines of the points of a network.

    Attributes:
        frame: The computation frame.
        points: The points, with their deflections.
    """

    frame: Frame
    points: Points

    @cached_property
    def is_deflected(self) -> bool:
        """Whether a deflection is given somewhere."""
        return bool(np.isfinite(self.points.deflections).any())

    @property
    def turn(self) -> bool:
        """Whether they turn from place to place."""
        return self.frame.has_vertical and not self.frame.is_plane

    def axes(self, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(k, 3, 3) rotations from the frame to east, north, up of points, at coordinates (n_points, 3)."""
        verticals = self.frame.verticals(rows, coordinates)
        if not self.is_deflected or not self.frame.has_vertical:
            return verticals
        return np.asarray(deflecting(np.nan_to_num(self.points.deflections[rows])) @ verticals)

    def turns(self, rows: IntArray | IndexArray, coordinates: FloatArray) -> FloatArray:
        """(k, 3, 3) what these axes turn by when their points move, in the frame (rad per m)."""
        return self.frame.turns(rows, coordinates)

    def slopes_of_levelled(
        self, book: FieldBook, rows: IntArray, coordinates: FloatArray
    ) -> FloatArray | None:
        """(k, 6) derivatives of `levelled` by the two points; None without deflections."""
        if not self.is_deflected:
            return None
        ends = book.observations.from_points[rows], book.observations.to_points[rows]
        local = self.frame.verticals(ends[0], coordinates)
        along = np.einsum("nj,njk->nk", self._mean_deflections(*ends), local[:, :2])
        sights = coordinates[ends[1]] - coordinates[ends[0]]
        leaning = np.einsum("nk,nkj->nj", np.cross(along, sights), self.turns(ends[0], coordinates))
        return np.hstack([along - leaning, -along])

    def _mean_deflections(self, origins: IndexArray, targets: IndexArray) -> FloatArray:
        """(k, 2) eta and xi, half way between points."""
        return np.nan_to_num(self.points.deflections[origins] + self.points.deflections[targets]) / 2.0

    def offsets(self, book: FieldBook, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(k, 3) of observations: offset of the target above its point minus that of the instrument (m)."""
        observations = book.observations
        total = np.zeros((len(rows), 3))
        for ends, heights, sign in (
            (observations.to_points, observations.to_heights, 1.0),
            (observations.from_points, observations.from_heights, -1.0),
        ):
            chosen = heights[rows] != 0.0
            if chosen.any():
                up = self.axes(ends[rows[chosen]], coordinates)[:, 2]
                total[chosen] += sign * heights[rows[chosen], None] * up
        return total

    def levelled(self, book: FieldBook, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(k,) height differences between the points themselves, along the vertical of the frame (m).

        Of observed ones: without the heights of instrument and target, and with the slope of level surfaces
        (the mean deflection along the line times its length).
        """
        observations = book.observations
        heights = observations.from_heights[rows] - observations.to_heights[rows]
        values = np.asarray(observations.values[rows] + heights)
        if not self.is_deflected:
            return values
        origins, targets = observations.from_points[rows], observations.to_points[rows]
        sights = np.einsum(
            "nij,nj->ni",
            self.frame.verticals(origins, coordinates),
            coordinates[targets] - coordinates[origins],
        )
        mean = self._mean_deflections(origins, targets)
        return np.asarray(values - np.einsum("nj,nj->n", mean, sights[:, :2]))

    def check(self, book: FieldBook, orientations: NDArray[np.int8]) -> None:
        """Raises InputError when what the observations need of plumb lines is not given.

        With deflections, every plumb set-up and both ends of height differences need one; a height of
        instrument or target needs a vertical, an azimuth a horizon in which north is.
        """
        observations = book.observations
        from_north = among(observations.types, codes_where(lambda kind: kind.is_from_north))
        if self.frame.is_geocentric and (from_north & observations.active).any():
            row = int(np.flatnonzero(from_north & observations.active)[0])
            raise InputError(
                f"{book.label(row)}: an azimuth is from north in the horizon of its station, and a "
                f"geocentric frame has none; {RTL_HINT}"
            )
        with_heights = (observations.from_heights != 0.0) | (observations.to_heights != 0.0)
        if not self.frame.has_vertical and (with_heights & observations.active).any():
            row = int(np.flatnonzero(with_heights & observations.active)[0])
            raise InputError(
                f"{book.label(row)}: a height of instrument or target is along the vertical, which the "
                f"frame does not have; {RTL_HINT}"
            )
        if self.is_deflected and not self.frame.has_vertical:
            raise InputError(
                "deflections of the vertical are given, and the frame has no vertical; "
                f"{RTL_HINT}, or leave them out with --ignore deflections"
            )
        if self.is_deflected:
            self._require_deflections(book, orientations)

    def _require_deflections(self, book: FieldBook, orientations: NDArray[np.int8]) -> None:
        observations = book.observations
        active = observations.active
        levelled = active & np.isin(observations.types, codes_where(lambda kind: kind.needs_deflections))
        plumb = ~np.isin(orientations, (Orientation.BASC.value, Orientation.CAM.value))
        needed = np.zeros(len(self.points), np.bool_)
        needed[book.stations.origins[plumb]] = True
        for ends, heights in (
            (observations.from_points, observations.from_heights),
            (observations.to_points, observations.to_heights),
        ):
            needed[ends[levelled | (active & (heights != 0.0))]] = True
        lacking = np.flatnonzero(needed & np.isnan(self.points.deflections).any(axis=1))
        if lacking.size:
            listed = ", ".join(self.points.names[row] for row in lacking[:LISTED])
            more = f" and {lacking.size - LISTED} more" if lacking.size > LISTED else ""
            raise InputError(
                "some points have a deflection of the vertical, and these have none where one is needed: "
                f"{listed}"
                f"{more}. Give them eta xi (arc seconds) in the point file, or leave all of them out with "
                "--ignore deflections"
            )
