"""Points of Gama's files: in plan, in height or both, fixed, adjusted or carrying the datum."""

from __future__ import annotations

import math
from dataclasses import field

import numpy as np

from obseq.arrays import BoolArray, FloatArray
from obseq.dataclass import dataclass
from obseq.reading.text import TextFile, quoted
from obseq.reading.xml import Element
from obseq.survey.model import Points

ATTRIBUTES = ("id", "x", "y", "z", "fix", "adj")
_CHOICES = ("xy", "z", "xyz", "xyZ", "XY", "Z", "XYZ", "XYz")


@dataclass
class GamaPoint:
    """A point, as far as its elements have said.

    Attributes:
        line: Of the element whose coordinates are used, from 1.
        x, y, z: Coordinates in the axes of the file; NaN where unknown.
        fix: The components that are held, in lower case.
        adj: Those that are adjusted; upper case carries the datum.
        said: What <point> elements have said, by attribute and component, and in which line.
    """

    line: int
    x: float = math.nan
    y: float = math.nan
    z: float = math.nan
    fix: str = ""
    adj: str = ""
    said: dict[str, tuple[str, int]] = field(default_factory=dict)

    @property
    def has_plan(self) -> bool:
        """Whether its plan takes part."""
        return "x" in self.fix or "x" in self.adj.lower()

    @property
    def has_height(self) -> bool:
        """Whether its height takes part."""
        return "z" in self.fix or "z" in self.adj.lower()

    @property
    def coordinates(self) -> tuple[float, float, float]:
        """What is given of the components that take part."""
        x, y = (self.x, self.y) if self.has_plan else (math.nan, math.nan)
        return x, y, self.z if self.has_height else math.nan

    def sigmas(self) -> list[float]:
        """0 for what is held or takes no part; NaN for what is free."""
        free = [axis in self.adj.lower() and axis not in self.fix for axis in "xyz"]
        return [math.nan if is_free else 0.0 for is_free in free]

    def datum(self) -> list[bool]:
        """The components that carry the datum."""
        return [axis.upper() in self.adj and axis not in self.fix for axis in "xyz"]


class PointTable:
    """The points of a network, by name."""

    def __init__(self, file: TextFile) -> None:
        self._file = file
        self._points: dict[str, GamaPoint] = {}

    def __contains__(self, name: str) -> bool:
        return name in self._points

    def get(self, name: str) -> GamaPoint | None:
        """The point of a name, if an element declares it."""
        return self._points.get(name)

    def read(self, element: Element, *, is_observed: bool = False) -> str:
        """Takes over what an element says of its point; returns its name.

        Args:
            element: The element.
            is_observed: Whether its coordinates are observed ones, which may differ from those before.

        Raises:
            InputError: The element is wrong, or contradicts another one of the same point.
        """
        element.allow(ATTRIBUTES)
        name = element.wanted("id")
        element.file.check_name(element.line - 1, name)
        point = self._points.setdefault(name, GamaPoint(element.line))
        x, y, z = (element.number(axis) for axis in "xyz")
        if (x is None) != (y is None):
            raise element.error("x and y go together; give both or none")
        if x is not None and y is not None:
            if (x, y) != (point.x, point.y):
                point.line = element.line
            point.x, point.y = x, y
        point.z = point.z if z is None else z
        self._read_part(element, point)
        if not is_observed:
            _agree(element, name, point)
        return name

    def _read_part(self, element: Element, point: GamaPoint) -> None:
        fix, adj = element.get("fix"), element.get("adj")
        for text in (fix, adj):
            if text is not None and text not in _CHOICES:
                raise element.error(f"{quoted(text)!r} is none of {', '.join(_CHOICES)}")
        point.fix = _united(point.fix, (fix or "").lower())
        point.adj = _united(point.adj, adj or "")

    def points(self) -> Points:
        """The points that take part.

        Raises:
            InputError: A held component is not given.
        """
        used = {name: p for name, p in self._points.items() if p.has_plan or p.has_height}
        self._require_coordinates(used)
        coordinates = np.array([p.coordinates for p in used.values()], np.float64).reshape(-1, 3)
        sigmas = np.array([p.sigmas() for p in used.values()], np.float64).reshape(-1, 3)
        invented = self._fill(coordinates, used)
        datum = np.array([p.datum() for p in used.values()], np.bool_).reshape(-1, 3)
        n = len(used)
        return Points(
            names=tuple(used),
            coordinates=coordinates,
            sigmas=sigmas,
            deflections=np.full((n, 2), np.nan),
            infos=("",) * n,
            files=(self._file.name,),
            file_indices=np.zeros(n, np.int32),
            lines=np.array([p.line for p in used.values()], np.int32),
            datum=datum if datum.any() else None,
            invented=invented if invented.any() else None,
        )

    def _require_coordinates(self, used: dict[str, GamaPoint]) -> None:
        for name, point in used.items():
            values = dict(zip("xyz", (point.x, point.y, point.z), strict=True))
            lacking = [axis for axis in point.fix if math.isnan(values[axis])]
            if lacking:
                raise self._file.error(
                    point.line - 1,
                    f"point {name} is fixed, and {' '.join(lacking)} of it is not given",
                )

    @staticmethod
    def _fill(coordinates: FloatArray, used: dict[str, GamaPoint]) -> BoolArray:
        """What takes no part has some place: plans in the middle of the others, heights at 0.

        Returns:
            (n, 3) which components these are.
        """
        invented = np.zeros(coordinates.shape, np.bool_)
        plan = coordinates[np.isfinite(coordinates[:, 0]), :2]
        middle = plan.mean(axis=0) if len(plan) else np.zeros(2)
        for row, point in enumerate(used.values()):
            if not point.has_plan:
                coordinates[row, :2], invented[row, :2] = middle, True
            if not point.has_height:
                coordinates[row, 2], invented[row, 2] = 0.0, True
        return invented


def _agree(element: Element, name: str, point: GamaPoint) -> None:
    """Refuses what another element of the point has said otherwise; a later one may add to the first."""
    for what, value in _statements(element).items():
        before, line = point.said.setdefault(what, (value, element.line))
        if before != value:
            raise element.error(
                f"point {name} is given twice: {what} is {before} in line {line} and {value} here; "
                "keep one of the two"
            )


def _statements(element: Element) -> dict[str, str]:
    """What an element says of each component of its point, in words."""
    found = {axis: repr(value) for axis in "xyz" if (value := element.number(axis)) is not None}
    letters = element.get("adj") or ""
    adjusted = {axis.lower(): "constrained" if axis.isupper() else "free" for axis in letters}
    fixed = dict.fromkeys((element.get("fix") or "").lower(), "fixed")
    return found | {f"the state of {axis}": state for axis, state in (adjusted | fixed).items()}


def _united(before: str, new: str) -> str:
    """Components said before and now; what is said now of one of them counts."""
    kept = [axis for axis in before if axis.lower() not in new.lower()]
    return "".join(kept) + new
