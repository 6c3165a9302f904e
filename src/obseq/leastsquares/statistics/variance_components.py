"""Variance components: the sigmas of groups of observations, estimated with the unknowns.

The variance of an observation is a sum over components, sum_k f_k q_k, with q_k given and the factors f_k
unknown. In normalised terms (residuals over sigmas, R = I - A Q A', D_k = diag(q_k / variance)) the
expectation of v' D_k v is sum_l f_l tr(D_k R D_l R): linear equations for the factors, solved anew with the
weights that they give until nothing changes. On groups that do not overlap these are Helmert's equations.
Sources: docs/statistics.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from enum import Enum
from typing import Any

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.leastsquares.problem.batches import Batch
from obseq.leastsquares.problem.priors import Prior
from obseq.leastsquares.problem.weights import Restorer
from obseq.leastsquares.solution.result import LeastSquaresResult
from obseq.leastsquares.statistics.component_equations import (
    Component,
    ComponentEquations,
    Exact,
    Sampled,
    Traces,
)
from obseq.leastsquares.statistics.final_state import final_state
from obseq.leastsquares.system import LeastSquares

SMALLEST = 1e-8
"""Factors do not fall below it: sigmas ten thousand times smaller than given."""

ROUNDING = 1e-10
"""Stands for what of a component's share in the redundancy is rounding, perhaps below zero."""

SLOWEST_FALL = 0.1
"""A factor falls by no more than this in one round: a bad round must not give a group a lasting weight."""

EXACT_LIMIT = 3000
"""Unknowns up to which traces are exact: beyond, the dense inverse would be needed."""


class Method(Enum):
    """How the factors are found from the residuals of a round."""

    LS_VCE = "ls-vce"
    HELMERT = "helmert"
    REDUNDANCY = "redundancy"


@dataclass(frozen=True)
class VarianceComponents:
    """Estimated variance components; the system now has the sigmas that they give, and is solved with them.

    Attributes:
        names: (k,) the components.
        factors: (k,) what multiplies the given variances; sigmas are multiplied by the square roots.
        covariance: (k, k) of the factors, for normal errors; None for the method "redundancy".
        redundancy: (k,) share of each component in the redundancy.
        negative: components whose estimate was not positive in the last round: the observations do not
            support them; their factors are held at the smallest value allowed.
        converged: True when the factors no longer changed.
        history: (rounds + 1, k) factors before and after each round.
        result: solution with the final weights.
    """

    names: tuple[str, ...]
    factors: FloatArray
    covariance: FloatArray | None
    redundancy: FloatArray
    negative: tuple[str, ...]
    converged: bool
    history: FloatArray
    result: LeastSquaresResult
    _given: Restorer = field(repr=False)

    @property
    def precisions(self) -> FloatArray:
        """(k,) standard deviations of the factors.

        Raises:
            InputError: the method used does not tell.
        """
        if self.covariance is None:
            raise InputError('precisions of variance components: use the method "ls-vce" or "helmert"')
        return np.sqrt(np.diag(self.covariance))

    def restore(self) -> None:
        """Gives all observations the sigmas they had before; the system is to be solved anew."""
        self._given.restore()

    def columns(self) -> dict[str, list[str] | list[float]]:
        """A table by columns."""
        known = self.covariance is not None
        return {
            "component": list(self.names),
            "factor": self.factors.tolist(),
            "sigma_factor": np.sqrt(self.factors).tolist(),
            "precision": (self.precisions if known else np.full(len(self.names), np.nan)).tolist(),
            "redundancy": self.redundancy.tolist(),
        }


def group_components(system: LeastSquares, groups: Sequence[str] | None = None) -> tuple[Component, ...]:
    """One component per group of batches and priors, multiplying the variances given.

    Args:
        system: the system.
        groups: names of groups, the others keep their variances; all when None.
    """
    sources: dict[str, list[Batch | Prior]] = {}
    for source in _sources(system):
        sources.setdefault(source.group, []).append(source)
    unknown = sorted(set(groups or ()) - set(sources))
    if unknown:
        raise InputError(f"no group is called {unknown[0]!r}; there are {', '.join(sorted(sources))}")
    return tuple(
        Component(name, tuple((source, np.square(source.sigmas)) for source in sources[name]))
        for name in (sources if groups is None else groups)
    )


class UncontrolledError(InputError):
    """A component, `name`, has no share in the redundancy: its sigmas stay as they are given."""

    def __init__(self, name: str) -> None:
        super().__init__(f"the variance component {name!r} has no redundancy: nothing controls it")
        self.name = name


def variance_components(
    system: LeastSquares,
    components: Sequence[Component] | None = None,
    method: Method | str = Method.LS_VCE,
    max_rounds: int = 30,
    tolerance: float = 1e-4,
    probes: int | None = None,
    seed: int = 0,
    solve_options: Mapping[str, Any] | None = None,
) -> VarianceComponents:
    """Estimates variance components; the system is left with the sigmas found, solved.

    Observations of no component keep their variances.

    Args:
        system: the system.
        components: parts of the variances; one per group when None (`group_components`).
        method: "ls-vce"; "helmert", the same for components that do not overlap; "redundancy" for large
            systems: each group's sum of squares over its redundancy, the same fixed point, no covariances.
        max_rounds: solutions at most.
        tolerance: ends when no factor changes by more than this share.
        probes: with more than 3000 unknowns, number of random vectors that traces are estimated from.
        seed: of the random vectors.
        solve_options: arguments of `LeastSquares.solve` for the solutions.

    Raises:
        InputError: components without redundancy, or that cannot be told apart; they are named.
    """
    chosen = tuple(group_components(system) if components is None else components)
    method = Method(method)
    _check(system, chosen, method, probes)
    traces = Exact() if probes is None else Sampled(probes, seed)
    given = Restorer(_sources(system))
    rounds = _Rounds(system, ComponentEquations(system, chosen), method, traces, dict(solve_options or {}))
    try:
        return rounds.run(chosen, given, max_rounds, tolerance)
    except BaseException:  # an interruption too leaves the system as it was given
        given.restore()
        raise


@dataclass
class _Rounds:
    """The rounds of an estimation."""

    system: LeastSquares
    equations: ComponentEquations
    method: Method
    traces: Traces
    options: dict[str, Any]
    negative: tuple[int, ...] = ()

    def run(
        self, components: tuple[Component, ...], given: Restorer, max_rounds: int, tolerance: float
    ) -> VarianceComponents:
        factors, history, converged = np.ones(len(components)), [np.ones(len(components))], False
        for _ in range(max_rounds):
            new = self._improved(factors, self._solve(factors))
            converged = bool(np.max(np.abs(new / factors - 1.0)) <= tolerance)
            factors = new
            history.append(new)
            if converged:
                break
        result = self._solve(factors)
        matrix, _, redundancy = self._equations(factors, result)
        return VarianceComponents(
            tuple(component.name for component in components),
            factors,
            None if matrix is None else np.asarray(2.0 * np.linalg.inv(matrix)),
            redundancy * factors,
            tuple(components[k].name for k in self.negative),
            converged,
            np.array(history),
            result,
            given,
        )

    def _solve(self, factors: FloatArray) -> LeastSquaresResult:
        for source, variances in self.equations.variances(factors):
            source.sigmas = np.sqrt(variances)
        return self.system.solve(covariance=True, **self.options)

    def _equations(
        self, factors: FloatArray, result: LeastSquaresResult
    ) -> tuple[FloatArray | None, FloatArray, FloatArray]:
        """Matrix and right-hand side of the equations of the factors, and traces of D_k R."""
        state = final_state(self.system, result)
        shares = self.equations.shares(state, factors)
        squares, redundancy, weight = self.equations.sums(state, shares)
        self._refuse_uncontrolled(redundancy, weight)
        if self.method is Method.REDUNDANCY:
            return None, squares, redundancy
        matrix, known = self.equations.matrix(state, shares, self.traces)
        return matrix, squares - known, redundancy

    def _improved(self, factors: FloatArray, result: LeastSquaresResult) -> FloatArray:
        matrix, right, redundancy = self._equations(factors, result)
        smallest = np.maximum(SMALLEST, SLOWEST_FALL * factors)
        if matrix is None:
            found = factors * right / redundancy
            self.negative = tuple(np.flatnonzero(found < SMALLEST).tolist())
            return np.maximum(found, smallest)
        scaled = matrix * np.outer(factors, factors)
        self._refuse_inseparable(scaled)
        self.negative = tuple(np.flatnonzero(np.linalg.solve(scaled, right * factors) <= 0.0).tolist())
        return factors * _bounded(scaled, right * factors, smallest / factors)

    def _refuse_uncontrolled(self, redundancy: FloatArray, weight: FloatArray) -> None:
        for name, part, whole in zip(self.equations.names, redundancy, weight, strict=True):
            if part <= 1e-6 * whole:
                raise UncontrolledError(name)

    def _refuse_inseparable(self, scaled: FloatArray) -> None:
        size = np.sqrt(np.maximum(np.diag(scaled), ROUNDING))
        values, vectors = np.linalg.eigh(scaled / np.outer(size, size))
        if values[0] < 1e-10:
            names = [self.equations.names[k] for k in np.flatnonzero(np.abs(vectors[:, 0]) > 1e-3)]
            raise InputError(
                f"the variance components {', '.join(map(repr, names))} cannot be told apart: "
                "their variances are proportional, or nothing controls them separately"
            )


def _bounded(matrix: FloatArray, right: FloatArray, smallest: FloatArray) -> FloatArray:
    """The solution of M f = b where it is large enough, else the nearest one (in the metric of M) that is."""
    from scipy.optimize import nnls

    factor = np.linalg.cholesky(matrix)
    target = np.linalg.solve(factor, right) - factor.T @ smallest
    excess, _ = nnls(factor.T, target)
    return np.asarray(smallest + excess)


def _sources(system: LeastSquares) -> tuple[Batch | Prior, ...]:
    equations = system.equations()
    return (*equations.batches, *equations.priors)


def _check(
    system: LeastSquares, components: tuple[Component, ...], method: Method, probes: int | None
) -> None:
    if not components:
        raise InputError("variance components: none given")
    n = system.equations().n_unknowns
    if method is not Method.REDUNDANCY and probes is None and n > EXACT_LIMIT:
        raise InputError(
            f"{n} unknowns: exact traces need the dense inverse (up to {EXACT_LIMIT}); give probes=32 "
            'or so for estimated ones, or use the method "redundancy"'
        )
    for batch in system.equations().batches:
        if batch.loss is not None:
            raise InputError(
                f"variance components of {batch.name}: it has a loss, whose weights depend on the sigmas; "
                "set it to None (after leaving out blunders by data snooping)"
            )
    known = {id(source) for source in _sources(system)}
    seen: dict[int, str] = {}
    for component in components:
        for source, variances in component.parts:
            _check_part(component.name, source, variances, known)
            if method is Method.HELMERT and id(source) in seen:
                raise InputError(
                    f"{seen[id(source)]!r} and {component.name!r} share observations: use the method ls-vce"
                )
            seen[id(source)] = component.name


def _check_part(name: str, source: Batch | Prior, variances: FloatArray, known: set[int]) -> None:
    what = source.name
    if id(source) not in known:
        raise InputError(f"variance component {name!r}: its part {what} is not in the system")
    shape = source.sigmas.shape
    if np.shape(variances) != shape:
        raise InputError(
            f"variance component {name!r}, {what}: variances have shape {np.shape(variances)}; "
            f"expected {shape}"
        )
    if source.is_correlated and np.any(variances != variances[:, :1]):
        raise InputError(
            f"variance component {name!r}, {what}: its residuals are correlated; give all residuals of an "
            "observation the same number, which multiplies its covariance"
        )
    if not (np.isfinite(variances).all() and np.min(variances, initial=0.0) >= 0.0):
        raise InputError(f"variance component {name!r}, {what}: variances must be finite and not negative")
