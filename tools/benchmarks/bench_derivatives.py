"""Checks every derivative of the catalogue, and compares the errors with a baseline.

Two tables. Differences: the worst error of each formula against sixth-order central differences of its
value kernel, relative to the largest entry of its row of the Jacobian (as `obseq check-derivatives`).
Precision: for a sample, the worst errors of value and Jacobian against the formula itself read in 50 digits;
errors of values are relative to the largest of the value and the inputs.

A figure is worse than the baseline when it is ten times larger and above its floor; the exit code is then 1.

Examples:
    python tools/benchmarks/bench_derivatives.py --json derivatives.json
    python tools/benchmarks/bench_derivatives.py --record
"""

import argparse
import json
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
from command import command_line
from numpy.typing import NDArray

from obseq.formulas import REGISTRY, Formula
from obseq.kernels import calculator, derivatives

Array = NDArray[np.float64]

BASELINE = Path(__file__).parent / "baselines" / "derivatives.json"
FACTOR = 10.0
FLOORS = {"difference": 1e-11, "value": 4e-15, "jacobian": 2e-14}
DIGITS = 50
POINTS = 4
SAMPLED = 6
"""One formula in so many is compared in high precision."""


@dataclass(frozen=True)
class Figures:
    """What was found for one formula: errors by kind, the worst entry, whether the differences pass."""

    name: str
    errors: dict[str, float]
    where: str
    passed: bool


def measure(formula: Formula, precise: bool) -> Figures:
    """The errors of one formula."""
    (check,) = derivatives.check([formula.name])
    errors = {"difference": check.worst_relative_error}
    if precise and check.unknown:
        errors |= precision(formula)
    where = f"{check.residual} by {check.unknown}" if check.unknown else "nothing to differentiate"
    return Figures(formula.name, errors, where, check.passed)


def precision(formula: Formula) -> dict[str, float]:
    """Worst errors of value and Jacobian against the formula in high precision, at a few random inputs."""
    ours = calculator(formula.name)
    unknowns, observations = derivatives.draw(ours.kernel, POINTS, np.random.default_rng(2))
    values, jacobian = ours.values_and_jacobian(unknowns, observations)
    worst = {"value": 0.0, "jacobian": 0.0}
    with mpmath.workdps(DIGITS):
        for u, o, value, rows in zip(unknowns, observations, values, jacobian, strict=True):
            exact, exact_rows = _exact(formula, u, o)
            if not (np.isfinite(exact_rows.astype(float)).all() and np.isfinite(rows).all()):
                continue
            size = max(np.abs(exact).max(), np.abs(u).max(initial=0.0), np.abs(o).max(initial=0.0))
            largest = np.abs(exact_rows).max(axis=1, keepdims=True)
            largest[largest == 0] = 1
            worst["value"] = max(worst["value"], float(np.abs((value - exact) / size).max()))
            worst["jacobian"] = max(worst["jacobian"], float(np.abs((rows - exact_rows) / largest).max()))
    return worst


def _exact(formula: Formula, u: Array, o: Array) -> tuple[NDArray[Any], NDArray[Any]]:
    """Residuals and Jacobian as mpmath numbers, the latter by differences far below double precision."""
    step = mpmath.mpf(10) ** (-DIGITS // 3)
    unknowns, observations = [mpmath.mpf(float(x)) for x in u], [mpmath.mpf(float(x)) for x in o]

    def moved(k: int, sign: int) -> NDArray[Any]:
        shifted = [x + sign * step if j == k else x for j, x in enumerate(unknowns)]
        return np.array(formula.evaluate(shifted, observations), dtype=object)

    columns = [(moved(k, 1) - moved(k, -1)) / (2 * step) for k in range(len(unknowns))]
    return np.array(formula.evaluate(unknowns, observations), dtype=object), np.array(columns, dtype=object).T


def worse(found: Figures, baseline: Mapping[str, float]) -> list[str]:
    """The kinds of error that grew."""
    return [
        kind
        for kind, error in found.errors.items()
        if kind in baseline and error > max(FACTOR * baseline[kind], FLOORS[kind])
    ]


def show(figures: Iterable[Figures], baseline: Mapping[str, Mapping[str, float]]) -> int:
    """Prints the table; gives the number of formulas that fail or got worse."""
    rows = list(figures)
    width = max(len(row.name) for row in rows)
    print(f"{'formula':<{width}} {'difference':>11} {'value':>9} {'Jacobian':>9}  worst entry")
    bad = 0
    for row in rows:
        grown = worse(row, baseline.get(row.name, {}))
        kinds = ("difference", 11), ("value", 9), ("jacobian", 9)
        cells = " ".join(f"{row.errors[k]:{w}.1e}" if k in row.errors else " " * w for k, w in kinds)
        mark = ("" if row.passed else "  FAILED") + (
            f"  worse than the baseline: {', '.join(grown)}" if grown else ""
        )
        bad += bool(mark)
        print(f"{row.name:<{width}} {cells}  {row.where}{mark}")
    largest = max(row.errors["difference"] for row in rows)
    print(f"{len(rows)} formulas; worst difference {largest:.1e}; {bad} failed or worse")
    return bad


def to_json(figures: Iterable[Figures]) -> str:
    """The errors, relative and without unit; less is better."""
    lines = ",\n".join(
        f"  {json.dumps(row.name)}: {json.dumps({k: float(f'{v:.2e}') for k, v in row.errors.items()})}"
        for row in figures
    )
    head = f'"format": "obseq-derivative-bench", "version": 1, "worse_when_times": {FACTOR}'
    return f'{{{head}, "floors": {json.dumps(FLOORS)},\n "formulas": {{\n{lines}\n }}\n}}\n'


def asked() -> argparse.Namespace:
    """What the command line asks for."""
    parser = command_line(__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="formulas (all of them)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures as JSON")
    parser.add_argument("--record", action="store_true", help="write them as the new baseline")
    return parser.parse_args()


def main() -> int:
    """Reads the command line, measures, prints, writes; returns 1 when something failed or got worse."""
    arguments = asked()
    chosen = [formula for formula in REGISTRY if formula.name in arguments.names or not arguments.names]
    figures = []
    for k, formula in enumerate(chosen):
        if sys.stderr.isatty():
            print(f"\r\033[K{formula.name}", end="", file=sys.stderr, flush=True)
        figures.append(measure(formula, precise=k % SAMPLED == 0 or bool(arguments.names)))
    baseline = json.loads(BASELINE.read_text("utf-8"))["formulas"] if BASELINE.exists() else {}
    bad = show(figures, {} if arguments.record else baseline)
    for path in [arguments.json] if arguments.json else []:
        path.write_text(to_json(figures), "utf-8")
    if arguments.record:
        BASELINE.write_text(to_json(figures), "utf-8")
    return 1 if bad else 0


if __name__ == "__main__":
    raise SystemExit(main())
