"""Vectors and coordinates in Gama's files, each set with its covariance matrix."""

from __future__ import annotations

from collections.abc import Iterator
from xml.sax.saxutils import quoteattr

import numpy as np

from obseq.arrays import FloatArray
from obseq.errors import InputError
from obseq.formats.gama.sets import LARGEST_PART, SetWriter, matrix_lines, number
from obseq.formats.gama.values import MILLIMETRE
from obseq.survey.kinds.coordinates import POINT_X, POINT_Y, POINT_Z
from obseq.survey.kinds.registry import codes
from obseq.survey.kinds.vectors import LOCAL_X, LOCAL_Y, LOCAL_Z

VECTORS = codes(LOCAL_X, LOCAL_Y, LOCAL_Z)
COORDINATES = codes(POINT_X, POINT_Y, POINT_Z)


class CoordinateWriter(SetWriter):
    """Vectors, observed coordinates, and known ones with a standard deviation."""

    def vectors(self) -> Iterator[str]:
        """Vectors, whose three components follow each other."""
        rows = self.rows
        mine = np.flatnonzero(rows.active & np.isin(rows.types, VECTORS))
        for members in self.parts(mine):
            triples = [
                sorted(members[k : k + 3], key=lambda row: int(rows.types[row]))
                for k in range(0, len(members), 3)
            ]
            for triple in triples:
                if len(triple) < 3 or rows.types[triple].tolist() != VECTORS:
                    raise InputError(f"{self.book.label(triple[0])}: Gama takes vectors of three components")
            yield "<vectors>"
            yield from (self._vector(triple) for triple in triples)
            yield from self._turned([row for triple in triples for row in triple])
            yield "</vectors>"

    def _vector(self, triple: list[int]) -> str:
        rows = self.rows
        lift = np.array([0.0, 0.0, float(rows.from_heights[triple[0]] - rows.to_heights[triple[0]])])
        numbers = self.network.turn @ (rows.values[triple] + lift)
        parts = (f"d{axis}={number(float(value))}" for axis, value in zip("xyz", numbers, strict=True))
        origin, target = (
            quoteattr(self.book.point_names[ends[triple[0]]]) for ends in (rows.from_points, rows.to_points)
        )
        return f"  <vec from={origin} to={target} {' '.join(parts)}{self.extern(triple[0])} />"

    def _turned(self, members: list[int]) -> Iterator[str]:
        """The matrix of vectors, in the axes of the file."""
        turn = np.kron(np.eye(len(members) // 3), self.network.turn)
        covariance = turn @ self.covariance_of(members) @ turn.T
        yield from matrix_lines(covariance, np.full(len(members), MILLIMETRE))

    def coordinates(self) -> Iterator[str]:
        """Observed coordinates, and known ones with a standard deviation."""
        rows = self.rows
        mine = np.flatnonzero(rows.active & np.isin(rows.types, COORDINATES))
        for members in self.parts(mine):
            axes = [COORDINATES.index(int(rows.types[row])) for row in members]
            named = [
                (int(rows.from_points[row]), *self._along(axis), float(rows.values[row]), row)
                for row, axis in zip(members, axes, strict=True)
            ]
            signs = np.array([sign for _, _, sign, _, _ in named])
            covariance = self.covariance_of(members) * np.outer(signs, signs)
            yield from self._observed([(p, a, s * v) for p, a, s, v, _ in named], covariance)
        yield from self._known()

    def _along(self, axis: int) -> tuple[int, float]:
        """Axis of the file that is an axis of the frame, and its sense."""
        column = self.network.turn[:, axis]
        other = int(np.abs(column).argmax())
        return other, float(column[other])

    def _known(self) -> Iterator[str]:
        points = self.network.points
        rows = np.flatnonzero((points.sigmas > 0.0).any(axis=1))
        size = max(len(rows), 1) if points.covariance is not None else LARGEST_PART
        for first in range(0, len(rows), size):
            chosen = rows[first : first + size]
            places = [
                (row, axis) for row in chosen.tolist() for axis in range(3) if points.sigmas[row, axis] > 0.0
            ]
            yield from self._known_part(places)

    def _known_part(self, places: list[tuple[int, int]]) -> Iterator[str]:
        points = self.network.points
        covariance = np.diag([float(points.sigmas[row, axis]) ** 2 for row, axis in places])
        if points.covariance is not None:
            order = {(points.names[row], axis): k for k, (row, axis) in enumerate(places)}
            chosen = [order[key] for key in points.covariance.coordinates]
            covariance[np.ix_(chosen, chosen)] = points.covariance.matrix
        values = [(row, axis, float(points.coordinates[row, axis])) for row, axis in places]
        yield from self._observed(values, covariance)

    def _observed(self, values: list[tuple[int, int, float]], covariance: FloatArray) -> Iterator[str]:
        """A set of coordinates (point, axis, value), sorted by point and axis as Gama wants them."""
        order = sorted(range(len(values)), key=lambda k: values[k][:2])
        by_point: dict[int, dict[str, float]] = {}
        for k in order:
            point, axis, value = values[k]
            if "xyz"[axis] in by_point.setdefault(point, {}):
                raise InputError(
                    f"point {self.book.point_names[point]}: a coordinate is observed twice in one cluster, "
                    "which Gama does not take"
                )
            by_point[point]["xyz"[axis]] = value
        yield "<coordinates>"
        for point, given in by_point.items():
            name = self.book.point_names[point]
            if ("x" in given) != ("y" in given):
                raise InputError(f"point {name}: one of x and y is observed, and Gama takes both or none")
            parts = (f"{axis}={number(value)}" for axis, value in given.items())
            yield f"  <point id={quoteattr(name)} {' '.join(parts)} />"
        yield from matrix_lines(covariance[np.ix_(order, order)], np.full(len(order), MILLIMETRE))
        yield "</coordinates>"
