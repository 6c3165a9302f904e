"""Networks as files of gama-local: `read_gama` gives them back, Gama adjusts them to the same coordinates."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from obseq.arrays import BoolArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.formats.gama.coordinates import COORDINATES, VECTORS, CoordinateWriter
from obseq.formats.gama.sets import GamaNetwork, matrix_lines, number
from obseq.formats.gama.values import MILLIMETRE, RADIANS_PER_CC, RADIANS_PER_GON
from obseq.survey.initial.plan_only import with_plans_only
from obseq.survey.kinds.coordinates import POINT_Z
from obseq.survey.kinds.directions import ANGLE, AZIM, HZ, ZEN
from obseq.survey.kinds.kind import ObservationKind
from obseq.survey.kinds.lengths import DH, DIST, DIST_HZ
from obseq.survey.kinds.registry import BY_CODE, codes
from obseq.survey.model import Orientation, automatic_fix

NAMESPACE = "http://www.gnu.org/software/gama/gama-local"
ELEMENTS = {
    HZ.code: "direction",
    AZIM.code: "azimuth",
    ANGLE.code: "angle",
    ZEN.code: "z-angle",
    DIST.code: "s-distance",
    DIST_HZ.code: "distance",
}
WRITTEN = (*ELEMENTS, DH.code, *VECTORS, *COORDINATES)
WITH_HEIGHTS = codes(DIST, ZEN)
IN_HEIGHT = (*codes(DIST, ZEN, DH, POINT_Z), *VECTORS)
ONLY_IN_HEIGHT = codes(DH, POINT_Z)
ALONE = (ANGLE, DIST, DIST_HZ)
"""Kinds that need no set-up."""


def gama_text(network: GamaNetwork) -> str:
    """The network as the text of a file.

    Raises:
        InputError: Gama cannot adjust something in it; the observation or the point is named.
    """
    return "\n".join(_lines(network)) + "\n"


def _lines(network: GamaNetwork) -> Iterator[str]:
    writer = _Writer(network)
    yield '<?xml version="1.0" encoding="UTF-8"?>'
    yield f'<gama-local xmlns="{NAMESPACE}">'
    yield f'<network axes-xy="{network.axes}" angles="left-handed">'
    yield f"<description>{escape(network.description)}</description>"
    yield f'<parameters sigma-apr="{network.unit_sigma:.15g}" sigma-act="aposteriori" />'
    yield "<points-observations>"
    yield from writer.points()
    yield from writer.stations()
    yield from writer.others()
    yield from writer.vectors()
    yield from writer.coordinates()
    yield from writer.switched_off()
    yield "</points-observations>"
    yield "</network>"
    yield "</gama-local>"


@dataclass
class _Set:
    """Elements that one covariance matrix belongs to.

    Attributes:
        head: Opening tag.
        elements: The elements, without standard deviations where they can have some.
        rows: Observation of each scalar.
        units: Metres or radians in one unit of the matrix, of each scalar.
    """

    head: str
    elements: list[str] = field(default_factory=list)
    rows: list[int] = field(default_factory=list)
    units: list[float] = field(default_factory=list)


class _Writer(CoordinateWriter):
    def __init__(self, network: GamaNetwork) -> None:
        super().__init__(network)
        self._with_sights = np.zeros(len(self.rows), np.bool_)
        self._alone = self.rows.active & np.isin(self.rows.types, codes(*ALONE))
        self._check()

    def _check(self) -> None:
        """Refuses what Gama has no element for."""
        rows, book = self.rows, self.book
        unknown = np.flatnonzero(rows.active & ~np.isin(rows.types, WRITTEN))
        if unknown.size:
            kind = BY_CODE[int(rows.types[unknown[0]])]
            raise InputError(
                f"{book.label(int(unknown[0]))}: Gama has no observation like this ({kind.words})"
            )
        self._orientations = automatic_fix(book)
        free = np.isin(self._orientations, (Orientation.BASC, Orientation.GRID))
        if free.any():
            first = int(book.stations.observations(int(np.flatnonzero(free)[0]))[0])
            raise InputError(f"{book.label(first)}: Gama has no station that is not plumb (#BASC)")

    # Points

    def points(self) -> Iterator[str]:
        """All points, with the components that take part."""
        points = with_plans_only(self.network.points, self.book)
        plan, height = self._used()
        plan |= points.is_unknown[:, :2].any(axis=1)
        height |= points.is_unknown[:, 2]
        unused = ~(plan | height)
        plan |= unused & ~points.is_invented[:, :2].any(axis=1)
        height |= unused & ~points.is_invented[:, 2]
        for row, name in enumerate(points.names):
            yield self._point(row, name, bool(plan[row]), bool(height[row]))

    def _used(self) -> tuple[BoolArray, BoolArray]:
        """(n,) of the points, whether observations concern the plan, and the height."""
        rows, n = self.rows, len(self.network.points)
        in_height = rows.active & np.isin(rows.types, IN_HEIGHT)
        in_plan = rows.active & ~np.isin(rows.types, ONLY_IN_HEIGHT)
        return rows.counts(in_plan, n) > 0, rows.counts(in_height, n) > 0

    def _point(self, row: int, name: str, plan: bool, height: bool) -> str:
        points = self.network.points
        sigmas, datum = points.sigmas[row], points.in_datum[row]
        if (sigmas[0] == 0.0) != (sigmas[1] == 0.0) or np.isnan(sigmas[0]) != np.isnan(sigmas[1]):
            raise InputError(
                f"point {name} ({points.place(row)}): one of x and y is known, and Gama knows both or none"
            )
        fix, adj = "", ""
        for axes, used, first in (("xy", plan, 0), ("z", height, 2)):
            if used and sigmas[first] == 0.0:
                fix += axes
            elif used:
                adj += axes.upper() if datum[first] else axes
        xyz = points.coordinates[row]
        parts = [f"id={quoteattr(name)}"]
        if plan and np.isfinite(xyz[:2]).all():
            parts.append(f'x="{float(xyz[0])!r}" y="{float(xyz[1])!r}"')
        if height and np.isfinite(xyz[2]):
            parts.append(f'z="{float(xyz[2])!r}"')
        parts += [f'fix="{fix}"'] if fix else []
        parts += [f'adj="{adj}"'] if adj else []
        return f"<point {' '.join(parts)} />"

    # Sights

    def stations(self) -> Iterator[str]:
        """The set-ups: directions with what else was read there, and what is correlated with that."""
        for station in range(len(self.book.stations)):
            members = self.book.stations.observations(station)
            active = [int(row) for row in members if self.rows.active[row]]
            active += self._correlated(active)
            name = self.book.point_names[self.book.stations.origins[station]]
            if active:
                sights = _Set(f"<obs from={quoteattr(name)}>")
                for row in active:
                    self._add_sight(sights, row, self._orientations[station] == Orientation.FIX.value)
                yield from self._set(sights, "</obs>")

    def _correlated(self, sights: list[int]) -> list[int]:
        """Angles and distances that are correlated with sights of a set-up: they are written in its set."""
        numbers = {int(self.cluster[row]) for row in sights} - {-1}
        mates = [
            row for n in sorted(numbers) for row in self.book.clusters[n].rows.tolist() if self._alone[row]
        ]
        self._with_sights[mates] = True
        return mates

    def others(self) -> Iterator[str]:
        """Angles, distances and height differences; those of a cluster are a set of their own."""
        rows = self.rows
        for chosen, head, tail in (
            (ALONE, "<obs>", "</obs>"),
            ((DH,), "<height-differences>", "</height-differences>"),
        ):
            taken = rows.active & ~self._with_sights
            mine = np.flatnonzero(taken & np.isin(rows.types, codes(*chosen)))
            for members in self.by_cluster(mine):
                whole = _Set(head)
                for row in members:
                    if chosen == (DH,):
                        self._add_rise(whole, row)
                    else:
                        self._add_sight(whole, row, is_fixed=False)
                yield from self._set(whole, tail)

    def _add_sight(self, sights: _Set, row: int, is_fixed: bool) -> None:
        rows, kind = self.rows, BY_CODE[int(self.rows.types[row])]
        name = "azimuth" if kind is HZ and is_fixed else ELEMENTS[kind.code]
        origin, target, back = (
            quoteattr(self.book.point_names[ends[row]]) if ends[row] >= 0 else ""
            for ends in (rows.from_points, rows.to_points, rows.backsights)
        )
        ends = f"bs={back} fs={target}" if kind is ANGLE else f"to={target}"
        start = "" if kind is HZ and not is_fixed else f"from={origin} "
        unit = RADIANS_PER_GON if kind.is_angle else 1.0
        size = float(rows.values[row]) / unit
        value = size % 400.0 if kind.is_angle and kind is not ZEN else size
        heights = self._heights(row) if kind.code in WITH_HEIGHTS else ""
        sights.elements.append(f"{name} {start}{ends} val={number(value)}{heights}{self.extern(row)}")
        self._add_row(sights, row, kind)

    def _add_rise(self, whole: _Set, row: int) -> None:
        rows = self.rows
        value = float(rows.values[row] + rows.from_heights[row] - rows.to_heights[row])
        origin, target = (
            quoteattr(self.book.point_names[ends[row]]) for ends in (rows.from_points, rows.to_points)
        )
        whole.elements.append(f"dh from={origin} to={target} val={number(value)}{self.extern(row)}")
        self._add_row(whole, row, DH)

    def _add_row(self, whole: _Set, row: int, kind: ObservationKind) -> None:
        whole.rows.append(row)
        whole.units.append(RADIANS_PER_CC if kind.is_angle else MILLIMETRE)

    def _heights(self, row: int) -> str:
        low, high = float(self.rows.from_heights[row]), float(self.rows.to_heights[row])
        return f" from_dh={number(low)} to_dh={number(high)}" if low or high else ""

    def _set(self, whole: _Set, tail: str) -> Iterator[str]:
        """A set: each element with its standard deviation, or all with a matrix."""
        yield whole.head
        if (self.cluster[whole.rows] < 0).all():
            for element, row, unit in zip(whole.elements, whole.rows, whole.units, strict=True):
                yield f"  <{element} stdev={number(float(self.network.sigmas[row]) / unit)} />"
        else:
            yield from (f"  <{element} />" for element in whole.elements)
            yield from matrix_lines(self.covariance_of(whole.rows), np.array(whole.units))
        yield tail

    def switched_off(self) -> Iterator[str]:
        """What is not active, as remarks."""
        for row in np.flatnonzero(~self.rows.active).tolist():
            yield f"<!-- switched off: {self.book.label(row).replace('--', '- -')} -->"
