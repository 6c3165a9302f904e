"""The motions of points that no residual sees, named where they are similarities."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.leastsquares.diagnosis.null_space import AXES, Part, common_similarities, parts, similarities
from obseq.leastsquares.problem.numbering import FreeUnknowns
from obseq.leastsquares.problem.unknowns import UnknownTable
from obseq.leastsquares.solvers import SymmetricPattern

ALIKE = 1e-3
"""Sine of the angle below which a motion is a similarity: verticals that are not quite parallel bend it."""

NEW = 0.5
"""Length of what is left of a motion of length 1 beside those found before, from which it is another."""

COMBINED = "position, rotation or scale, combined,"
SHAPE = "a change of shape"

Named = list[tuple[str, "FloatArray"]]


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion of points without any residual.

    Attributes:
        text: What it is: "the position along x", "the rotation about z", "the scale", or a change of shape.
        points: (n,) the points that move (ids).
        moves: (n, d) how; the farthest by 1.
    """

    text: str
    points: IntArray
    moves: FloatArray


def find_motions(
    table: UnknownTable, free: FreeUnknowns, pattern: SymmetricPattern, kernel: FloatArray
) -> Iterator[Motion]:
    """The motions that span a kernel (n_free, k), of each connected part of the unknowns for itself."""
    for part in parts(table, free, pattern, kernel):
        n, dimension, _ = part.movements.shape
        if n:
            coordinates = table.values[table.start[part.points][:, None] + np.arange(dimension)]
            for text, moved in _named(coordinates, part):
                moves = moved.reshape(n, dimension)
                yield Motion(text, part.points, moves / np.linalg.norm(moves, axis=1).max())


def _named(coordinates: FloatArray, part: Part) -> Named:
    """Motions (n d) that span the movements of a part: similarities along axes, others, changes of shape."""
    moved = part.movements.reshape(-1, part.movements.shape[2])
    alike = similarities(coordinates - coordinates.mean(axis=0))
    alike[~moved.any(axis=1)] = 0.0
    lengths = np.linalg.norm(alike, axis=0)
    alike = alike / np.where(lengths > 0.0, lengths, 1.0)
    found = _along_axes(alike, moved, part.movements.shape[1])
    found += _others(alike @ common_similarities(alike, moved, ALIKE), COMBINED, found)
    return found + _others(moved, SHAPE, found)


def _along_axes(alike: FloatArray, moved: FloatArray, dimension: int) -> Named:
    """One translation, one rotation, or the scale each, about wherever the movements let them.

    Args:
        alike: (n d, q) the similarities.
        moved: (n d, k) an orthonormal basis of the movements.
        dimension: Of the points.
    """
    found: Named = []
    for number, text in _tried(dimension):
        shifts = alike[:, : dimension if number >= dimension else 0]
        both = np.column_stack([moved, shifts])
        wanted = alike[:, number]
        chosen = np.linalg.lstsq(both, wanted, rcond=ALIKE)[0]
        rest = _apart(moved @ chosen[: moved.shape[1]], found)
        if np.linalg.norm(both @ chosen - wanted) < ALIKE and np.linalg.norm(rest) > NEW:
            found.append((text, rest))
    return found


def _tried(dimension: int) -> list[tuple[int, str]]:
    """Numbers of the similarities, and what they are called, the plainest first."""
    shifts = [(k, f"the position along {AXES[k]}") for k in range(dimension)]
    if dimension == 2:
        return [*shifts, (2, "the orientation"), (3, "the scale")]
    turns = [(3 + k, f"the rotation about {AXES[k]}") for k in (2, 0, 1)]
    return [*shifts, *turns, (6, "the scale")]


def _apart(moved: FloatArray, found: Named) -> FloatArray:
    """What is left of motions (n d) or (n d, k) beside those that were found."""
    if not found:
        return moved
    basis = np.linalg.qr(np.column_stack([one for _, one in found]))[0]
    return np.asarray(moved - basis @ (basis.T @ moved))


def _others(moved: FloatArray, text: str, found: Named) -> Named:
    """What else is in the span of motions (n d, k), under one name."""
    basis, sizes, _ = np.linalg.svd(moved, full_matrices=False)
    rest = _apart(basis[:, sizes > ALIKE * sizes.max(initial=0.0)], found)
    basis, sizes, _ = np.linalg.svd(rest, full_matrices=False)
    return [(text, one) for one in basis[:, sizes > NEW].T]
