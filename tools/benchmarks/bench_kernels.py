"""Times kernels (values and derivatives, in cache) against other ways to compute the same formulas.

A batch is one tile, as the engine runs kernels: it consumes each tile before the next, so that tiles stay
in the first cache. With more evaluations than fit there (`--evaluations 1024`) the second one is measured.

Contenders, all in one interleaved run on one thread, in CPU time:

- obseq: the generated kernel on tiles;
- rival: C++ as MMVII's generator writes it, g++ -O3 -march=native (`rival.py`);
- graph: the same C++ loop with the statements of our graph;
- sympy: sympy.diff, one joint sympy.cse, printed for numba;
- jax: jit(vmap) of the value and its forward or reverse Jacobian, the better of the two, if JAX is installed.

Examples:
    python tools/benchmarks/bench_kernels.py Dist3D TopoHz --against rival graph sympy
    python tools/benchmarks/bench_kernels.py --json kernels.json
"""

import argparse
import importlib.util
import json
import statistics
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cpp_contenders
import numpy as np
import rival
from command import command_line
from interleaved import Repeat, race, ratio
from numpy.typing import NDArray

from obseq.codegen.compiler import Derived, derive
from obseq.compilation import compiled
from obseq.formulas import REGISTRY, Formula
from obseq.kernels import calculator, derivatives
from obseq.kernels.layout import LANES, STRIDE
from obseq.kernels.loading import Kernel
from obseq.kernels.tiles import aligned_tiles, call_kernel

if TYPE_CHECKING:
    from obseq.arrays import FloatArray

Array = NDArray[np.float64]
CONTENDERS = ("rival", "graph", "sympy", "jax")
AGREEMENT = 1e-6

TARGETS = {
    "Dist3D": 3.5,
    "TopoHz": 4.5,
    "EqColinearityCamPPC_Stenope_Dist_Rad3_Dec1_XY1": 6.0,
    "BlocRigid": 3.5,
}
"""How many times as long the rival must take at least."""

LEAST_OF_ALL, LEAST_MEDIAN = 3.0, 7.0
WHOLE_CATALOGUE = 100
"""Formulas in a run from which its median means something."""


@dataclass(frozen=True)
class Row:
    """The result of one formula.

    Attributes:
        name: Name of the formula.
        nanoseconds: CPU time of one evaluation, by contender.
        ratios: Times as long as ours, by contender.
        operations: Operations of one evaluation, of our graph and of the rival.
        disagreement: Largest difference of the Jacobians, relative to the row's largest entry, by contender.
    """

    name: str
    nanoseconds: dict[str, float]
    ratios: dict[str, float]
    operations: dict[str, int]
    disagreement: dict[str, float]


@compiled
def _run_kernel(address: int, tiles: "FloatArray", n_tiles: int, repeats: int) -> None:
    for _ in range(repeats):
        call_kernel(address, tiles, n_tiles)


def kernel_contender(kernel: Kernel, u: Array, o: Array) -> Repeat:
    """Our kernel on tiles that are filled already."""
    n_tiles = len(u) // LANES
    tiles = aligned_tiles(kernel.rows, n_tiles, kernel.constant_rows)
    records = tiles.reshape(n_tiles, kernel.rows, STRIDE)
    for k in range(n_tiles):
        lanes = slice(k * LANES, (k + 1) * LANES)
        records[k, : u.shape[1], :LANES] = u[lanes].T
        records[k, u.shape[1] : kernel.first_result, :LANES] = o[lanes].T
    address = kernel.value_and_jacobian_address
    return lambda repeats: _run_kernel(address, tiles, n_tiles, repeats)


def bench(formula: Formula, against: Sequence[str], n: int, rounds: int, folder: Path) -> Row:
    """The bench of one formula on about n random inputs."""
    ours = calculator(formula.name)
    u, o = derivatives.draw(ours.kernel, -(-n // LANES) * LANES, np.random.default_rng(1))
    _, jacobian = ours.values_and_jacobian(u, o)
    derived = derive(formula)
    operations = {"obseq": derived.counts[1]}
    contenders: dict[str, Repeat] = {"obseq": kernel_contender(ours.kernel, u, o)}
    disagreement = {}
    for name in against:
        text, count = _cpp(name, formula, derived)
        if text:
            library = cpp_contenders.build(text, folder)
            made = cpp_contenders.contender(library, name, formula, len(ours.residuals), u, o)
            contenders[name], computed = made.run, made.results[:, :, 1:]
            operations |= count
        else:
            contenders[name], computed = _python(name, formula, u, o)
        disagreement[name] = relative_difference(computed, jacobian)
    timings = race(contenders, rounds)
    return Row(
        formula.name,
        {name: 1e9 * timing.median / len(u) for name, timing in timings.items()},
        {name: ratio(timings[name], timings["obseq"]) for name in against},
        operations,
        disagreement,
    )


def _cpp(name: str, formula: Formula, derived: Derived) -> tuple[str, dict[str, int]]:
    """(text of a C++ contender, its operations); empty for another contender."""
    if name == "rival":
        built = rival.build(formula)
        return cpp_contenders.rival_text(built, formula), {"rival": sum(built.operations.values())}
    return (cpp_contenders.graph_text(derived) if name == "graph" else ""), {}


def _python(name: str, formula: Formula, u: Array, o: Array) -> tuple[Repeat, Array]:
    import python_contenders

    made: tuple[Repeat, Array] = getattr(python_contenders, f"{name}_contender")(formula, u, o)
    return made


def relative_difference(a: Array, b: Array) -> float:
    """Largest difference of two (n, n_residuals, n_unknowns) Jacobians where both are finite."""
    with np.errstate(all="ignore"):
        size = np.abs(b).max(axis=2, keepdims=True, initial=0.0)
        difference = np.abs(a - b) / np.where(size == 0.0, 1.0, size)
    return float(difference[np.isfinite(difference)].max(initial=0.0))


def show(rows: Sequence[Row], against: Sequence[str]) -> None:
    """The table, and the summary when there are several formulas."""
    width = max(len(row.name) for row in rows)
    columns = f"{'formula':<{width}} {'ns':>8} {'operations':>11} {'(rival)':>8} "
    print(columns + "".join(f"{name:>9}" for name in against) + "   (times as long as obseq)")
    for row in rows:
        ratios = "".join(f"{row.ratios[name]:9.2f}" for name in against)
        odd = [name for name in against if row.disagreement[name] > AGREEMENT]
        note = f"  different derivatives: {', '.join(odd)}" if odd else ""
        print(
            f"{row.name:<{width}} {row.nanoseconds['obseq']:8.2f} {row.operations['obseq']:11} "
            f"{row.operations.get('rival', '-'):>8} {ratios}{note}"
        )
    for title, summary in (("median", statistics.median), ("least", min)):
        if len(rows) > 1:
            figures = "".join(f"{summary(row.ratios[name] for row in rows):9.2f}" for name in against)
            print(f"{title:<{width + 30}}{figures}")


def missed(rows: Sequence[Row]) -> list[str]:
    """The targets against the rival that are not reached."""
    ratios = {
        row.name: row.ratios["rival"] for row in rows if "rival" in row.ratios and row.operations["obseq"]
    }
    goals = {name: TARGETS.get(name, LEAST_OF_ALL) for name in ratios}
    found = [
        f"{name} {ratios[name]:.2f} (target {goals[name]})" for name in ratios if ratios[name] < goals[name]
    ]
    if len(ratios) >= WHOLE_CATALOGUE and (median := statistics.median(ratios.values())) < LEAST_MEDIAN:
        found.append(f"median {median:.2f} (target {LEAST_MEDIAN})")
    return found


def to_json(rows: Sequence[Row], arguments: argparse.Namespace) -> str:
    """The table as JSON; ratios have no unit, more is better."""
    content: dict[str, Any] = {"format": "obseq-kernel-bench", "version": 1}
    content |= {"evaluations": arguments.evaluations, "rounds": arguments.rounds}
    content |= {"unit": "nanoseconds of CPU per evaluation", "formulas": [asdict(row) for row in rows]}
    return json.dumps(content, indent=1) + "\n"


def available(wanted: Sequence[str]) -> list[str]:
    """The contenders that this machine can run; says which it cannot."""
    missing = set()
    if not cpp_contenders.COMPILER:
        missing |= {"rival", "graph"}
    if importlib.util.find_spec("jax") is None:
        missing.add("jax")
    for name in sorted(missing.intersection(wanted)):
        print(f"{name}: left out, {'JAX' if name == 'jax' else 'g++'} is not installed", file=sys.stderr)
    return [name for name in wanted if name not in missing]


def main() -> int:
    """Reads the command line, benches, prints and writes the table; returns 1 when a target is missed."""
    parser = command_line(__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="formulas (all of them)")
    parser.add_argument("--against", nargs="+", choices=CONTENDERS, default=["rival", "graph"])
    parser.add_argument("--evaluations", type=int, default=LANES, help="evaluations in a batch")
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the table as JSON")
    parser.add_argument("--build", type=Path, metavar="DIR", help="keep compiled C++ in this folder")
    arguments = parser.parse_args()
    chosen = [f for f in REGISTRY if f.name in arguments.names or not arguments.names]
    if len(chosen) < len(set(arguments.names)):
        parser.error(f"unknown formula among {' '.join(arguments.names)}")
    against = available(arguments.against)
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.build or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        rows = []
        for formula in chosen:
            if formula.unknowns and formula.expressions():
                print(f"\r\033[K{formula.name}", end="", file=sys.stderr, flush=True)
                rows.append(bench(formula, against, arguments.evaluations, arguments.rounds, folder))
    print("\r\033[K", end="", file=sys.stderr)
    show(rows, against)
    if arguments.json:
        arguments.json.write_text(to_json(rows, arguments), "utf-8")
    if failures := missed(rows):
        print("below the target: " + "; ".join(failures))
    return 1 if failures else 0


if __name__ == "__main__":
    raise SystemExit(main())
