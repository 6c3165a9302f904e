"""How often tests of single observations find what theory says: false alarms, and planted blunders.

Three networks with simulated errors: height differences, an engine's system of linear equations; directions,
zenith angles and distances from four instruments, and correlated GNSS vectors, both adjusted as surveys are.
Without blunders, snooping at an overall level and the test of one observation reject as often as announced.
With a bias of five sigmas in each observation in turn, its own test rejects it with the power that theory
gives, and it is also the worst of all as often as the correlations of the standardised residuals, computed
from the design alone, let it be.

Example:
    python tools/benchmarks/bench_snooping.py --draws 500
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
import numpy.typing as npt
from measured_networks import terrestrial, vectors
from scipy import special

from obseq.leastsquares import LeastSquares, reliability, snoop

if TYPE_CHECKING:
    from collections.abc import Callable

FloatArray = npt.NDArray[np.float64]
SIGMA = 0.002
BIAS = 5.0
LEVEL = 0.001
OVERALL = 0.05
THEORY_DRAWS = 20_000
AT_ONCE = 1000
"""Draws whose comparisons stay near the processor."""


@dataclass(frozen=True)
class Rates:
    """Shares found and expected, all by observation where they are arrays (n,).

    Attributes:
        alarms: Share of tests of single observations that reject where nothing is wrong.
        overall: Share of adjustments in which any rejects at the overall level.
        found: (n,) share of draws in which the test of a biased observation rejects it.
        expected: (n,) the same by theory.
        first: (n,) share in which it has the largest standardised residual and is rejected.
        first_expected: (n,) the same by theory.
    """

    alarms: float
    overall: float
    found: FloatArray
    expected: FloatArray
    first: FloatArray
    first_expected: FloatArray


class Measured(Protocol):
    """A network whose observations get errors.

    Attributes:
        design: (n, u) derivatives of the observations, those of held unknowns left out.
        covariance: (n, n) of the observations.
    """

    design: FloatArray
    covariance: FloatArray

    def standardised(self, errors: FloatArray) -> FloatArray:
        """(n,) standardised residuals of observations with these errors (n,)."""

    def snooped(self, errors: FloatArray) -> list[int]:
        """Rows of observations with these errors (n,) that snooping leaves out, the first first."""


class Levelling:
    """Height differences over a mesh of bench marks, one of them held: the equations are linear."""

    def __init__(self, side: int = 5) -> None:
        marks = np.arange(side * side).reshape(side, side)
        pairs = [*zip(marks[:, :-1].ravel(), marks[:, 1:].ravel(), strict=True)]
        pairs += [*zip(marks[:-1].ravel(), marks[1:].ravel(), strict=True)]
        pairs += [*zip(marks[:-1, :-1].ravel(), marks[1:, 1:].ravel(), strict=True)]
        pairs += [*zip(marks[1:, :-1].ravel(), marks[:-1, 1:].ravel(), strict=True)]
        self.system = LeastSquares()
        ids = self.system.add_scalars([f"B{k}" for k in range(side * side)], np.zeros(side * side))
        self.system.freeze(ids[:1])
        self.n = len(pairs)
        design = np.zeros((self.n, side * side))
        design[np.arange(self.n)[:, None], pairs] = -1.0, 1.0
        self.design, self.covariance = design[:, 1:], SIGMA**2 * np.eye(self.n)
        one = np.ones((self.n, 1))
        ends = np.array([[ids[a] for a, _ in pairs], [ids[b] for _, b in pairs]])
        self.batch = self.system.add_linear(list(ends), [-one, one], np.zeros(self.n), SIGMA)

    def observe(self, errors: FloatArray) -> None:
        """Gives the observations these errors (n,); the true values are 0."""
        observations = self.batch.observations.copy()
        observations[:, -1] = errors
        self.batch.observations = observations

    def standardised(self, errors: FloatArray) -> FloatArray:
        """(n,) standardised residuals of observations with these errors (n,)."""
        self.observe(errors)
        result = self.system.solve(covariance=True)
        return np.asarray(reliability(self.system, result, LEVEL).of(self.batch).w[:, 0])

    def snooped(self, errors: FloatArray) -> list[int]:
        """Rows of observations with these errors (n,) that snooping leaves out, the first first."""
        self.observe(errors)
        snooping = snoop(self.system, OVERALL)
        snooping.reinstate()
        return [item.row for item in snooping.rejections]


def transfer(network: Measured) -> FloatArray:
    """(n, n) what an error does to each standardised residual, from errors of one sigma."""
    sigmas = np.sqrt(np.diag(network.covariance))
    exact = network.standardised(np.zeros(len(sigmas)))
    columns = [network.standardised(row) - exact for row in np.diag(sigmas)]
    return np.array(columns).T / sigmas


def sidak_critical(tests: int) -> float:
    """Limit of each of so many tests of which any rejects at the overall level."""
    return -float(special.ndtri((1.0 - (1.0 - OVERALL) ** (1.0 / tests)) / 2.0))


def rates(network: Measured, response: FloatArray, draws: int, seed: int) -> Rates:
    """What tests find in so many draws of the errors; `response` as of `transfer`."""
    root = np.linalg.cholesky(network.covariance)
    chance, n = np.random.default_rng(seed), len(root)
    sigmas = np.sqrt(np.diag(network.covariance))
    clean = np.abs(response @ (root @ chance.standard_normal((n, draws))))
    critical = -special.ndtri(LEVEL / 2.0)
    found, first = np.zeros(n), np.zeros(n)
    for row in range(n):
        errors = root @ chance.standard_normal((n, draws))
        errors[row] += BIAS * sigmas[row]
        judged = np.abs(response @ errors)
        rejected = judged[row] > critical
        found[row] = rejected.mean()
        first[row] = (rejected & (judged.argmax(axis=0) == row)).mean()
    overall = float((clean.max(axis=0) > sidak_critical(n)).mean())
    theory = power(network, critical), named_first(network, critical, seed + 1)
    return Rates(float((clean > critical).mean()), overall, found, theory[0], first, theory[1])


def snooped(network: Measured, draws: int, seed: int) -> tuple[float, float]:
    """Runs of snooping: share that reject anything without blunder, and that reject a planted one first."""
    root, chance = np.linalg.cholesky(network.covariance), np.random.default_rng(seed)
    alarms, found, n = 0, 0, len(root)
    for draw in range(draws):
        row, errors = draw % n, root @ chance.standard_normal(n)
        alarms += bool(network.snooped(errors))
        errors[row] += BIAS * np.sqrt(network.covariance[row, row])
        found += network.snooped(errors)[:1] == [row]
    return alarms / draws, found / draws


def controls(network: Measured) -> tuple[FloatArray, FloatArray]:
    """(n,) shifts of standardised residuals by a bias of their own, (n, n) their correlations, by the design.

    With P the inverse of the covariance of the observations and Qv the cofactors of the residuals, number i
    is (P v)_i over its standard deviation, the root of (P Qv P)_ii.
    """
    weights, design = np.linalg.inv(network.covariance), network.design
    normal = design.T @ weights @ design
    judged = weights - weights @ design @ np.linalg.solve(normal, design.T @ weights)
    root = np.sqrt(np.diag(judged))
    return BIAS * np.sqrt(np.diag(network.covariance)) * root, judged / np.outer(root, root)


def power(network: Measured, critical: float) -> FloatArray:
    """(n,) probability that the two-sided test of a biased observation rejects it."""
    shift, _ = controls(network)
    return np.asarray(special.ndtr(shift - critical) + special.ndtr(-critical - shift))


def named_first(network: Measured, critical: float, seed: int, draws: int = THEORY_DRAWS) -> FloatArray:
    """(n,) probability that a biased observation has the largest standardised residual, beyond the limit.

    They are normal with those correlations, and a bias of row j shifts number i by its own shift times their
    correlation.
    """
    own, correlation = controls(network)
    axes, values, _ = np.linalg.svd(correlation, hermitian=True)
    normal = np.random.default_rng(seed).standard_normal((len(own), draws))
    centred = (axes * np.sqrt(values)) @ normal
    return np.array([_share_first(centred, own[k] * correlation[k], k, critical) for k in range(len(own))])


def _share_first(centred: FloatArray, shift: FloatArray, row: int, critical: float) -> float:
    found = 0
    for first in range(0, centred.shape[1], AT_ONCE):
        judged = centred[:, first : first + AT_ONCE] + shift[:, None]
        np.abs(judged, out=judged)
        before, own = judged[:row].max(axis=0, initial=0.0), judged[row]
        is_first = (own > critical) & (own > before) & (own >= judged[row:].max(axis=0))
        found += int(np.count_nonzero(is_first))
    return found / centred.shape[1]


NETWORKS: dict[str, Callable[[], Measured]] = {
    "height differences": lambda: Levelling(5),
    "directions, zenith angles and distances": terrestrial,
    "GNSS vectors": vectors,
}


def main() -> None:
    """Prints the shares found beside those of theory."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--draws", type=int, default=500)
    options.add_argument("--seed", type=int, default=1)
    given = options.parse_args()
    for name, made in NETWORKS.items():
        show(name, made(), given.draws, given.seed)


def show(name: str, network: Measured, draws: int, seed: int) -> None:
    """Prints what tests find in one network."""
    got, n = rates(network, transfer(network), draws, seed), len(network.design)
    print(f"{name}: {n} observations, {draws} draws of each")
    print(f"  single tests that reject without blunder: {got.alarms:.5f} (level {LEVEL:g})")
    print(f"  adjustments with any alarm at the overall level {OVERALL:g}: {got.overall:.3f}")
    shares = {"found": got.found, "by theory": got.expected}
    shares |= {"and named first": got.first, "first by theory": got.first_expected}
    for what, values in shares.items():
        print(f"  bias of {BIAS:g} sigmas {what:<16} mean {values.mean():.3f}, least {values.min():.3f}")
    alarms, first = snooped(network, draws, seed)
    expected = named_first(network, sidak_critical(n), seed).mean()
    print(f"  runs of snooping: {alarms:.3f} reject anything without blunder;")
    print(f"    {first:.3f} reject the blunder first (by theory {expected:.3f})")
    for found, theory in ((got.found, got.expected), (got.first, got.first_expected)):
        worst = np.abs(found - theory) / np.sqrt(theory * (1 - theory) / draws)
        print(f"  largest difference from theory: {worst.max():.2f} of its standard deviation")


if __name__ == "__main__":
    main()
