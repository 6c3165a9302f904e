"""Points of a survey network, in columns (metres)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from obseq.arguments import ARRAY, NOTHING, TEXTS, expecting, instance, sequence
from obseq.arrays import BoolArray, FloatArray
from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.errors import InputError

IntArray = npt.NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class CoordinateCovariance:
    """Covariance of known coordinates.

    Attributes:
        coordinates: (k) name of the point and component (0 to 2) of each.
        matrix: (k, k) m^2, symmetric and positive definite.
    """

    coordinates: tuple[tuple[str, int], ...]
    matrix: FloatArray


@dataclass(frozen=True, eq=False)
class Points:
    """Points, one row each.

    Attributes:
        names: unique names.
        coordinates: (n, 3) float64 metres; NaN where the file gives none.
        sigmas: (n, 3) float64 metres; NaN for a free component, 0 for a held one, else its constraint.
        deflections: (n, 2) float64 rad, east (eta) and north (xi) deflection of the vertical; NaN where the
            file gives none.
        infos: additional text of the point, empty when there is none.
        files: names of the files the points come from.
        file_indices: (n,) int32 index in `files`; -1 for a point that only observations name.
        lines: (n,) int32 line in that file, from 1; 0 for a point that only observations name.
        covariance: what replaces the sigmas of some known coordinates; None for nothing.
        datum: (n, 3) true for free components that carry the datum of a free network: the sum of squares of
            their changes from the coordinates of the file is least; None for none.
        invented: (n, 3) true for components that nothing observes: where they stand, held, is a place to
            compute at, and no result; None for none. Those without a constraint are held where they start.
    """

    names: tuple[str, ...]
    coordinates: FloatArray
    sigmas: FloatArray
    deflections: FloatArray
    infos: tuple[str, ...]
    files: tuple[str, ...]
    file_indices: IntArray
    lines: IntArray
    covariance: CoordinateCovariance | None = None
    datum: BoolArray | None = None
    invented: BoolArray | None = None

    def __len__(self) -> int:
        return len(self.names)

    @property
    def in_datum(self) -> BoolArray:
        """(n, 3) true for the components that carry the datum."""
        return np.zeros((len(self), 3), np.bool_) if self.datum is None else self.datum

    @property
    def is_invented(self) -> BoolArray:
        """(n, 3) true for the components that are no result."""
        return np.zeros((len(self), 3), np.bool_) if self.invented is None else self.invented

    @cached_property
    def index(self) -> dict[str, int]:
        """Row of each name."""
        return {name: row for row, name in enumerate(self.names)}

    @property
    def is_free(self) -> BoolArray:
        """(n, 3) true where a component has no constraint."""
        return np.isnan(self.sigmas)

    @property
    def is_unknown(self) -> BoolArray:
        """(n, 3) true where observations have to determine a component."""
        return np.asarray(self.is_free & ~self.is_invented)

    @property
    def is_held(self) -> BoolArray:
        """(n, 3) true where a component is fixed (sigma 0)."""
        return np.asarray(self.sigmas == 0.0)

    @property
    def has_coordinates(self) -> BoolArray:
        """(n,) true where the three coordinates are finite."""
        return np.asarray(np.isfinite(self.coordinates).all(axis=1))

    def subset(self, rows: npt.NDArray[np.intp]) -> Points:
        """Some of the points, in the order of their rows."""
        return replace(
            self,
            names=tuple(self.names[row] for row in rows.tolist()),
            coordinates=self.coordinates[rows],
            sigmas=self.sigmas[rows],
            deflections=self.deflections[rows],
            infos=tuple(self.infos[row] for row in rows.tolist()),
            file_indices=self.file_indices[rows],
            lines=self.lines[rows],
            datum=None if self.datum is None else self.datum[rows],
            invented=None if self.invented is None else self.invented[rows],
        )

    def place(self, row: int) -> str:
        """`file:line` of a point, for messages."""
        if self.file_indices[row] < 0:
            return "named by observations only"
        return f"{self.files[self.file_indices[row]]}:{self.lines[row]}"


@expecting(names=TEXTS, coordinates=ARRAY, sigmas=ARRAY | NOTHING)
def make_points(
    names: Sequence[str], coordinates: npt.ArrayLike, sigmas: npt.ArrayLike | None = None
) -> Points:
    """Points made in memory.

    Args:
        names: unique names.
        coordinates: (n, 3) metres, NaN where unknown.
        sigmas: (n, 3) metres as in `Points`; all free when left out.
    """
    n = len(names)
    _require_distinct_names(names)
    xyz = _table("coordinates", coordinates, n)
    sigma = np.full((n, 3), np.nan) if sigmas is None else _table("sigmas", sigmas, n)
    nowhere, no_line = np.full(n, -1, np.int32), np.zeros(n, np.int32)
    deflections = np.full((n, 2), np.nan)
    return Points(tuple(names), xyz, sigma, deflections, ("",) * n, (), nowhere, no_line)


def _require_distinct_names(names: Sequence[str]) -> None:
    seen: dict[str, int] = {}
    for row, name in enumerate(names, 1):
        if seen.setdefault(name, row) != row:
            raise InputError(
                f"make_points: point {name} is given twice, as names {seen[name]} and {row}; keep one"
            )


def points_of_lines(
    names: Sequence[str],
    coordinates: FloatArray,
    sigmas: FloatArray,
    file: str,
    lines: Mapping[str, int],
) -> Points:
    """Points of one file, with the lines that they stand in; those without a line are named elsewhere."""
    numbers = np.array([lines.get(name, 0) for name in names], np.int32)
    indices = np.where(numbers > 0, 0, -1).astype(np.int32)
    return replace(
        make_points(names, coordinates, sigmas), files=(file,), file_indices=indices, lines=numbers
    )


def _table(what: str, numbers: npt.ArrayLike, n: int) -> FloatArray:
    """A new array (n, 3)."""
    array = np.array(numbers, dtype=np.float64)
    if array.size != 3 * n:
        raise InputError(f"make_points: {what} must have the shape ({n}, 3), not {array.shape}")
    return array.reshape(n, 3)


@expecting(parts=sequence(instance(Points), "Points"))
def merge_points(parts: Sequence[Points]) -> Points:
    """One table from several files.

    Raises:
        InputError: a name occurs twice.
    """
    shifts = np.cumsum([0] + [len(part.files) for part in parts[:-1]])
    indices = [
        np.where(part.file_indices < 0, -1, part.file_indices + shift)
        for part, shift in zip(parts, shifts, strict=False)
    ]
    merged = Points(
        names=tuple(name for part in parts for name in part.names),
        coordinates=np.concatenate([np.zeros((0, 3))] + [part.coordinates for part in parts]),
        sigmas=np.concatenate([np.zeros((0, 3))] + [part.sigmas for part in parts]),
        deflections=np.concatenate([np.zeros((0, 2))] + [part.deflections for part in parts]),
        infos=tuple(info for part in parts for info in part.infos),
        files=tuple(file for part in parts for file in part.files),
        file_indices=np.concatenate([np.zeros(0, np.int32), *indices]).astype(np.int32),
        lines=np.concatenate([np.zeros(0, np.int32)] + [part.lines for part in parts]),
        covariance=next((part.covariance for part in parts if part.covariance), None),
        datum=_merged(parts, [part.datum for part in parts]),
        invented=_merged(parts, [part.invented for part in parts]),
    )
    _require_unique(merged)
    return merged


def _merged(parts: Sequence[Points], marks: Sequence[BoolArray | None]) -> BoolArray | None:
    """Marks of components, none where a part has none."""
    if all(mark is None for mark in marks):
        return None
    pairs = zip(parts, marks, strict=True)
    return np.concatenate([np.zeros((len(p), 3), np.bool_) if m is None else m for p, m in pairs])


def _require_unique(points: Points) -> None:
    seen: dict[str, int] = {}
    for row, name in enumerate(points.names):
        first = seen.setdefault(name, row)
        if first != row:
            raise InputError(
                f"{points.place(row)}: point {name} is given twice (first at {points.place(first)}); "
                "keep one of the two lines"
            )
