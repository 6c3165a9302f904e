"""How often tests of single observations find what theory says: false alarms, and planted blunders.

A network of height differences with simulated errors. Without blunders, snooping at an overall level and the
test of one observation reject as often as announced. With a bias of five sigmas in each observation in turn,
its own test rejects it with the power that its redundancy gives, and it is also the worst of all as often as
the correlations of the standardised residuals, computed from the design alone, let it be.

Example:
    python tools/benchmarks/bench_snooping.py --draws 500
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import stats

from obseq.leastsquares import LeastSquares, reliability, snoop

FloatArray = npt.NDArray[np.float64]
SIGMA = 0.002
BIAS = 5.0
LEVEL = 0.001
OVERALL = 0.05
THEORY_DRAWS = 20_000


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
        self.design = np.zeros((self.n, side * side))
        self.design[np.arange(self.n)[:, None], pairs] = -1.0, 1.0
        one = np.ones((self.n, 1))
        ends = np.array([[ids[a] for a, _ in pairs], [ids[b] for _, b in pairs]])
        self.batch = self.system.add_linear(list(ends), [-one, one], np.zeros(self.n), SIGMA)

    def observe(self, errors: FloatArray) -> None:
        """Gives the observations these errors (n,); the true values are 0."""
        observations = self.batch.observations.copy()
        observations[:, -1] = errors
        self.batch.observations = observations

    def standardised(self, errors: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Standardised residuals of observations with these errors (n,), and redundancy numbers."""
        self.observe(errors)
        result = self.system.solve(covariance=True)
        part = reliability(self.system, result, LEVEL).of(self.batch)
        return part.w[:, 0], part.redundancy[:, 0]


def transfer(network: Levelling) -> tuple[FloatArray, FloatArray]:
    """(n, n) what an error does to each standardised residual, from unit errors; redundancy numbers (n,)."""
    columns = [network.standardised(row) for row in np.eye(network.n)]
    return np.array([w for w, _ in columns]).T, columns[0][1]


def sidak_critical(tests: int) -> float:
    """Limit of each of so many tests of which any rejects at the overall level."""
    return float(stats.norm.isf((1.0 - (1.0 - OVERALL) ** (1.0 / tests)) / 2.0))


def rates(network: Levelling, draws: int, seed: int) -> Rates:
    """What tests find in so many draws of the errors."""
    response, redundancy = transfer(network)
    chance = np.random.default_rng(seed)
    clean = np.abs(response @ (SIGMA * chance.standard_normal((network.n, draws))))
    critical = stats.norm.isf(LEVEL / 2.0)
    sidak = sidak_critical(network.n)
    found, first = np.zeros(network.n), np.zeros(network.n)
    for row in range(network.n):
        errors = SIGMA * chance.standard_normal((network.n, draws))
        errors[row] += BIAS * SIGMA
        judged = np.abs(response @ errors)
        rejected = judged[row] > critical
        found[row] = rejected.mean()
        first[row] = (rejected & (judged.argmax(axis=0) == row)).mean()
    overall = float((clean.max(axis=0) > sidak).mean())
    theory = power(redundancy, critical), named_first(network.design[:, 1:], critical, seed + 1)
    return Rates(float((clean > critical).mean()), overall, found, theory[0], first, theory[1])


def snooped(network: Levelling, draws: int, seed: int) -> tuple[float, float]:
    """Runs of `snoop`: share that reject anything without blunder, and that reject a planted one first."""
    chance = np.random.default_rng(seed)
    alarms, found = 0, 0
    for draw in range(draws):
        row, errors = draw % network.n, SIGMA * chance.standard_normal(network.n)
        for bias in (0.0, BIAS):
            network.observe(errors + bias * SIGMA * (np.arange(network.n) == row))
            snooping = snoop(network.system, OVERALL)
            rejected = [item.row for item in snooping.rejections]
            snooping.reinstate()
            if bias:
                found += rejected[:1] == [row]
            else:
                alarms += bool(rejected)
    return alarms / draws, found / draws


def power(redundancy: FloatArray, critical: float) -> FloatArray:
    """(n,) probability that the two-sided test of a biased observation rejects it."""
    shift = BIAS * np.sqrt(redundancy)
    return np.asarray(stats.norm.sf(critical - shift) + stats.norm.cdf(-critical - shift))


def named_first(design: FloatArray, critical: float, seed: int, draws: int = THEORY_DRAWS) -> FloatArray:
    """(n,) probability that a biased observation has the largest standardised residual, beyond the limit.

    Those of equal sigmas are normal with correlations R_ij / sqrt(r_i r_j), R the projector of the design
    (n, u) on the residuals, and a bias of row j shifts number i by BIAS sqrt(r_j) times their correlation.
    """
    basis, _ = np.linalg.qr(design)
    projector = np.eye(len(design)) - basis @ basis.T
    root = np.sqrt(np.diag(projector))
    correlation = projector / np.outer(root, root)
    axes, values, _ = np.linalg.svd(correlation, hermitian=True)
    normal = np.random.default_rng(seed).standard_normal((len(design), draws))
    centred = (axes * np.sqrt(values)) @ normal
    return np.array(
        [_share_first(centred, BIAS * root[k] * correlation[k], k, critical) for k in range(len(root))]
    )


def _share_first(centred: FloatArray, shift: FloatArray, row: int, critical: float) -> float:
    judged = np.abs(centred + shift[:, None])
    return float(((judged[row] > critical) & (judged.argmax(axis=0) == row)).mean())


def main() -> None:
    """Prints the shares found beside those of theory."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--draws", type=int, default=500)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--side", type=int, default=5)
    given = options.parse_args()
    network = Levelling(given.side)
    got = rates(network, given.draws, given.seed)
    print(f"{network.n} observations, {given.draws} draws of each")
    print(f"single tests that reject without blunder: {got.alarms:.5f} (level {LEVEL:g})")
    print(f"adjustments with any alarm at the overall level {OVERALL:g}: {got.overall:.3f}")
    shares = {"found": got.found, "by theory": got.expected}
    shares |= {"and named first": got.first, "first by theory": got.first_expected}
    for name, values in shares.items():
        print(f"bias of {BIAS:g} sigmas {name:<16} mean {values.mean():.3f}, least {values.min():.3f}")
    alarms, first = snooped(network, given.draws, given.seed)
    expected = named_first(network.design[:, 1:], sidak_critical(network.n), given.seed).mean()
    print(
        f"runs of snoop: {alarms:.3f} reject anything without blunder; {first:.3f} reject the blunder first"
    )
    print(f"  (by theory in {expected:.3f})")
    for found, theory in ((got.found, got.expected), (got.first, got.first_expected)):
        worst = np.abs(found - theory) / np.sqrt(theory * (1 - theory) / given.draws)
        print(f"largest difference from theory: {worst.max():.2f} of its standard deviation")


if __name__ == "__main__":
    main()
