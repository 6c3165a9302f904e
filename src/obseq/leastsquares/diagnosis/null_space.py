"""What the kernel of a normal matrix means: points that move, turn or change scale without any residual.

The kernel is split into connected parts; in each part, the movements of its points are compared with the
similarities of the plane or of space. What is a translation, a rotation or a change of scale is called so.
"""

from __future__ import annotations

from operator import attrgetter

import numpy as np

from obseq import graphs
from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.leastsquares.problem.numbering import FreeUnknowns
from obseq.leastsquares.problem.unknowns import UnknownTable
from obseq.leastsquares.solvers import SymmetricPattern

TAKES_PART = 1e-3
"""Share of the largest entry of the kernel from which an unknown is said to take part in it."""

SAME = 1e-5
"""Sine of the angle below which a movement of the kernel is a similarity."""

SHOWN = 6
"""Points named in an explanation."""

AXES = "xyz"


@dataclass(frozen=True)
class Part:
    """A connected part of the unknowns that the kernel moves.

    Attributes:
        blocks: Its blocks (ids).
        points: Those of them that are points, all of one dimension.
        movements: (n_points, dimension, k) an orthonormal basis of what the kernel does to the points.
    """

    blocks: IntArray
    points: IntArray
    movements: FloatArray


def free_movements(
    table: UnknownTable, free: FreeUnknowns, pattern: SymmetricPattern, kernel: FloatArray
) -> dict[str, IntArray]:
    """One sentence for each connected part of the kernel (n_free, k) that moves points as a rigid whole.

    With the points (ids) of each.
    """
    if not kernel.size:
        return {}
    found = {_sentence(table, part): part.points for part in parts(table, free, pattern, kernel)}
    return {sentence: points for sentence, points in found.items() if sentence}


def parts(
    table: UnknownTable, free: FreeUnknowns, pattern: SymmetricPattern, kernel: FloatArray
) -> list[Part]:
    """The connected parts of the unknowns that the kernel (n_free, k) moves."""
    block_of = np.repeat(np.arange(len(table)), table.size)[free.scalars]
    size = np.abs(kernel).max(axis=1)
    moving = size > TAKES_PART * size.max()
    rows, columns = pattern.indices, pattern.columns()
    joined = moving[rows] & moving[columns]
    edges = (block_of[rows[joined]], block_of[columns[joined]])
    labels = graphs.parts(len(table), *edges)
    blocks = np.unique(block_of[moving])
    return [
        _part(table, free, kernel, blocks[labels[blocks] == label]) for label in np.unique(labels[blocks])
    ]


def _part(table: UnknownTable, free: FreeUnknowns, kernel: FloatArray, blocks: IntArray) -> Part:
    places = blocks[table.each(attrgetter("is_point"), blocks)]
    if not places.size:
        return Part(blocks, places, np.zeros((0, 3, 0)))
    dimension = int(table.size[places].max())
    points = places[table.size[places] == dimension]
    numbers = free.number[table.start[points][:, None] + np.arange(dimension)]
    moved = np.where(numbers[..., None] >= 0, kernel[np.maximum(numbers, 0)], 0.0)
    basis = _range_of(moved.reshape(-1, kernel.shape[1]))
    return Part(blocks, points, basis.reshape(len(points), dimension, -1))


def _range_of(matrix: FloatArray) -> FloatArray:
    """Orthonormal basis of the columns of a matrix, those of rounding left out."""
    u, values, _ = np.linalg.svd(matrix, full_matrices=False)
    return np.asarray(u[:, values > SAME * max(float(values.max(initial=0.0)), TAKES_PART)])


def _sentence(table: UnknownTable, part: Part) -> str:
    """What the kernel does to the points of a part; empty when it is no similarity."""
    n, dimension, k = part.movements.shape
    if not n or not k:
        return ""
    coordinates = table.values[table.start[part.points][:, None] + np.arange(dimension)]
    centre = coordinates.mean(axis=0)
    alike = similarities(coordinates - centre)
    common = common_similarities(alike, part.movements.reshape(n * dimension, k))
    phrases = _phrases(common, dimension)
    if not phrases:
        return ""
    other = k - common.shape[1]
    if other:
        phrases.append(f"{other} change{'s' if other > 1 else ''} of shape")
    return f"{' and '.join(phrases)} of {_named(table, part.points)}"


def similarities(coordinates: FloatArray) -> FloatArray:
    """(n * d, q) translations, then rotations, then the scale, each of unit size, about the centre."""
    n, dimension = coordinates.shape
    columns = [np.tile(axis, (n, 1)) for axis in np.eye(dimension)]
    if dimension == 3:
        columns += [np.cross(axis, coordinates) for axis in np.eye(3)]
    else:
        columns.append(np.column_stack([-coordinates[:, 1], coordinates[:, 0]]))
    columns.append(coordinates)
    flat = np.stack([column.ravel() for column in columns], axis=1)
    lengths = np.linalg.norm(flat, axis=0)
    return np.asarray(flat / np.where(lengths > 0.0, lengths, 1.0))


def common_similarities(alike: FloatArray, movements: FloatArray, same: float = SAME) -> FloatArray:
    """(q, m) the similarities, by their coefficients, that are movements of the kernel too.

    Args:
        alike: (n * d, q) similarities of unit size.
        movements: (n * d, k) an orthonormal basis of what the kernel does.
        same: Sine of the angle below which a movement is a similarity.
    """
    u, values, v = np.linalg.svd(alike, full_matrices=False)
    kept = values > SAME * values.max()
    _, cosines, turned = np.linalg.svd(movements.T @ u[:, kept])
    same_ones = turned[: len(cosines)][cosines > np.sqrt(1.0 - same**2)]
    return np.asarray((v[kept].T / values[kept]) @ same_ones.T)


def _phrases(common: FloatArray, dimension: int) -> list[str]:
    """Translations, rotations and scale that the columns of coefficients hold, one phrase each."""
    n_turns = 3 if dimension == 3 else 1
    turning = common[dimension:]
    u, values, v = np.linalg.svd(turning) if common.size else (None, np.zeros(0), np.zeros((0, 0)))
    rank = int(np.sum(values > SAME))
    phrases = []
    still = common[:dimension] @ v[rank:].T if common.size else np.zeros((dimension, 0))
    if still.shape[1]:
        phrases.append(f"the position along {_directions(still, dimension)}")
    if rank and u is not None:
        turns, scales = _turns_and_scale(u[:, :rank], n_turns)
        if turns.shape[1]:
            phrases.append(_turn_phrase(turns, dimension))
        if scales:
            phrases.append("the scale")
    return phrases


def _turns_and_scale(space: FloatArray, n_turns: int) -> tuple[FloatArray, bool]:
    """(rotation axes, whether the scale is free too) of a space of (rotations, scale)."""
    _, values, v = np.linalg.svd(space[n_turns:])
    has_scale = bool(values.max(initial=0.0) > SAME)
    return np.asarray(space[:n_turns] @ v[int(has_scale) :].T), has_scale


def _turn_phrase(turns: FloatArray, dimension: int) -> str:
    if dimension == 2:
        return "the orientation"
    return f"the rotation about {_directions(turns, 3)}"


def _directions(space: FloatArray, dimension: int) -> str:
    """Names of the axes that span a space (d, k), or its vectors when they are no axes."""
    basis = np.linalg.svd(space, full_matrices=False)[0]
    if basis.shape[1] == dimension:
        return ", ".join(AXES[:dimension])
    inside = np.linalg.norm(basis, axis=1)
    axes = [AXES[k] for k in range(dimension) if inside[k] > np.sqrt(1.0 - SAME**2)]
    if len(axes) == basis.shape[1]:
        return ", ".join(axes)
    vectors = (vector * np.sign(vector[np.argmax(np.abs(vector))]) for vector in basis.T)
    return ", ".join("(" + ", ".join(f"{value:.3g}" for value in vector + 0.0) + ")" for vector in vectors)


def _named(table: UnknownTable, points: IntArray) -> str:
    names = ", ".join(table.names[point] for point in points[:SHOWN])
    if len(points) <= SHOWN:
        return names
    return f"{len(points)} points ({names}, ...)"
