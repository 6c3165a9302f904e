"""What an adjustment says of its quality: reliability, blunders left out, variance components, ellipses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from obseq.arguments import NOTHING, NUMBER, TRUTH, Expected, require
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.leastsquares.statistics.ellipses import ErrorEllipses, relative_precision
from obseq.leastsquares.statistics.hypothesis_tests import checked_probability
from obseq.leastsquares.statistics.reliability import reliability
from obseq.survey.adjustment.joint_groups import joint_groups

if TYPE_CHECKING:
    from collections.abc import Mapping

    from obseq.arrays import FloatArray
    from obseq.leastsquares import Batch, LeastSquaresResult, Prior
    from obseq.leastsquares.statistics.effects import Effects
    from obseq.leastsquares.statistics.ellipses import RelativePrecision
    from obseq.leastsquares.statistics.observation_reliability import ObservationReliability
    from obseq.leastsquares.statistics.reliability import Reliability
    from obseq.leastsquares.statistics.variance_components import VarianceComponents
    from obseq.survey.equations.equations import Equations
    from obseq.survey.model import FieldBook

STATISTICS = ("w", "tau")
ROUNDED = 1e-6
"""sigma0 below which residuals are rounding: at 1000 km coordinates end at 1e-10 m, for a sigma of 0.1 mm."""
_STATISTIC = Expected('"w" or "tau"', lambda value: value in STATISTICS)
_KINDS = {
    "reliability": TRUTH,
    "level": NUMBER,
    "power": NUMBER,
    "snooping": _STATISTIC | NOTHING,
    "snooping_level": NUMBER,
    "variance_components": TRUTH,
    "ellipses": NUMBER | NOTHING,
    "ellipsoids": TRUTH,
    "effects": TRUTH,
    "inner": TRUTH,
    "relative": TRUTH,
    "a_priori": TRUTH,
}


@dataclass(frozen=True)
class Quality:
    """What is wanted beside residuals and precisions; nothing else is computed.

    Attributes:
        reliability: Redundancy numbers, standardised residuals, detectable biases and their effects.
        level: Level of the test of a single observation.
        power: Power of that test, behind the detectable biases.
        snooping: Leave out the observations that the search for errors accuses, and of which nothing else is
            as good: by "w" (the given sigmas are trusted) or "tau" (only their proportions are); None: leave
            out nothing.
        snooping_level: Probability that snooping leaves out anything where nothing is wrong.
        variance_components: Estimate a factor of the variances of each kind of observation, and use it.
        ellipses: Probability that the true point is inside its ellipse; None: standard ellipses (39 %).
        effects: What the detectable bias of each observation does to the coordinates: one solve for each.
        inner: Precisions with the datum of inner constraints too, as if no point were known (Comp3D's way:
            a second step after the adjustment with the known points).
        ellipsoids: Error ellipsoids of points, with the probability of the ellipses (standard ones: 20 %).
        relative: Precisions and relative ellipses of all pairs of points that observations join.
        a_priori: Precisions from the given sigmas as they are, instead of scaled by the estimated sigma0.
    """

    reliability: bool = True
    level: float = 0.001
    power: float = 0.80
    snooping: str | None = None
    snooping_level: float = 0.05
    variance_components: bool = False
    ellipses: float | None = None
    ellipsoids: bool = False
    effects: bool = False
    inner: bool = False
    relative: bool = False
    a_priori: bool = False

    def __post_init__(self) -> None:
        for name, kind in _KINDS.items():
            require("Quality", name, getattr(self, name), kind)
        for name in ("level", "power", "snooping_level", "ellipses"):
            if getattr(self, name) is not None:
                checked_probability(getattr(self, name), f"Quality: {name}")


@dataclass(frozen=True, eq=False)
class Examination:
    """What was found out of the quality of a network.

    Attributes:
        wanted: What was asked for.
        solution: The final solution.
        reliability: Of its observations and known coordinates; None when not asked for.
        components: The variance components; None when not asked for.
        relative: Precision of pairs of points that observations join; None when not asked for.
        effects: What detectable biases do, by the identity of the batch; None when not asked for.
        failures: What was asked for and could not be found out, a sentence each.
    """

    wanted: Quality
    solution: LeastSquaresResult
    reliability: Reliability | None = None
    components: VarianceComponents | None = None
    relative: RelativePrecision | None = None
    effects: Mapping[int, Effects] | None = None
    failures: tuple[str, ...] = ()

    @property
    def a_priori(self) -> bool:
        """Whether precisions are those of the given sigmas."""
        return _is_a_priori(self.wanted, self.solution)

    def relative_ellipses(self) -> ErrorEllipses | None:
        """The relative ellipses, at the level asked for."""
        return None if self.relative is None else self.relative.ellipses(self.wanted.ellipses)


def _is_a_priori(wanted: Quality, solution: LeastSquaresResult) -> bool:
    """Whether precisions are those of the given sigmas: as asked for, or as the residuals say nothing."""
    return wanted.a_priori or (solution.variance_factor or 0.0) < ROUNDED**2


def examine(
    equations: Equations,
    book: FieldBook,
    wanted: Quality,
    solving: Mapping[str, Any],
) -> Examination:
    """Solves a network, and finds out what is wanted of its quality.

    Args:
        equations: The network.
        book: Its observations.
        wanted: What to find out.
        solving: Arguments of `LeastSquares.solve`.

    Raises:
        InputError: The network cannot tell what is wanted.
        SingularSystemError: The observations do not determine some unknowns.
    """
    system = equations.system
    solution = system.solve(covariance=True, **solving)
    if not solution.n_unknowns or solution.weak is not None:  # normalised residuals say what there is to say
        return Examination(wanted, solution)
    components, failures = _components(equations, book, solving) if wanted.variance_components else (None, ())
    solution = components.result if components else solution
    levels = wanted.level, wanted.power
    quality = None
    if wanted.reliability:
        quality = reliability(system, solution, *levels, groups=joint_groups(equations, book))
    relative = (
        _relative(equations, book, solution, _is_a_priori(wanted, solution)) if wanted.relative else None
    )
    effects = _effects(equations, quality) if wanted.effects and quality else None
    return Examination(wanted, solution, quality, components, relative, effects, failures)


def _effects(equations: Equations, quality: Reliability) -> Mapping[int, Effects]:
    """What the detectable bias of each observation does to the points, by the identity of its batch."""
    from obseq.leastsquares.statistics.effects import effects_of_biases

    batches = [batch for _, batch in equations.batches.values()]
    return {id(batch): effects_of_biases(quality, batch, equations.points) for batch in batches}


def _components(
    equations: Equations, book: FieldBook, solving: Mapping[str, Any]
) -> tuple[VarianceComponents | None, tuple[str, ...]]:
    """The components that the network controls, and what could not be estimated."""
    if book.observations.relative_sigmas.any():
        return None, (
            "no variance components: some sigmas have a part relative to the distance, which no factor "
            "holds; give absolute sigmas, or --ignore relative-sigmas",
        )
    from obseq.leastsquares.statistics import variance_components as engine

    system, failures = equations.system, []
    groups = list(dict.fromkeys(batch.group for _, batch in equations.batches.values()))
    is_large = system.n_unknowns > engine.EXACT_LIMIT
    method = engine.Method.REDUNDANCY if is_large else engine.Method.LS_VCE
    solved = system.unknowns.state()
    while groups:
        components = engine.group_components(system, groups)
        try:
            found = engine.variance_components(system, components, method=method, solve_options=solving)
        except engine.UncontrolledError as error:
            groups.remove(error.name)
            failures.append(f"no variance component of {error.name}: nothing controls it; its sigmas stay")
        except InputError as error:
            failures.append(f"no variance components: {error}")
            break
        else:
            return found, tuple(failures)
        system.unknowns.restore(solved)
    system.unknowns.restore(solved)
    return None, tuple(failures)


def _relative(
    equations: Equations, book: FieldBook, solution: LeastSquaresResult, a_priori: bool
) -> RelativePrecision | None:
    """Of the pairs that observations join; None where no two of them are apart."""
    rows = book.observations
    ends = np.column_stack([rows.from_points, rows.to_points])[rows.active]
    pairs = np.unique(np.sort(ends, axis=1), axis=0)
    coordinates = solution.values(equations.points)
    apart = np.linalg.norm(coordinates[pairs[:, 1]] - coordinates[pairs[:, 0]], axis=1) > 0.0
    if not apart.any():
        return None
    first, second = equations.points[pairs[apart]].T
    return relative_precision(solution, first, second, a_priori)


def of_observations(equations: Equations, part: Reliability, name: str, n: int) -> FloatArray:
    """(n,) one of the numbers of all observations of the field book; NaN where it has none."""
    found = np.full(n, np.nan)
    for rows, batch in equations.batches.values():
        found[rows] = numbers(part.of(batch), name)
    return found


def numbers(part: ObservationReliability[Batch | Prior], name: str) -> FloatArray:
    """(n,) one of the numbers of observations that have one residual each."""
    array: FloatArray = getattr(part, name)
    return array[:, 0]
