"""What an adjustment took for granted, with numbers: how far a plane serves, what refraction did."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.leastsquares.assembly.evaluation import jacobian_rows
from obseq.printable import listed
from obseq.records.adjustment import MotionRecord
from obseq.survey.equations.equations import Equations
from obseq.survey.equations.frame import MEAN_RADIUS, Frame
from obseq.survey.equations.point_system import PointSystem
from obseq.survey.kinds.registry import among, codes_where
from obseq.survey.model import FieldBook, Points

MILLIGON = np.pi / 200_000.0
LEAST_NEGLECTED = 1e-6
"""Metres that a plane neglects, of which less is not told."""
SHOWN = 4
"""Points named in a sentence."""


def notes(frame: Frame, book: FieldBook, coordinates: FloatArray, invented: BoolArray) -> tuple[str, ...]:
    """One sentence for each, of a network with its adjusted coordinates in the frame; both (n, 3).

    What is invented is not told.
    """
    found = [*_refraction(frame, book, coordinates)]
    if frame.is_plane:
        found += _plane(np.where(invented, np.nan, coordinates)[_observed(book)])
    return tuple(found)


def of_unit_weight(unit_sigma: float | None, sigma0: float | None) -> tuple[str, ...]:
    """What a program calls m0 that has a standard deviation of unit weight other than 1."""
    if unit_sigma is None or sigma0 is None:
        return ()
    return (f"m0 of gama-local, sigma-apr ({unit_sigma:g}) times sigma0: {unit_sigma * sigma0:.8g}",)


def datum_note(defect: int, motions: Sequence[MotionRecord], count: int) -> tuple[str, ...]:
    """What a free network lacks, and what takes its place; nothing where the defect of rank is 0.

    Args:
        defect: How many parameters the observations leave free.
        motions: Those that move points.
        count: How many points the network has.
    """
    if not defect:
        return ()
    together: dict[tuple[str, ...], list[str]] = {}
    for motion in motions:
        together.setdefault(motion.points, []).append(motion.text)
    phrases = [f"{', '.join(texts)} of {_listed(points, count)}" for points, texts in together.items()]
    if defect > len(motions):
        phrases.append(f"{defect - len(motions)} of the orientations of stations and other unknowns")
    return (
        f"free network, rank defect {defect}: the observations leave undetermined {'; '.join(phrases)}. The "
        "points that carry the datum take this with the least changes (inner constraints), and precisions "
        "and ellipses are relative to that datum",
    )


def _listed(names: Sequence[str], count: int) -> str:
    if len(names) <= SHOWN:
        return ", ".join(names)
    return "all points" if len(names) == count else f"{len(names)} points ({', '.join(names[:2])}, ...)"


def _refraction(frame: Frame, book: FieldBook, coordinates: FloatArray) -> Iterator[str]:
    observations = book.observations
    refracted = codes_where(lambda kind: kind.is_refracted)
    rows = np.flatnonzero(among(observations.types, refracted) & observations.active)
    if not rows.size:
        return
    corrections = frame.refraction(book, rows, coordinates)
    if not corrections.any():
        neither = ", neither for refraction nor for the curvature of the Earth" if frame.is_plane else ""
        start = f"refraction coefficient {frame.refraction_coefficient:g}: zenith angles are not corrected"
        yield start + neither
        return
    largest = int(np.abs(corrections).argmax())
    row = rows[largest]
    sight = coordinates[observations.to_points[row]] - coordinates[observations.from_points[row]]
    length = float(np.linalg.norm(sight))
    what = "for refraction and the curvature of the Earth" if frame.is_plane else "for refraction"
    yield (
        f"refraction coefficient {frame.refraction_coefficient:g}: zenith angles are corrected {what} by up "
        "to "
        f"{abs(corrections[largest]) / MILLIGON:.2g} mgon, {abs(corrections[largest]) * length * 1e3:.2g} "
        "mm of "
        f"height at {length:.0f} m ({book.label(int(row))})"
    )


def _observed(book: FieldBook) -> IntArray:
    """Rows of the points that active observations name."""
    found = book.observations
    both = np.concatenate([found.from_points[found.active], found.to_points[found.active]])
    return np.bincount(both).nonzero()[0]


def _plane(coordinates: FloatArray) -> Iterator[str]:
    """What a plane leaves out of distances: the convergence of verticals, and arcs taken as straight."""
    none = np.full((1, 3), np.nan)
    ends = [end.reduce(np.concatenate([none, coordinates])) for end in (np.fmax, np.fmin)]
    extent = np.nan_to_num(ends[0] - ends[1]).round(4)
    across, rise = float(np.hypot(*extent[:2])), float(extent[2])
    neglected = across * rise / (2.0 * MEAN_RADIUS) + across**3 / (6.0 * MEAN_RADIUS**2)
    if neglected < LEAST_NEGLECTED:
        return
    yield (
        f"plane frame with parallel verticals: over this network, {across:.4g} m across and {rise:.3g} m of "
        f"height, it neglects up to {neglected * 1e3:.2g} mm in plan; where that matters, give the system "
        "of the "
        "points (--points-crs)"
    )


HIGHER = 100.0
"""What heights are thought to be wrong by (m)."""
LEAST_MOVE = 1e-5
"""Movement (m) of which less is not told."""
MOST_NAMED = 10


def held_heights_note(equations: Equations, system: PointSystem, points: Points) -> tuple[str, ...]:
    """One sentence that counts and names the points without height; none where there are none."""
    rows = np.flatnonzero(points.is_free[:, 2] & points.is_invented[:, 2])
    if not rows.size:
        return ()
    names = listed([points.names[row] for row in rows.tolist()], MOST_NAMED)
    what = "1 point has" if rows.size == 1 else f"{rows.size} points have"
    move = float(np.hypot(*_leanings(equations, system, rows).T).max()) * HIGHER
    moves = f"by up to {move * 1e3:.2g} mm" if move > LEAST_MOVE else "by nothing that counts"
    return (
        f"{what} no height, which nothing observes: {names}. Their plan is adjusted, at heights of the site; "
        f"{HIGHER:g} m more would move it {moves}",
    )


def _leanings(equations: Equations, system: PointSystem, rows: IntArray) -> FloatArray:
    """(k, 2) what a metre of height moves points in the plan of their system, the others staying."""
    axes = system.axes(equations.system.values(equations.points[rows]))[0]
    normal = axes @ _normal_blocks(equations, rows) @ axes.transpose(0, 2, 1)
    inverse = np.linalg.pinv(normal[:, :2, :2], hermitian=True)
    return np.asarray(-np.einsum("kij,kj->ki", inverse, normal[:, :2, 2]))


def _normal_blocks(equations: Equations, rows: IntArray) -> FloatArray:
    """(k, 3, 3) blocks of points on the diagonal of the normal matrix, with what is held in them."""
    equations_of_all = equations.system.equations()
    table = equations_of_all.table
    place = np.full(len(table.values) + 1, -1)
    place[table.start[equations.points[rows]][:, None] + np.arange(3)] = np.arange(3 * len(rows)).reshape(
        -1, 3
    )
    found = np.zeros((len(rows), 3, 3))
    for batch in equations_of_all.batches:
        at = place[batch.scalars()]
        derivatives = jacobian_rows(table, batch)[1:] * batch.weights[0, : batch.n]
        for one, first in zip(at, derivatives, strict=True):
            for other, second in zip(at, derivatives, strict=True):
                both = (one >= 0) & (one // 3 == other // 3)
                np.add.at(found, (one[both] // 3, one[both] % 3, other[both] % 3), (first * second)[both])
    return found
