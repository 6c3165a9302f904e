"""All distances together: a wrong constant of the prism, a wrong scale, a map taken for a plane."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq import crs
from obseq.errors import InputError
from obseq.survey.adjustment.instrument_unknowns import estimating
from obseq.survey.kinds.registry import BY_CODE, codes_where, codes_with
from obseq.survey.screening.findings import Cause, GrossError
from obseq.survey.screening.robust import GROSS

if TYPE_CHECKING:
    from obseq.report.units import Units
    from obseq.survey.adjustment.point_system import PointSystem
    from obseq.survey.initial.left_out import Determined
    from obseq.survey.model import FieldBook, Points
    from obseq.survey.screening.robust import Estimate
    from obseq.survey.screening.trials import Trials

    Rows = np.ndarray[tuple[int], np.dtype[np.intp]]

_HORIZONTAL = "horizontal"
_TWO = 2
"""Known points of which one that is wrong does to all distances what a scale does."""
LEAST = 4
"""Distances from which an unknown of all of them says something."""
LARGEST_CONSTANT, LARGEST_SCALE = 2.0, 0.5
"""Constant (m) and scale beyond which they are none: of prisms these are centimetres, of a torn tape a metre;
feet, and what else differs more from a metre, are tried as such."""
_SAME, _AS_GOOD = 0.3, 25.0
"""Contradictions, and squares of ratios, by which explanations that are as good may differ."""
_MAP_SCALE = 3e-3
"""Scales of maps, and reductions to height 0, differ from 1 by less than this."""


def distances_cause(trials: Trials, system: PointSystem) -> tuple[GrossError, Estimate] | None:
    """What all distances have in common, with the network in which it is estimated; None for nothing."""
    mine = distances_of(trials.found.book)
    if len(mine) < LEAST or not (trials.found.ratios[mine] > GROSS).any():
        return None
    explaining: list[tuple[str, Rows, Estimate]] = []
    for what in (_HORIZONTAL, "constant", "scale"):
        rows = _slopes_of(trials.found.book, mine) if what == _HORIZONTAL else mine
        book = changed(trials.found.book, rows, what) if len(rows) else None
        if book is None:
            continue
        corrected = trials.explaining(trials.found.points, book, _start(trials.found, rows, what))
        if corrected is not None and may_be(what, values_of(corrected, what)):
            explaining.append((what, rows, corrected))
    equal = _equal(explaining)
    if not equal:
        return None
    told = [_told(trials.found, *one, system) for one in equal]
    text = "; or ".join(error.text for error in told)
    text = f"{text}; nothing tells these apart" if len(told) > 1 else text
    return replace(told[0], text=text), equal[0][2]


def _equal(explaining: list[tuple[str, Rows, Estimate]]) -> list[tuple[str, Rows, Estimate]]:
    """What explains the distances best; what estimates nothing alone, where it is as good."""
    if not explaining:
        return []
    left = [one.disagreement(GROSS) for *_, one in explaining]
    likely = [one for one, each in zip(explaining, left, strict=True) if each <= min(left) + _SAME]
    if likely[0][0] == _HORIZONTAL:
        return likely[:1]
    squares = [float(np.nansum((one.ratios / one.scale) ** 2)) for *_, one in likely]
    return [one for one, each in zip(likely, squares, strict=True) if each <= min(squares) + _AS_GOOD]


def _told(found: Estimate, what: str, rows: Rows, corrected: Estimate, system: PointSystem) -> GrossError:
    size, values = float(found.ratios[rows].max()), values_of(corrected, what)
    told = described(found.book, rows, what, values, size, system, found.units)
    return or_known_points(told, what, found.points)


def or_known_points(told: GrossError, what: str, points: Points) -> GrossError:
    """A scale, with the two known points where there are no more: one that is wrong explains as much."""
    known = np.flatnonzero(~points.is_free[:, :2].any(axis=1)).tolist()
    if what != "scale" or len(known) != _TWO:
        return told
    names = " or ".join(f"{points.names[row]} ({points.place(row)})" for row in known)
    return replace(told, text=f"{told.text}; or, which nothing tells apart, the coordinates of {names}")


def values_of(corrected: Estimate, what: str) -> list[float]:
    """The constants (m) or scales (parts) of a network in which they are unknown."""
    return [value for part, value in corrected.instruments if part == what]


def may_be(what: str, values: list[float]) -> bool:
    """Whether constants (m) or scales (parts) are such as instruments have."""
    most = {"constant": LARGEST_CONSTANT, "scale": LARGEST_SCALE}.get(what, np.inf)
    return all(abs(value) <= most for value in values)


def distances_of(book: FieldBook) -> Rows:
    """The distances that can have a constant and a scale of their instrument."""
    rows = book.observations
    return np.flatnonzero(np.isin(rows.types, list(codes_with("constant"))) & rows.active)


def _slopes_of(book: FieldBook, rows: Rows) -> Rows:
    """Those of some distances that are slope distances."""
    slopes = codes_where(lambda kind: kind.horizontal is not None)
    return rows[np.isin(book.observations.types[rows], slopes)]


def _start(found: Estimate, rows: Rows, what: str) -> Determined | None:
    """Where distances with an unknown start, which changes no initial values; None for horizontal ones."""
    book = None if what == _HORIZONTAL else changed(found.start.book, rows, what)
    return None if book is None else replace(found.start, book=book)


def described(
    book: FieldBook,
    rows: Rows,
    what: str,
    values: list[float],
    size: float,
    system: PointSystem,
    units: Units,
) -> GrossError:
    """What all distances have in common, in words.

    Args:
        book: the observations.
        rows: the distances.
        what: "horizontal", "constant" or "scale".
        values: the constants (m) or scales (parts) to add.
        size: misfit of the worst distance, in sigmas.
        system: the coordinates of the point files.
        units: in which lengths are told.
    """
    kinds = " and ".join(BY_CODE[code].name for code in np.unique(book.observations.types[rows]).tolist())
    name = f"all {len(rows)} {kinds} observations (the first: {book.label(int(rows[0]))})"
    cause, text = Cause.DISTANCES, _of_constant(values, units)
    if what == _HORIZONTAL:
        cause, text = Cause.HORIZONTAL, "they look like horizontal distances instead of slope distances"
    elif what == "scale":
        text = _of_scale(values, system)
    return GrossError(name, cause, text, size, tuple(rows.tolist()))


def changed(book: FieldBook, rows: Rows, what: str) -> FieldBook | None:
    """The observations, with distances that are horizontal, or have an unknown; None where that cannot be."""
    if what == _HORIZONTAL:
        types = book.observations.types.copy()
        horizontal = [BY_CODE[code].horizontal for code in types[rows].tolist()]
        types[rows] = [kind.code for kind in horizontal if kind is not None]
        return replace(book, observations=replace(book.observations, types=types))
    try:
        return estimating(book, [what])
    except InputError:
        return None


def _of_constant(values: list[float], units: Units) -> str:
    shown = ", ".join(map(units.length.text, values))
    return f"a constant added to all of them fits ({shown}): likely the constant of the prism"


def _of_scale(values: list[float], system: PointSystem) -> str:
    """What a common scale may come from."""
    shown = ", ".join(f"{1e6 * value:.1f} ppm" for value in values)
    text = f"one scale for all of them fits ({shown} to add): likely "
    is_local = system.system.kind is crs.Kind.LOCAL
    if max(map(abs, values), default=0.0) > _MAP_SCALE:
        wrong = f"another coordinate system of the points than {system.system.definition} (--points-crs), or "
        return f"{text}{'' if is_local else wrong}another unit of length"
    if is_local:
        return text + (
            "coordinates of a map, which are not of a plane in true size: give their system (--points-crs); "
            "or a correction in ppm that is wrong"
        )
    return text + (
        f"coordinates of a plane of the site, not in {system.system.definition}: leave --points-crs "
        "out; or a correction in ppm that is wrong, or distances that are reduced to the map already"
    )
