"""Where points start that only equations of one's own place: from several starts, the one that fits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from obseq.arrays import FloatArray
from obseq.errors import InputError, ObseqError
from obseq.joint.named import KNOWN_AS, NamedEquation, add_named
from obseq.leastsquares import LeastSquares

STARTS = 24
"""Directions from the middle of its neighbours in which a point is looked for."""

SAME = 1e-6
"""Places within this share of the size of the surroundings are one."""

FITS = 3.0
"""Root mean square, in sigmas, up to which a place fits its equations as well as another."""


def place_points(
    system: LeastSquares, names: Sequence[str], equations: Sequence[NamedEquation], also: Mapping[str, str]
) -> None:
    """Gives points of a system a place where their equations with placed points determine one.

    Raises:
        InputError: Nothing gives a point its place, or two places fit alike.
    """
    waiting = list(names)
    while waiting:
        for name in waiting:
            places = _places(system, name, set(waiting), equations, also)
            if len(places) == 1:
                system.set_values(system.ids([name]), places)
                waiting.remove(name)
                break
        else:
            raise InputError(_unplaced(waiting, places))


def _unplaced(waiting: Sequence[str], places: FloatArray) -> str:
    """Why the last of the points that wait has no place."""
    shown = " or ".join(f"({x:.3f} {y:.3f} {z:.3f})" for x, y, z in places[:2])
    reason = f"its equations fit at {shown}" if shown else "nothing gives it a place"
    return (
        f"point {waiting[-1]}: {reason} ({len(waiting)} points have none); give approximate coordinates "
        "(add_points)"
    )


def _places(
    system: LeastSquares,
    name: str,
    waiting: set[str],
    equations: Sequence[NamedEquation],
    also: Mapping[str, str],
) -> FloatArray:
    """(n, 3) where a point may be by what joins it to placed ones alone; none where that is too little."""
    chosen = []
    for equation in equations:
        rows = [row for row in range(len(equation)) if _names(equation, row) & waiting == {name}]
        if rows:
            chosen.append(equation.rows(rows))
    others = {other for equation in chosen for row in range(len(equation)) for other in _names(equation, row)}
    known = system.unknowns.called("Point3")
    ids = [known[other] for other in others - {name} if other in known]
    if not ids:
        return np.zeros((0, 3))
    around = system.values(np.array(ids))
    found = [_fitted(system, name, start, chosen, also) for start in _starts(around)]
    fits = sorted((fit for fit in found if fit is not None), key=lambda fit: fit[0])
    places: list[FloatArray] = []
    for cost, place in fits:
        size = float(np.abs(around - place).max()) + 1.0
        is_new = all(np.abs(place - other).max() > SAME * size for other in places)
        if is_new and cost < max(FITS, 2 * fits[0][0]):
            places.append(place)
    return np.array(places).reshape(-1, 3)


def _names(equation: NamedEquation, row: int) -> set[str]:
    return {names[row] for names in equation.parts.values()}


def _starts(around: FloatArray) -> FloatArray:
    """(n, 3) places about points, at distances like those between them."""
    middle = around.mean(axis=0)
    spread = max(float(np.linalg.norm(around - middle, axis=1).max()), 1.0)
    turns = np.random.default_rng(0).normal(size=(STARTS, 3))
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    return np.concatenate([middle[None], middle + spread * turns])


def _fitted(
    system: LeastSquares,
    name: str,
    start: FloatArray,
    equations: Sequence[NamedEquation],
    also: Mapping[str, str],
) -> tuple[float, FloatArray] | None:
    """The root mean square of the residuals, in sigmas, and the place, from a start; None without one."""
    trial = LeastSquares()
    used = {(kind, other) for equation in equations for kind, other in equation.named}
    for kind, other in sorted(used):
        _copy(system, trial, kind, other, also)
    (own,) = trial.ids([name])
    trial.freeze(np.array([block for block in range(len(trial.unknowns)) if block != own]))
    trial.set_values([own], start[None])
    for equation in equations:
        add_named(trial, equation, also)
    try:
        done = trial.solve(100, strategy="levenberg-marquardt", covariance=[own])
    except ObseqError:
        return None
    if not done.converged or done.weak is not None:
        return None
    total = sum(done.squares.values())
    return float(np.sqrt(total / done.n_observations)), done.values([own])[0]


def _copy(system: LeastSquares, trial: LeastSquares, kind: str, name: str, also: Mapping[str, str]) -> None:
    """The block that a name stands for, in another system."""
    for label, pattern in KNOWN_AS.get(kind, ((kind, "{}"),)):
        for called in (pattern.format(name), *([also[name]] if kind == "Vector" and name in also else [])):
            known = system.unknowns.called(label)
            if called in known and called not in trial.unknowns.called(label):
                values = system.values([known[called]])
                adders: Mapping[str, Callable[[list[str], FloatArray], object]] = {
                    "Point3": trial.add_points,
                    "Point2": trial.add_points,
                    "Rotation": trial.add_rotations,
                    "PlumbRotation": trial.add_rotations,
                    "Direction": trial.add_directions,
                    "Vector": trial.add_vectors,
                    "Scalar": lambda names, given: trial.add_scalars(names, given[:, 0]),
                }
                adders[label]([called], values[:, :, :3] if label == "PlumbRotation" else values)
                return
