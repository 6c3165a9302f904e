"""Times `Calculator.values_and_jacobian` on the caller's arrays against the rival's C++, filled and copied.

Both begin with rows of arguments and end with values and Jacobians in arrays that are there (`out=`). The
rival is the original's own way through its calculator (`rival.py`, `rival_calculator.h`; g++ -O3
-march=native): each row is put in two vectors, which are pushed (sizes checked, copied to a slot of a buffer
of at most 256 evaluations by virtual functions), the generated loop runs over the buffer, and its lines are
copied out, all in a loop in C++: only ours pays for a call from Python. A loop without the calculator, which
no user of the original has, is not the rival; nor are its checked accessors, entry by entry, charged to it.
CPU time, interleaved rounds; what two threads would share is done by one under `taskset -c 0`. Without names,
the middle formula of every family.

    python tools/benchmarks/bench_evaluation.py
    python tools/benchmarks/bench_evaluation.py Dist3D BlocRigid --rows 1 100 --json evaluation.json
"""

import ctypes
import statistics
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import cpp_contenders
import numpy as np
import rival
from command import command_line, write_json
from interleaved import Repeat, race, ratio

from obseq.formulas import REGISTRY, Formula
from obseq.kernels import Calculator, calculator, derivatives

ROWS = (1, 100, 1_000, 10_000, 100_000)


@dataclass(frozen=True)
class Row:
    """The result of one formula: nanoseconds of ours per row, and times as long the rival takes, by rows."""

    name: str
    nanoseconds: dict[int, float]
    ratios: dict[int, float]


def one_of_each_family() -> list[Formula]:
    """The middle formula of each family that has unknowns and residuals."""
    families: dict[type[Formula], list[Formula]] = {}
    for formula in REGISTRY:
        if formula.unknowns and formula.expressions():
            families.setdefault(type(formula), []).append(formula)
    return [members[len(members) // 2] for members in families.values()]


def bench(formula: Formula, sizes: Sequence[int], rounds: int, folder: Path) -> Row:
    """The bench of one formula."""
    ours = calculator(formula.name)
    text = cpp_contenders.rival_text(rival.build(formula), formula)
    library = cpp_contenders.build(text, folder)
    nanoseconds, ratios = {}, {}
    for n in sizes:
        timings = race(contenders(ours, formula, n, library), rounds)
        nanoseconds[n] = 1e9 * timings["obseq"].median / n
        ratios[n] = ratio(timings["rival"], timings["obseq"])
    return Row(formula.name, nanoseconds, ratios)


def contenders(ours: Calculator, formula: Formula, n: int, library: ctypes.CDLL) -> dict[str, Repeat]:
    """Both on the same n random inputs."""
    u, o = derivatives.draw(ours.kernel, n, np.random.default_rng(1))
    u, o = np.ascontiguousarray(u), np.ascontiguousarray(o)
    out = ours.values_and_jacobian(u, o)

    def run(repeats: int) -> None:
        for _ in range(repeats):
            ours.values_and_jacobian(u, o, out)

    theirs = cpp_contenders.filled_and_copied(library, "rival", formula, len(ours.residuals), u, o)
    return {"obseq": run, "rival": theirs}


def show(rows: Sequence[Row], sizes: Sequence[int]) -> None:
    """The table: nanoseconds of ours per row, and the rival's time in ours; medians and least ones."""
    width = max(len(row.name) for row in rows)
    print(f"{'rows':<{width}}" + "".join(f"{n:>18,}" for n in sizes) + "   (ns, times as long)")
    for row in rows:
        figures = "".join(f"{row.nanoseconds[n]:11.0f}{row.ratios[n]:7.2f}" for n in sizes)
        print(f"{row.name:<{width}}{figures}")
    for title, summary in (("median", statistics.median), ("least", min)):
        print(f"{title:<{width}}" + "".join(f"{summary(row.ratios[n] for row in rows):18.2f}" for n in sizes))


def main() -> int:
    """Reads the command line, benches, prints and writes the table."""
    parser = command_line(__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="formulas (one of each family)")
    parser.add_argument("--rows", type=int, nargs="+", default=ROWS)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the table as JSON")
    arguments = parser.parse_args()
    chosen = [f for f in REGISTRY if f.name in arguments.names] or one_of_each_family()
    if not cpp_contenders.COMPILER:
        parser.error("the rival needs g++")
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for formula in chosen:
            print(f"\r\033[K{formula.name}", end="", file=sys.stderr, flush=True)
            rows.append(bench(formula, arguments.rows, arguments.rounds, Path(folder)))
    print("\r\033[K", end="", file=sys.stderr)
    show(rows, arguments.rows)
    write_json(arguments.json, [asdict(row) for row in rows])
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
