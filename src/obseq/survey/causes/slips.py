"""WHAT: the slips that may be behind an error that was found, and how well they fit.

A slip says nothing of where the error is. It is told where it turns what should have been written into what
was written, and where a fit by accident is improbable.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.diagnosis.policy import POLICY
from obseq.diagnosis.protocol import Change, Slip
from obseq.report.tables.units import Units
from obseq.survey.causes.catalogue import KNOWN, KNOWN_PLAN, ROW, Named
from obseq.survey.causes.constants import CONSTANT, LEVEL_SCALE, SCALE
from obseq.survey.causes.effects import Effects
from obseq.survey.causes.other_points import (
    other_backsights,
    other_standpoint,
    other_target,
    readings_to,
)
from obseq.survey.causes.set_ups import CIRCLE, INSTRUMENT_HEIGHT, STANDPOINT, TARGET, TARGET_HEIGHT
from obseq.survey.causes.values import COORDINATE, difference, explain
from obseq.survey.causes.vector_slips import UNITS, slips_of_vector
from obseq.survey.causes.vectors import WHOLE_VECTOR
from obseq.survey.equations.point_system import PointSystem
from obseq.survey.kinds.registry import BY_CODE

PRISMS = (0.0344, 0.0300, 0.0350, 0.0175, 0.0169, 0.0231, 0.0400, 0.0111, 0.0086)
"""Constants (m) by which prisms of makers differ from each other and from none."""
_ROUNDED = 1e-3
"""Of a factor between units: what rounded values leave of it."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """The network as it is without the errors that were found.

    Attributes:
        effects: Its sights.
        computed: (n,) what observations should have been; NaN where it is not known.
        units: In which values were written.
        system: Of the coordinates of points.
    """

    effects: Effects
    computed: FloatArray
    units: Units
    system: PointSystem


def slips_of(named: Named, change: Change, evidence: Evidence) -> tuple[Slip, ...]:
    """The slips behind one error, the likeliest first."""
    found = FINDERS.get(named.code)
    return tuple(sorted(found(named, change, evidence), key=lambda one: one.misfit)) if found else ()


def _of_row(named: Named, change: Change, evidence: Evidence) -> Iterator[Slip]:
    row, notes = int(named.rows[0]), evidence.effects.notes
    rows = notes.book.observations
    kind, value, expected = (
        BY_CODE[int(rows.types[row])],
        float(rows.values[row]),
        float(evidence.computed[row]),
    )
    tolerance = POLICY.near * float(change.sigma[0])
    if not math.isfinite(expected) or abs(difference(kind, value, expected)) <= 2.0 * tolerance:
        return
    if told := explain(kind, value, expected, tolerance, evidence.units):
        yield Slip(told.code, told.text, told.chance, is_strong=told.chance < POLICY.likely)
    if notes.is_slope[row]:
        flat = _flat(evidence.effects, row)
        if abs(value - flat) <= tolerance and 2.0 * tolerance / abs(value) < POLICY.likely:
            yield Slip("W108", "the horizontal distance in place of the slope distance", 0.0, is_strong=True)
    yield from _of_another_reading(named, tolerance, evidence)


def _flat(effects: Effects, row: int) -> float:
    vector, up = effects.vectors[row], effects.up[row]
    return float(np.linalg.norm(vector - (vector @ up) * up))


def _of_another_reading(named: Named, tolerance: float, evidence: Evidence) -> Iterator[Slip]:
    """A reading to another target, or two readings exchanged."""
    row, effects = int(named.rows[0]), evidence.effects
    rows, names = effects.notes.book.observations, effects.notes.book.point_names
    kind, value = BY_CODE[int(rows.types[row])], float(rows.values[row])
    alike = (rows.types == rows.types[row]) & (rows.from_points == rows.from_points[row])
    alike &= (rows.stations == rows.stations[row]) & rows.active
    for other in np.flatnonzero(alike).tolist():
        mine = abs(difference(kind, value, evidence.computed[other])) <= tolerance
        its = abs(difference(kind, float(rows.values[other]), evidence.computed[row])) <= tolerance
        if other != row and mine and its:
            yield Slip("W113", f"exchanged with {effects.notes.book.label(other)}", 0.0, is_strong=True)
            return
    span = 2.0 * math.pi if kind.is_angle else 2.0 * abs(value)
    for read, told in (
        (readings_to(effects, evidence.computed, row), "read to"),
        (other_backsights(effects, evidence.computed, row), "counted from"),
    ):
        off = np.array([abs(difference(kind, value, one)) for one in read.tolist()])
        fits = np.flatnonzero(off <= tolerance)
        chance = np.count_nonzero(np.isfinite(read)) * 2.0 * tolerance / max(span, tolerance)
        if fits.size and chance < POLICY.likely:
            best = int(fits[np.argmin(off[fits])])
            yield Slip("W112", f"{told} {names[best]}", float(chance), is_strong=False)


def _of_target(named: Named, change: Change, evidence: Evidence) -> Iterator[Slip]:
    if (other := other_target(evidence.effects, evidence.computed, named.rows, change.sigma)) is not None:
        name = evidence.effects.notes.book.point_names[other]
        yield Slip("W118", f"it is {name} that was sighted", 0.0, is_strong=True)


def _of_standpoint(named: Named, change: Change, evidence: Evidence) -> Iterator[Slip]:
    if (other := other_standpoint(evidence.effects, named.rows, change.sigma)) is not None:
        name = evidence.effects.notes.book.point_names[other]
        yield Slip("W119", f"the instrument stood on {name}", 0.0, is_strong=True)


def _of_vector(named: Named, change: Change, evidence: Evidence) -> Iterator[Slip]:
    tolerance = POLICY.near * float(np.max(change.sigma)) + POLICY.noted
    return slips_of_vector(evidence.effects, named.rows, change.size, tolerance)


def _of_circle(_named: Named, change: Change, _evidence: Evidence) -> Iterator[Slip]:
    turned = abs(math.remainder(float(change.size[0]), 2.0 * math.pi))
    if abs(turned - math.pi) <= POLICY.near * change.sigma[0]:
        yield Slip("W117", "the other face was read from there on", 0.0, is_strong=True)


def _of_height(named: Named, change: Change, evidence: Evidence) -> Iterator[Slip]:
    rows = evidence.effects.notes.book.observations
    is_instrument = named.code == INSTRUMENT_HEIGHT.code
    heights = rows.from_heights if is_instrument else rows.to_heights
    written, size = float(np.median(heights[named.rows])), float(change.size[0])
    tolerance, right = POLICY.near * float(change.sigma[0]) + POLICY.noted, written - size
    if abs(size) <= 2.0 * tolerance:
        return
    others = np.unique(np.concatenate([rows.from_heights, rows.to_heights]))
    used = others[others > 0.0]
    if written == 0.0:
        if used.size and 0.5 * used[0] <= right <= 2.0 * used[-1]:  # as those that were noted
            yield Slip("W114", f"a height of {right:.3f} m was left out", 0.0, is_strong=True)
    elif abs(right + written) <= tolerance:
        yield Slip("W115", "the sign of the height is wrong", 0.0, is_strong=True)
    elif right == 0.0 or abs(right) <= tolerance:
        yield Slip("W115", "the height does not belong there", 0.0, is_strong=True)
    else:
        near = others[(np.abs(others - right) <= tolerance) & (others != written)]
        if (
            near.size
            and len(others) * 2.0 * tolerance / max(float(np.ptp(others)), tolerance) < POLICY.likely
        ):
            yield Slip("W116", f"{near[0]:.3f} m, the height of another line, fits", 0.0, is_strong=False)


def _of_constant(_named: Named, change: Change, _evidence: Evidence) -> Iterator[Slip]:
    size, tolerance = abs(float(change.size[0])), POLICY.near * float(change.sigma[0])
    near = min(PRISMS, key=lambda one: abs(one - size))
    if abs(near - size) <= tolerance and len(PRISMS) * 2.0 * tolerance / max(PRISMS) < POLICY.chance:
        yield Slip("W120", f"prisms differ by {1e3 * near:.1f} mm", 0.0, is_strong=False)


def _of_scale(_named: Named, change: Change, _evidence: Evidence) -> Iterator[Slip]:
    right, tolerance = 1.0 - float(change.size[0]), POLICY.near * float(change.sigma[0])
    for code, text, factor in UNITS:
        if abs(right - factor) <= max(tolerance, _ROUNDED * factor):
            yield Slip(code, text, abs(right - factor), is_strong=True)


def _of_known(named: Named, change: Change, evidence: Evidence) -> Iterator[Slip]:
    point, component = named.known[0]
    points, names = evidence.effects.notes.points, evidence.effects.notes.points.names
    given, fitting = (
        evidence.system.coordinates(xyz[[point]], [names[point]])[0]
        for xyz in (points.coordinates, evidence.effects.coordinates)
    )
    tolerance = POLICY.near * float(change.sigma[0])
    value, expected = float(given[component]), float(fitting[component])
    if abs(value - expected) > 2.0 * tolerance and (
        told := explain(COORDINATE, value, expected, tolerance, evidence.units)
    ):
        yield Slip(told.code, told.text, told.chance, is_strong=told.chance < POLICY.likely)


def _of_plan(named: Named, change: Change, evidence: Evidence) -> Iterator[Slip]:
    points, place = evidence.effects.notes.points, evidence.effects.coordinates
    point = named.known[0][0]
    tolerance = POLICY.near * float(np.max(change.sigma)) + POLICY.noted
    given, fitting = points.coordinates[point, :2], place[point, :2]
    if np.abs(given[::-1] - fitting).max() <= tolerance < np.abs(given - fitting).max():
        yield Slip("W123", "easting and northing are exchanged", 0.0, is_strong=True)
        return
    gaps = np.linalg.norm(place[:, :2] - given, axis=1)
    gaps[point] = np.inf
    other = int(np.nanargmin(gaps))
    if gaps[other] <= tolerance:
        yield Slip("W133", f"these are the coordinates of {points.names[other]}", 0.0, is_strong=True)


FINDERS = {
    ROW: _of_row,
    KNOWN: _of_known,
    KNOWN_PLAN: _of_plan,
    TARGET.code: _of_target,
    STANDPOINT.code: _of_standpoint,
    WHOLE_VECTOR.code: _of_vector,
    CIRCLE.code: _of_circle,
    INSTRUMENT_HEIGHT.code: _of_height,
    TARGET_HEIGHT.code: _of_height,
    CONSTANT.code: _of_constant,
    SCALE.code: _of_scale,
    LEVEL_SCALE.code: _of_scale,
}
"""What finds the slips of a hypothesis, by its code."""
