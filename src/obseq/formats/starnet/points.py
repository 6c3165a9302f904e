"""Points of STAR*NET files: coordinates (C) and elevations (E), fixed, free or with standard errors."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from obseq.arrays import FloatArray
from obseq.formats.starnet.values import DEFAULT, FIXED, FREE, MARKS, Line
from obseq.reading.text import quoted
from obseq.survey.model import Points, points_of_lines

_NOTHING = (math.nan, math.nan, math.nan)


class PointLines:
    """The points of a network while its lines are read; lines of one point may not contradict each other."""

    def __init__(self) -> None:
        self._values: dict[str, list[float]] = {}
        self._sigmas: dict[str, list[float]] = {}
        self._lines: dict[str, int] = {}
        self._metres: dict[str, float] = {}
        self._said: dict[tuple[str, int], tuple[float, float, str]] = {}

    def read(self, line: Line) -> bool | None:
        """Takes a C or E line; whether it says that the network is a plane (None: neither)."""
        is_elevation = line.fields[0].lower() == "e"
        if len(line.fields) < 3:
            raise line.error("a point is: C name north east [height] [standard errors], or E name height")
        name, rest = line.fields[1], line.fields[2:]
        line.file.check_name(line.index, name)
        count = 1 if is_elevation else self._count(line, rest)
        values = [line.length(text) for text in rest[:count]]
        sigmas = self._errors(line, rest[count:], count)
        if not is_elevation:
            self._metres[name] = line.options.metres
        axes = (2,) if is_elevation else (0, 1, 2) if line.options.east_first else (1, 0, 2)
        known, spread = self._of(name, line)
        for axis, value, sigma in zip(axes, values, sigmas, strict=False):
            self._check_again(line, name, axis, value, sigma)
            known[axis], spread[axis] = value, sigma
        return None if is_elevation else count == 2

    def _check_again(self, line: Line, name: str, axis: int, value: float, sigma: float) -> None:
        """Refuses a coordinate given otherwise before; E may replace the approximate height of C."""
        here = (value, sigma, f"{line.file.name}:{line.index + 1}")
        before = self._said.setdefault((name, axis), here)
        if line.fields[0].lower() == "e" and math.isnan(before[1]):
            self._said[name, axis] = before = here
        if before[0] != value or repr(before[1]) != repr(sigma):
            raise line.error(
                f"point {name} is given twice, with other coordinates or standard errors (first at "
                f"{before[2]}); keep one of the two lines"
            )

    def _of(self, name: str, line: Line) -> tuple[list[float], list[float]]:
        self._lines.setdefault(name, line.index + 1)
        return self._values.setdefault(name, [*_NOTHING]), self._sigmas.setdefault(name, [*_NOTHING])

    @staticmethod
    def _count(line: Line, rest: Sequence[str]) -> int:
        """How many of the fields are coordinates."""
        numbers = next((k for k, text in enumerate(rest) if text in MARKS), len(rest))
        is_plane = line.options.is_plane
        if is_plane is None:
            is_plane = len(rest) in (2, 4)
        count = 2 if is_plane else 3
        if numbers < count or len(rest) not in (count, 2 * count):
            raise line.error(
                f"{len(rest)} fields after the name: {count} coordinates, then perhaps {count} standard "
                f"errors, are possible in {'2D' if is_plane else '3D'}"
            )
        return count

    @staticmethod
    def _errors(line: Line, texts: Sequence[str], count: int) -> list[float]:
        """Sigmas of coordinates: NaN for free, 0 for held."""
        if len(texts) not in (0, count):
            raise line.error(f"{len(texts)} standard errors for {count} coordinates")
        found = []
        for text in texts:
            if text == DEFAULT:
                raise line.error("the default standard error (&) stands in the project file: write it")
            sigma = math.nan if text == FREE else 0.0 if text == FIXED else line.length(text)
            if sigma < 0.0:
                raise line.error(f"the standard error {quoted(text)} is negative")
            found.append(sigma)
        return found or [math.nan] * count

    def units(self, names: Sequence[str]) -> FloatArray:
        """(n,) metres in the unit in which each point stands in the file."""
        return np.array([self._metres.get(name, 1.0) for name in names])

    def points(self, file: str, named: Sequence[str], is_plane: bool) -> Points:
        """All points: those of the lines, then those that only observations name.

        Args:
            file: Of the points.
            named: Names in observations.
            is_plane: Whether there are no heights: they are 0 then, and held.
        """
        names = list(dict.fromkeys([*self._values, *named]))
        coordinates = np.array([self._values.get(name, _NOTHING) for name in names]).reshape(-1, 3)
        sigmas = np.array([self._sigmas.get(name, _NOTHING) for name in names]).reshape(-1, 3)
        if is_plane:
            coordinates[:, 2], sigmas[:, 2] = 0.0, 0.0
        return points_of_lines(names, coordinates, sigmas, file, self._lines)
