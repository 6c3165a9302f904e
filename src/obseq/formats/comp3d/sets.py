"""Files of observations that a line of a Comp3D OBS file names: sub-frames, axes, vectors, equalities."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from obseq.dataclass import dataclass
from obseq.formats.columns import Columns, Measure
from obseq.formats.includes import Folder
from obseq.reading.text import LEAST_SIGMA, TextFile, quoted
from obseq.survey.kinds.axes import AXIS_LINK, AXIS_PLANE, AXIS_RADIUS
from obseq.survey.kinds.components import DX, DY, DZ
from obseq.survey.kinds.directions import ALPHA, BETA
from obseq.survey.kinds.equalities import EQUAL_DH, EQUAL_DIST
from obseq.survey.kinds.lengths import DIST
from obseq.survey.kinds.vectors import VECTOR, VECTOR_Y, VECTOR_Z
from obseq.survey.model import Orientation

CARTESIAN, POLAR, AXIS, BASELINES, EQUAL_HEIGHTS, EQUAL_LENGTHS = SETS = (11, 12, 18, 19, 21, 22)
PLUMB = {"V": True, "1": True, "N": False, "-1": False}
LINK_SIGMA = 0.001
"""Sigma of the foot of a point on an axis, as Comp3D fixes it."""


@dataclass(frozen=True)
class _Set:
    """One file: its number in the columns, and what the line that names it says.

    Attributes:
        number: Of the file.
        origin: Row of the origin; -1 for equalities.
        station: Station of a sub-frame; -1 without.
        group: Group of the observations; -1 without.
        factor: K, of the absolute sigmas.
        height: Height of the instrument.
    """

    number: int
    origin: int = -1
    station: int = -1
    group: int = -1
    factor: float = 1.0
    height: float = 0.0


class SetReader:
    """Reads the files of observations of one project."""

    def __init__(
        self, folder: Folder, columns: Columns, unit: float, ignored: frozenset[str], has_place: bool
    ) -> None:
        self._folder, self._columns, self._unit, self._ignored = folder, columns, unit, ignored
        self._has_place = has_place
        self._targets: dict[tuple[int, str], int] = {}
        self._turned: set[tuple[int, str]] = set()

    def read(self, code: int, file: TextFile, index: int, fields: list[str]) -> int:
        """Adds the observations of the file that a line names; returns how many lines are left out."""
        start = 1 if code in (EQUAL_HEIGHTS, EQUAL_LENGTHS) else 2
        if len(fields) <= start or not fields[start].startswith("@"):
            raise file.error(
                index, f"code {code} needs {'' if start == 1 else 'an origin and '}a file: @file"
            )
        if code == BASELINES and not self._has_place:
            raise file.error(
                index,
                "geocentric vectors (code 19) are for georeferenced projects, and this one is local "
                "(use_proj false): give the project the system of its points (use_proj true, proj_def)",
            )
        if start == 2 and fields[1] in self._ignored:
            return 1
        opened: list[int] = []
        lines = self._folder.lines(
            fields[start][1:],
            lambda found: opened.append(self._columns.open_file(found)),
            includes=False,
            beside=Path(file.name).parent,
        )
        origin = self._columns.point(file, index, fields[1]) if start == 2 else -1
        chosen: _Set | None = None
        left_out = 0
        for found, line, parts in lines:
            chosen = chosen or self._opened(code, file, index, origin, fields[start + 1 :], opened[0], fields)
            if self._ignored.intersection(self._names(code, parts)):
                left_out += 1
            else:
                self._read_line(code, found, line, parts, chosen)
        return left_out

    @staticmethod
    def _names(code: int, parts: list[str]) -> list[str]:
        if code == AXIS:
            return parts[1:2] if parts[0] == "L" else parts[2:3]
        return parts[:2] if code in (EQUAL_HEIGHTS, EQUAL_LENGTHS) else parts[:1]

    def _opened(
        self,
        code: int,
        file: TextFile,
        index: int,
        origin: int,
        rest: list[str],
        number: int,
        line: list[str],
    ) -> _Set:
        """What the line says after the name of the file."""
        if code in (CARTESIAN, POLAR):
            chosen = self._sub_frame(file, index, origin, rest, number)
            if code == POLAR:
                name = f"polar frame {Path(line[2][1:]).name} at {line[1]}"
                return replace(chosen, group=self._columns.open_frame(name))
            return chosen
        if code == BASELINES:
            values = _numbers(file, index, rest)
            if len(values) > 2:
                raise file.error(index, "after the file of baselines: a factor of the sigmas, a height")
            factor, height = [*values, *(1.0, 0.0)[len(values) :]]
            return _Set(number, origin, factor=factor, height=height)
        name = f"axis {line[1]}" if code == AXIS else f"equal values ({Path(line[1][1:]).name})"
        if code in (EQUAL_HEIGHTS, EQUAL_LENGTHS):
            _numbers(file, index, rest)
        elif rest:
            raise file.error(index, f"{quoted(rest[0])!r}: nothing follows the file of an axis")
        return _Set(number, origin, group=self._columns.open_group(name))

    def _sub_frame(self, file: TextFile, index: int, origin: int, rest: list[str], number: int) -> _Set:
        plumb, factor = False, 1.0
        if rest:
            if rest[0].upper() not in PLUMB:
                raise file.error(
                    index, f"{quoted(rest[0])!r}: V or 1 for a vertical third axis, N or -1 for none"
                )
            plumb = PLUMB[rest[0].upper()]
        if len(rest) > 1:
            (factor,) = _numbers(file, index, rest[1:2])
        if factor <= 0.0 or len(rest) > 2:
            raise file.error(
                index, "after the file of a sub-frame: V or N, then a positive factor of the sigmas"
            )
        orientation = Orientation.VERT if plumb else Orientation.BASC
        return _Set(number, origin, self._columns.open_station(origin, orientation), factor=factor)

    def _read_line(self, code: int, file: TextFile, index: int, parts: list[str], chosen: _Set) -> None:
        if code == AXIS:
            measures = self._axis(file, index, parts, chosen)
        elif code in (EQUAL_HEIGHTS, EQUAL_LENGTHS):
            measures = self._equality(code, file, index, parts, chosen)
        else:
            target = self._columns.point(file, index, parts[0])
            if target == chosen.origin:
                raise file.error(index, "the target is the origin; correct one of the two names")
            values = _numbers(file, index, parts[1:])
            if code == BASELINES:
                self._baseline(file, index, target, values, chosen)
                return
            read = _cartesian if code == CARTESIAN else _polar
            measures = read(file, index, (chosen, target), values, self._unit)
        for measure in measures:
            self._columns.append(measure, chosen.number, index)

    def _axis(self, file: TextFile, index: int, parts: list[str], chosen: _Set) -> tuple[Measure, ...]:
        """A point of a target, at a distance from the axis and in a plane; or the foot of a point."""
        if parts[0] == "L":
            if len(parts) != 2:
                raise file.error(index, "the foot of a point on the axis: L point")
            point = self._columns.point(file, index, parts[1])
            return (Measure(AXIS_LINK, chosen.origin, point, 0.0, LINK_SIGMA, group=chosen.group),)
        if len(parts) != 5:
            raise file.error(
                index, f"{len(parts)} fields where 5 are needed: target position point sigma sigma"
            )
        radius, plane = _sigmas(file, index, _numbers(file, index, parts[3:]))
        point = self._columns.point(file, index, parts[2])
        for what in (f"point {parts[2]}", f"position {parts[1]} of target {parts[0]}"):
            if (chosen.group, what) in self._turned:
                raise file.error(index, f"{what} is given twice in this file; keep one of the two lines")
            self._turned.add((chosen.group, what))
        key = (chosen.group, parts[0])
        if key not in self._targets:
            name = f"target {parts[0]} of {self._columns.groups[chosen.group].name}"
            self._targets[key] = self._columns.open_group(name, chosen.group)
        group = self._targets[key]
        return tuple(
            Measure(kind, chosen.origin, point, 0.0, sigma, sigma > 0.0, group=group)
            for kind, sigma in ((AXIS_RADIUS, radius), (AXIS_PLANE, plane))
        )

    def _equality(
        self, code: int, file: TextFile, index: int, parts: list[str], chosen: _Set
    ) -> tuple[Measure, ...]:
        if len(parts) != 3:
            raise file.error(index, f"{len(parts)} fields where 3 are needed: point point sigma")
        first, second = (self._columns.point(file, index, name) for name in parts[:2])
        (sigma,) = _sigmas(file, index, _numbers(file, index, parts[2:]))
        if first == second:
            raise file.error(index, "the two points are the same; correct one of the names")
        kind = EQUAL_DH if code == EQUAL_HEIGHTS else EQUAL_DIST
        return (Measure(kind, first, second, 0.0, sigma, sigma > 0.0, group=chosen.group),)

    def _baseline(self, file: TextFile, index: int, target: int, values: list[float], chosen: _Set) -> None:
        if len(values) not in (9, 10):
            raise file.error(
                index, "a baseline is: target dX dY dZ sxx sxy sxz syy syz szz [height of the target]"
            )
        xx, xy, xz, yy, yz, zz = values[3:9]
        is_active = min(xx, yy, zz) > 0.0
        covariance = np.array([[abs(xx), xy, xz], [xy, abs(yy), yz], [xz, yz, abs(zz)]]) * chosen.factor**2
        if np.linalg.eigvalsh(covariance)[0] < 1e-16:
            raise file.error(index, "the covariance of the baseline is not positive definite")
        height = values[9] if len(values) == 10 else 0.0
        sigmas = np.sqrt(np.diag(covariance)).tolist()
        measures = tuple(
            Measure(kind, chosen.origin, target, value, sigma, is_active, 0.0, chosen.height, height)
            for kind, value, sigma in zip((VECTOR, VECTOR_Y, VECTOR_Z), values[:3], sigmas, strict=True)
        )
        first = len(self._columns)
        for measure in measures:
            self._columns.append(measure, chosen.number, index)
        self._columns.correlate([first, first + 1, first + 2], covariance)


def _cartesian(
    file: TextFile, index: int, ends: tuple[_Set, int], values: list[float], _: float
) -> tuple[Measure, ...]:
    """X Y Z s | X Y Z s rel | X Y Z sX sY sZ [rel [h]]."""
    if len(values) not in (4, 5, 6, 7, 8):
        raise file.error(index, "a line of a sub-frame is: target X Y Z s [rel], or sX sY sZ [rel [height]]")
    rest = values[3:]
    sigmas = [rest[0]] * 3 if len(rest) <= 2 else rest[:3]
    after = rest[1:] if len(rest) <= 2 else rest[3:]
    relative, height = [*after, *(0.0, 0.0)[len(after) :]]
    if relative < 0.0:
        raise file.error(index, "the relative sigma is negative")
    chosen, target = ends
    checked = _sigmas(file, index, [sigma * chosen.factor for sigma in sigmas])
    return tuple(
        Measure(kind, chosen.origin, target, value, sigma, sigma > 0.0, relative, 0.0, height, chosen.station)
        for kind, value, sigma in zip((DX, DY, DZ), values[:3], checked, strict=True)
    )


def _polar(
    file: TextFile, index: int, ends: tuple[_Set, int], values: list[float], unit: float
) -> tuple[Measure, ...]:
    """Alpha beta d s_ang [rel_ang] s_d rel_d [h]."""
    if len(values) not in (6, 7, 8):
        raise file.error(
            index, "a line of a sub-frame is: target alpha beta d s_ang [rel_ang] s_d rel_d [height]"
        )
    chosen, target = ends
    angular, *rest = values[3:]
    relative_angle = rest.pop(0) if len(values) > 6 else 0.0
    length, relative_length = rest[:2]
    height = rest[2] if len(rest) > 2 else 0.0
    angular, length = _sigmas(file, index, [angular * chosen.factor, length * chosen.factor])
    if length > 0.0 and values[2] <= 0.0:
        raise file.error(index, f"the distance {values[2]:g} is not positive; correct it, or switch it off")
    at = (chosen.origin, target)
    station = chosen.station
    return (
        Measure(
            ALPHA, *at, values[0] * unit, angular * unit, angular > 0.0, relative_angle, 0.0, height, station
        ),
        Measure(
            BETA, *at, values[1] * unit, angular * unit, angular > 0.0, relative_angle, 0.0, height, station
        ),
        Measure(DIST, *at, values[2], length, length > 0.0, relative_length, 0.0, height, group=chosen.group),
    )


def _numbers(file: TextFile, index: int, texts: list[str]) -> list[float]:
    return [file.number(index, text) for text in texts]


def _sigmas(file: TextFile, index: int, sigmas: list[float]) -> list[float]:
    """The sigmas; a negative one switches off."""
    if any(abs(sigma) < LEAST_SIGMA for sigma in sigmas):
        raise file.error(index, "a sigma of 0 makes the weight infinite; give the standard deviation")
    return sigmas
