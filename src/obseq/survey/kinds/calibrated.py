"""Distances and zenith angles with unknowns of their instrument or their day: constant, scale, refraction."""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.survey.kinds.directions import ZEN
from obseq.survey.kinds.kind import ObservationKind, Shared, Site, Start
from obseq.survey.kinds.lengths import DIST, DIST_HZ

SHORTEST = 1e-9
"""Length (m) that stands for shorter ones in a division."""


@dataclass(frozen=True)
class OfInstrument(ObservationKind):
    """An observation with unknowns of its group, in linear rows that are made anew at each place.

    The unknowns are those that a user asks for, by the same names.
    """

    is_raised: bool = True
    depends_on_place: bool = True

    def blocks(self, site: Site, rows: IntArray) -> dict[str, IntArray]:
        """Both ends, and the unknowns."""
        origins, targets = site.ends(rows)
        return {"origin": origins, "target": targets} | {
            part: site.shared(rows, part) for part in self.with_unknowns
        }

    def context(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """Derivatives by both ends, and by the unknowns."""
        along = self.towards(site, rows, coordinates)[1]
        return np.hstack([-along, along, -self.shares(site, rows, coordinates)])

    def values(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """What makes the row that of the tangent there."""
        computed, along = self.towards(site, rows, coordinates)
        first, last = site.positions(rows, coordinates)
        here = np.einsum("ni,ni->n", along, last - first)
        return np.asarray(self.reading(site, rows, coordinates) - computed + here)

    def towards(self, site: Site, rows: IntArray, coordinates: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n,) computed values without the unknowns, and (n, 3) derivatives by the target."""
        raise NotImplementedError

    def shares(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n, k) what one unit of each unknown adds to what was read."""
        raise NotImplementedError

    def reading(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n,) what was read, where all unknowns are 0."""
        return site.measured(rows)

    def sights(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n, 3) from instrument to target."""
        first, last = site.positions(rows, coordinates)
        return np.asarray(last - first + site.offsets(rows, coordinates))


@dataclass(frozen=True)
class CalibratedDistance(OfInstrument):
    """A slope distance of an instrument: true = read (1 + scale) + constant."""

    def problem(self, value: float) -> str | None:
        """Distances are positive."""
        return None if value > 0.0 else "is not positive"

    def towards(self, site: Site, rows: IntArray, coordinates: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Distances and directions."""
        sights = self.sights(site, rows, coordinates)
        lengths = np.linalg.norm(sights, axis=1)
        return lengths, sights / np.maximum(lengths, SHORTEST)[:, None]

    def shares(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """1 for the constant, what was read for the scale."""
        read = site.measured(rows)
        columns = {"constant": np.ones(len(rows)), "scale": read}
        return np.column_stack([columns[part] for part in self.with_unknowns])

    def shared_unknowns(self, site: Site, rows: IntArray, coordinates: FloatArray) -> dict[str, Shared]:
        """An instrument without error."""
        return {part: Shared(0.0) for part in self.with_unknowns}


@dataclass(frozen=True)
class CalibratedHorizontalDistance(CalibratedDistance):
    """A horizontal distance of an instrument, in the horizon of its first point."""

    def towards(self, site: Site, rows: IntArray, coordinates: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Distances and directions in the horizon."""
        up = site.verticals(rows, coordinates)[:, 2]
        sights = self.sights(site, rows, coordinates)
        flat = sights - np.einsum("ni,ni->n", sights, up)[:, None] * up
        lengths = np.linalg.norm(flat, axis=1)
        return lengths, flat / np.maximum(lengths, SHORTEST)[:, None]


@dataclass(frozen=True)
class ZenithWithRefraction(OfInstrument):
    """A zenith angle of a plumb instrument, with the refraction coefficient of its group."""

    def towards(self, site: Site, rows: IntArray, coordinates: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Zenith angles of straight lines, corrected by the coefficient of the network."""
        axes, sights = site.verticals(rows, coordinates), self.sights(site, rows, coordinates)
        east, north, up = np.einsum("nij,nj->in", axes, sights)
        flat = np.maximum(np.hypot(east, north), SHORTEST)
        square = np.square(flat) + np.square(up)
        local = np.column_stack([east * up / flat, north * up / flat, -flat]) / square[:, None]
        return np.arctan2(flat, up), np.einsum("ni,nij->nj", local, axes)

    def slopes(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """Of the refraction."""
        coefficients = site.shared_values(rows, "refraction") - site.is_plane
        return -coefficients * site.slopes_of_refraction(rows, coordinates)

    def shares(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """The correction for a coefficient of 1."""
        return site.refraction_of_one(rows, coordinates)[:, None]

    def reading(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """With the correction where the coefficient is 0: curvature, in a plane."""
        given, share = site.refraction(rows, coordinates), site.refraction_of_one(rows, coordinates)
        return np.asarray(site.measured(rows) + given - site.refraction_coefficient * share)

    def shared_unknowns(self, site: Site, rows: IntArray, coordinates: FloatArray) -> dict[str, Shared]:
        """The coefficient of the network."""
        return {"refraction": Shared(site.refraction_coefficient)}


def _distance(
    make: type[CalibratedDistance], plain: ObservationKind, suffix: str, code: int, *parts: str
) -> CalibratedDistance:
    return make(
        plain.name + suffix,
        code,
        f"{plain.words} with unknown {' and '.join(parts)}",
        start=plain.start,
        plain=plain,
        with_unknowns=parts,
        is_plumb=plain.is_plumb,
    )


DIST_CONSTANT = _distance(CalibratedDistance, DIST, "C", 161, "constant")
DIST_SCALE = _distance(CalibratedDistance, DIST, "S", 162, "scale")
DIST_CONSTANT_SCALE = _distance(CalibratedDistance, DIST, "CS", 163, "constant", "scale")
DIST_HZ_CONSTANT = _distance(CalibratedHorizontalDistance, DIST_HZ, "C", 165, "constant")
DIST_HZ_SCALE = _distance(CalibratedHorizontalDistance, DIST_HZ, "S", 166, "scale")
DIST_HZ_CONSTANT_SCALE = _distance(CalibratedHorizontalDistance, DIST_HZ, "CS", 167, "constant", "scale")
ZEN_REFRACTION = ZenithWithRefraction(
    "ZenK",
    164,
    "zenith angle with unknown refraction",
    is_angle=True,
    needs_station=True,
    start=Start.ZENITH,
    plain=ZEN,
    with_unknowns=("refraction",),
)
