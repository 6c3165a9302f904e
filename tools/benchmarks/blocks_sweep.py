"""Every system that tests solve, also in blocks: whether all it gives is that of one machine.

    python tools/benchmarks/blocks_sweep.py [--parts 2 4] [tests/... ...]

The tests run as they are, those of sample projects when none are named. Each solution that has covariances is
made three times: at once, and in two and in four parts. Unknowns, variances, redundancies and tests are
compared; the last lines have the largest differences, and every solution beyond the bound. Two solvers of one
machine, dense and supernodal, differ by rounding as well: the same is printed of them.
"""

from __future__ import annotations

import sys
from collections import Counter
from functools import partial, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from command import command_line

from obseq.errors import ObseqError
from obseq.leastsquares import Blocks, LeastSquares, Reliability, reliability
from obseq.leastsquares.analysis import Analyses

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable

ROOT = Path(__file__).resolve().parents[2]
TESTS = (
    "tests/survey/test_comp3d.py",
    "tests/survey/test_comp3d_projects.py",
    "tests/survey/test_gama.py",
    "tests/survey/test_dynadjust.py",
    "tests/survey/test_datum_cases.py",
    "tests/formats/test_survey_cases.py",
    "tests/formats/test_image_cases.py",
    "tests/test_field_cases.py",
    "tests/images/test_dbat.py",
    "tests/images/test_bundle.py",
    "tests/leastsquares/test_gama.py",
    "tests/leastsquares/test_bal.py",
    "tests/leastsquares/test_posegraph.py",
    "tests/leastsquares/test_correlated.py",
    "tests/leastsquares/test_clusters.py",
)
BOUND = 1e-9
LARGEST = 5_000
"""Unknowns beyond which a system is not solved again: the sweep is of kinds, not of sizes."""

Found = dict[str, float]


class Sweep:
    """A plugin of pytest that solves again whatever is solved with covariances."""

    def __init__(self, solvers: dict[str, str | Blocks]) -> None:
        self.solvers, self.test, self.is_inside = solvers, "", False
        self.worst: dict[str, Found] = {name: {} for name in solvers}
        self.beyond: dict[str, list[tuple[str, Found]]] = {name: [] for name in solvers}
        self.counts: Counter[str] = Counter()

    def pytest_runtest_setup(self, item: Any) -> None:
        """Notes the name of a test."""
        self.test = item.nodeid

    def solving(self, solve: Callable[..., Any]) -> Callable[..., Any]:
        """`LeastSquares.solve`, and what is done beside it."""

        @wraps(solve)
        def wrapped(system: LeastSquares, *args: Any, **options: Any) -> Any:
            is_wanted = options.get("covariance") is not None and options["covariance"] is not False
            if is_wanted and not self.is_inside and system.unknowns.n_scalars <= LARGEST:
                self.beside(system, partial(solve, system, *args, **options))
            return solve(system, *args, **options)

        return wrapped

    def beside(self, system: LeastSquares, solve: Callable[[], Any]) -> None:
        """Solves a system by all solvers, compares, and puts it back where it was."""
        self.is_inside, start = True, system.unknowns.state()
        try:
            expected = answers(system, solve)
            for name, solver in self.solvers.items():
                system.unknowns.restore(start)
                system._analyses, kept = Analyses(system.problem, solver, 1), system._analyses
                self.compare(name, expected, answers(system, solve))
                system._analyses = kept
        finally:
            system.unknowns.restore(start)
            self.is_inside = False

    def compare(self, name: str, expected: Any, found: Any) -> None:
        """Notes how far two solutions are apart."""
        self.counts[name] += 1
        if isinstance(expected, str) or isinstance(found, str):
            if expected != found:
                self.beyond[name].append((f"{self.test}: {expected} / {found}"[:300], {}))
            return
        apart = {key: distance(key, expected[key], found[key]) for key in expected}
        for key, value in apart.items():
            self.worst[name][key] = max(self.worst[name].get(key, 0.0), value)
        if max(apart.values()) > BOUND:
            self.beyond[name].append((self.test, apart))

    def tell(self) -> None:
        """Prints the largest differences, and the solutions beyond the bound."""
        for name, worst in self.worst.items():
            print(f"{name}: {self.counts[name]} solutions, {len(self.beyond[name])} beyond {BOUND:g}")
            print("    largest differences:", rounded(worst))
            print(f"    at most {self.times_one_machine(name):.1f} times {BOUND:g} and supernodal, by test")
            for test, apart in self.beyond[name]:
                print("   ", test, rounded(apart))

    def times_one_machine(self, name: str) -> float:
        """How far a solver is beyond the bound, and beyond the second one of one machine in the same test."""
        limits: dict[tuple[str, str], float] = {}
        for test, apart in self.beyond["supernodal"]:
            for key, value in apart.items():
                limits[test, key] = max(limits.get((test, key), BOUND), value)
        found = [(test, *item) for test, apart in self.beyond[name] for item in apart.items()]
        ratios = (value / limits.get((test, key), BOUND) for test, key, value in found if value < np.inf)
        return max(ratios, default=0.0)


def rounded(apart: Found) -> dict[str, str]:
    """Differences in two digits."""
    return {key: f"{value:.1e}" for key, value in apart.items()}


def answers(system: LeastSquares, solve: Callable[[], Any]) -> Any:
    """What a solution gives; the error that it ends with."""
    try:
        result = solve()
        if not result.has_covariances:
            return "no covariances"
        quality = reliability(system, result) if result.redundancy > 0 else None
    except ObseqError as error:
        return type(error).__name__
    numbers = {"unknowns": result.state.values.copy(), "variances": result.cofactors.variances()}
    return numbers if quality is None else numbers | tests_of(quality)


def tests_of(quality: Reliability) -> dict[str, Any]:
    """Redundancies and tests of all equations; no tests where next to nothing controls them."""
    redundancies = np.concatenate([one.redundancy.ravel() for one in quality.all])
    tests = np.concatenate([one.w.ravel() for one in quality.all])
    return {"redundancies": redundancies, "tests": np.where(redundancies > 1e-6, tests, np.nan)}


def distance(key: str, expected: Any, found: Any) -> float:
    """The largest difference: of variances a share, of others as they are, of large unknowns a share."""
    if expected.shape != found.shape or (np.isnan(expected) != np.isnan(found)).any():
        return np.inf
    apart = np.abs(np.nan_to_num(expected) - np.nan_to_num(found))
    scale = np.abs(np.nan_to_num(expected)) if key == "variances" else np.ones(len(apart))
    return float(np.max(apart / np.where(scale > 0.0, scale, 1.0), initial=0.0))


def arguments() -> argparse.Namespace:
    """What the command line asks for."""
    parser = command_line(__doc__)
    parser.add_argument("tests", nargs="*", default=TESTS)
    parser.add_argument("--parts", type=int, nargs="+", default=(2, 4))
    return parser.parse_args()


def main() -> None:
    """Runs the tests, prints the differences."""
    options = arguments()
    blocks = {f"{count} parts": Blocks(parts=count) for count in options.parts}
    sweep = Sweep({"dense": "dense", "supernodal": "supernodal", **blocks})
    LeastSquares.solve = sweep.solving(LeastSquares.solve)  # type: ignore[method-assign]
    code = pytest.main(["-q", "-n", "0", "-p", "no:cacheprovider", *options.tests], plugins=[sweep])
    sweep.tell()
    for one in blocks.values():
        one.close()
    sys.exit(int(code))


if __name__ == "__main__":
    main()
