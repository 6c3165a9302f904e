"""The quality of an adjusted network, as arrays and as parts of its record."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.printable import listed
from obseq.records.adjustment import (
    EllipseRecord,
    RelativeRecord,
    ReliabilityRecord,
    SnoopingRecord,
    VarianceComponentRecord,
)
from obseq.records.columns import NO_CODE, Texts, texts_of
from obseq.records.rows import Rows
from obseq.survey.adjustment.joint_groups import TestedJointly, tested_jointly
from obseq.survey.adjustment.quality import Examination, numbers, of_observations
from obseq.survey.equations.known_coordinates import GROUP

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from obseq.arrays import BoolArray, FloatArray
    from obseq.leastsquares import LeastSquaresResult
    from obseq.leastsquares.statistics.effects import Effects
    from obseq.leastsquares.statistics.ellipses import ErrorEllipses
    from obseq.leastsquares.statistics.reliability import Reliability
    from obseq.records.columns import Column
    from obseq.survey.equations.equations import Equations
    from obseq.survey.model import FieldBook


@dataclass(frozen=True, eq=False)
class ReliabilityNumbers:
    """What judges single observations, all (n,), in m or rad; NaN where undefined.

    Attributes:
        redundancy: Redundancy numbers, from 0 (not controlled) to 1.
        standardised: Residuals over their own a priori standard deviations, Baarda's w.
        tau: The same over the a posteriori ones, Pope's tau.
        detectable: Minimal detectable biases; infinite where nothing controls the observation.
        external: Most that an undetected bias moves any coordinate, in its standard deviations.
        blunder: Estimates of the errors of the observed values, if each were the only one.
    """

    redundancy: FloatArray
    standardised: FloatArray
    tau: FloatArray
    detectable: FloatArray
    external: FloatArray
    blunder: FloatArray


NAMES = ("redundancy", "w", "tau", "detectable", "external", "left_out_residuals")


@dataclass(frozen=True, eq=False)
class AdjustedQuality:
    """What was found out of the quality of an adjusted network.

    Attributes:
        observations: Reliability of the observations; None when not asked for.
        known: Reliability of the known coordinates; None when not asked for.
        reliability: The levels behind them; None when not asked for.
        rejected: (n,) the observations that snooping left out.
        snooping: What it did; None when not asked for.
        components: Variance components by kind of observation; None when not asked for.
        relative: Precision of pairs of points that observations join; None when not asked for.
        ellipses: Probability that the true point is inside its ellipse; None: standard ellipses.
        a_priori: Whether precisions are those of the given sigmas.
        ellipsoids: Whether ellipsoids are wanted.
        effects: Columns of what the detectable biases do to coordinates; None when not asked for.
        joint: Tests of vectors and positions as one; none when reliability was not asked for.
        shares: (n,) what those that are correlated with others add to the weighted sum of squares; NaN for
            the others.
    """

    observations: ReliabilityNumbers | None
    known: ReliabilityNumbers | None
    reliability: ReliabilityRecord | None
    rejected: BoolArray
    components: tuple[VarianceComponentRecord, ...] | None
    relative: Rows[RelativeRecord] | None
    ellipses: float | None
    a_priori: bool
    ellipsoids: bool
    effects: dict[str, Column] | None
    joint: tuple[TestedJointly, ...] = ()
    shares: FloatArray | None = None
    snooping: SnoopingRecord | None = None


def adjusted_quality(equations: Equations, book: FieldBook, found: Examination) -> AdjustedQuality:
    """What was found out, without what it was found from."""
    n, whole = len(book.observations), found.reliability
    return AdjustedQuality(
        None if whole is None else _numbers([of_observations(equations, whole, name, n) for name in NAMES]),
        None if whole is None else _known(whole),
        None if whole is None else levels_of(whole),
        np.zeros(n, np.bool_),
        _components(found),
        _relative(found),
        found.wanted.ellipses,
        found.a_priori,
        found.wanted.ellipsoids,
        None if found.effects is None else _effects(equations, found.effects, n, book),
        () if whole is None else tested_jointly(equations, whole, n),
        equations.shares(found.solution),
    )


def ellipse_records(ellipses: ErrorEllipses) -> Iterator[EllipseRecord]:
    """The ellipses as they are written."""
    axes = (ellipses.semi_major.tolist(), ellipses.semi_minor.tolist(), ellipses.bearing.tolist())
    return map(EllipseRecord, *axes)


def ellipse_columns(ellipses: ErrorEllipses, there: BoolArray | None = None) -> dict[str, Column]:
    """The ellipses as columns of a list of records; none where `there` (n,) is False."""
    if there is None:
        return {f"ellipse.{name}": getattr(ellipses, name) for name in EllipseRecord.__struct_fields__}
    numbers = {
        f"ellipse.{name}": np.where(there, getattr(ellipses, name), np.nan)
        for name in EllipseRecord.__struct_fields__
    }
    return {**numbers, "ellipse.there": there}


def _numbers(columns: list[FloatArray]) -> ReliabilityNumbers:
    redundancy, w, tau, detectable, external, residuals = columns
    return ReliabilityNumbers(redundancy, w, tau, detectable, external, -residuals)


def _known(whole: Reliability) -> ReliabilityNumbers | None:
    """The numbers of the known coordinates: of those with a sigma, then of those with a covariance."""
    parts = [part for part in whole.observations if part.source.group == GROUP]
    if not parts:
        return None
    return _numbers([np.concatenate([numbers(part, name) for part in parts]) for name in NAMES])


def levels_of(whole: Reliability) -> ReliabilityRecord:
    """The levels behind tests, and how many there are."""
    tau = whole.tau_critical
    return ReliabilityRecord(
        level=whole.level,
        power=whole.power,
        non_centrality=whole.non_centrality,
        critical=whole.w_critical,
        tau_critical=tau if np.isfinite(tau) else None,
        uncontrolled=len(whole.uncontrolled()),
        tests=whole.n_tests,
    )


def _effects(
    equations: Equations, effects: Mapping[int, Effects], n: int, book: FieldBook
) -> dict[str, Column]:
    """What the detectable bias of each observation does, by row of the field book."""
    places, shifts = np.full(n, NO_CODE, np.int32), np.full((n, 3), np.nan)
    for rows, batch in equations.batches.values():
        moved = effects[id(batch)]
        there = np.isfinite(moved.shifts).all(axis=1)
        places[rows[there]], shifts[rows[there]] = moved.places[there], moved.shifts[there]
    columns = {f"effect.{axis}": shifts[:, k] for k, axis in enumerate("xyz")}
    return {"effect.point": Texts(places, list(book.point_names)), **columns, "effect.there": places >= 0}


def _components(found: Examination) -> tuple[VarianceComponentRecord, ...] | None:
    components = found.components
    if components is None:
        return None
    known = components.covariance is not None
    precisions = components.precisions.tolist() if known else [None] * len(components.names)
    columns = (components.names, components.factors.tolist(), precisions, components.redundancy.tolist())
    return tuple(
        VarianceComponentRecord(
            name, factor, float(np.sqrt(factor)), precision, redundancy, name not in components.negative
        )
        for name, factor, precision, redundancy in zip(*columns, strict=True)
    )


def _relative(found: Examination) -> Rows[RelativeRecord] | None:
    relative, ellipses = found.relative, found.relative_ellipses()
    if relative is None or ellipses is None:
        return None
    known = relative.bearing_precision < 2.0 * np.pi  # of points on one vertical it says nothing
    columns: dict[str, Column] = {
        "first": texts_of(relative.first),
        "second": texts_of(relative.second),
        "distance": relative.distance,
        "precision": relative.precision,
        "bearing_precision": np.where(known, relative.bearing_precision, np.nan),
        **ellipse_columns(ellipses),
    }
    return Rows.of(RelativeRecord, columns, len(relative.first))


MOST_NAMES = 8


def covariance_of(
    solution: LeastSquaresResult, known: Sequence[str], names: Sequence[str], a_priori: bool
) -> FloatArray:
    """(3 k, 3 k) covariance of points, m^2; of all of them when none is named.

    Args:
        solution: What holds the cofactors.
        known: Names of all points.
        names: Those that are asked for.
        a_priori: Whether the given sigmas are trusted.

    Raises:
        InputError: A point is not in the network.
    """
    wrong = [name for name in names if name not in known]
    if wrong:
        there = listed(known, MOST_NAMES)
        raise InputError(f"{wrong[0]} is no point of this adjustment; its points are {there}")
    cofactors = solution.cofactors
    scalars = cofactors.table.scalars(
        cofactors.table.find(list(names or known), "Point3"), "covariance"
    ).ravel()
    factor = 1.0 if a_priori else solution.variance_factor or 1.0
    return cofactors.between(scalars, scalars) * factor
