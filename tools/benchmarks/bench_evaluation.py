"""Times `Calculator.values_and_jacobian` on the caller's arrays against the rival's C++, filled and copied.

Both begin with rows of arguments and end with values and Jacobians in arrays that are there (`out=`). The
rival is the original's own way through its calculator (`rival.py`, `rival_calculator.h`; g++ -O3
-march=native): each row is put in two vectors, which are pushed (sizes checked, copied to a slot of a buffer
of at most 256 evaluations by virtual functions), the generated loop runs over the buffer, and its lines are
copied out, all in a loop in C++: only ours pays for a call from Python. A loop without the calculator, which
no user of the original has, is not the rival; nor are its checked accessors, entry by entry, charged to it.
Neither pays for fresh pages: both write to memory that they have used before.
CPU time, interleaved rounds, both on one processor. Where the public call shares its rows among threads,
a second figure is what users see: both by the clock, ours on two processors; the rival, as the original, on
one. Rows that leave the caches pass through memory whoever evaluates them: the share of our time that NumPy
takes to add up the same arguments and to fill the same results, and do nothing else, is shown as well. Ours
divided by it is as far as any evaluation could go. Without names, the middle formula of every family.

    python tools/benchmarks/bench_evaluation.py
    python tools/benchmarks/bench_evaluation.py Dist3D BlocRigid --rows 1 100 --json evaluation.json
"""

import ctypes
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

import cpp_contenders
import numpy as np
import rival
from command import command_line, write_json
from interleaved import Repeat, race, ratio

from obseq.arrays import FloatArray
from obseq.formulas import REGISTRY, Formula
from obseq.kernels import Calculator, calculator, derivatives
from obseq.kernels.calculator import SHARE
from obseq.pools import processors

ROWS = (1, 100, 1_000, 10_000, 100_000)
SETTLED = 10
"""Evaluations after which all code is loaded, alone and shared."""

LARGE = 10_000
"""Rows whose arguments and results, of most formulas, are more than the second cache holds."""


@dataclass(frozen=True)
class Row:
    """The result of one formula, by rows.

    Attributes:
        name: Name of the formula.
        nanoseconds: Ours, per row, on one processor.
        ratios: Times as long as that the rival takes.
        shared: The same by the clock, ours with two threads; where rows are shared.
        memory: Share of our time that reading the arguments and writing results takes; where rows are many.
    """

    name: str
    nanoseconds: dict[int, float]
    ratios: dict[int, float]
    shared: dict[int, float]
    memory: dict[int, float]


def one_of_each_family() -> list[Formula]:
    """The middle formula of each family that has unknowns and residuals."""
    families: dict[type[Formula], list[Formula]] = {}
    for formula in REGISTRY:
        if formula.unknowns and formula.expressions():
            families.setdefault(type(formula), []).append(formula)
    return [members[len(members) // 2] for members in families.values()]


def library_of(formula: Formula, folder: Path) -> ctypes.CDLL:
    """The rival's code of a formula, compiled."""
    return cpp_contenders.build(cpp_contenders.rival_text(rival.build(formula), formula), folder)


def bench(formula: Formula, sizes: Sequence[int], rounds: int, folder: Path) -> Row:
    """The bench of one formula."""
    ours, library = calculator(formula.name), library_of(formula, folder)
    row = Row(formula.name, {}, {}, {}, {})
    for n in sizes:
        all_of_them = contenders(ours, formula, n, library)
        with one_processor():
            timings = race(all_of_them, rounds)
        row.nanoseconds[n] = 1e9 * timings["obseq"].median / n
        row.ratios[n] = ratio(timings["rival"], timings["obseq"])
        if memory := timings.get("memory"):
            row.memory[n] = ratio(memory, timings["obseq"])
        if n >= 2 * SHARE and processors() > 1:
            all_of_them["obseq"](SETTLED)
            timings = race(all_of_them, rounds, time.perf_counter)
            row.shared[n] = ratio(timings["rival"], timings["obseq"])
    return row


@contextmanager
def one_processor() -> Iterator[None]:
    """Inside, this process has one processor, where the system lets it say so: nothing is shared."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    usual = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(usual)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, usual)


def contenders(ours: Calculator, formula: Formula, n: int, library: ctypes.CDLL) -> dict[str, Repeat]:
    """Both on n random inputs; where these are many, also what only reads and writes the same arrays."""
    u, o = derivatives.draw(ours.kernel, n, np.random.default_rng(1))
    u, o = np.ascontiguousarray(u), np.ascontiguousarray(o)
    out = ours.values_and_jacobian(u, o)

    def run(repeats: int) -> None:
        for _ in range(repeats):
            ours.values_and_jacobian(u, o, out)

    theirs = cpp_contenders.filled_and_copied(library, "rival", formula, len(ours.residuals), u, o)
    found = {"obseq": run, "rival": theirs}
    return found | {"memory": reading_and_writing((u, o), out)} if n >= LARGE else found


def reading_and_writing(given: Sequence[FloatArray], written: Sequence[FloatArray]) -> Repeat:
    """Adds up some arrays, and fills others."""

    def run(repeats: int) -> None:
        for _ in range(repeats):
            for array in given:
                array.sum()
            for array in written:
                array.fill(0.0)

    return run


def columns_of(rows: Sequence[Row], sizes: Sequence[int]) -> list[tuple[str, list[float]]]:
    """Titles and ratios of the columns: more than one for large sizes."""
    columns = []
    for n in sizes:
        for more, ratios in (
            ("", [row.ratios for row in rows]),
            (" shared", [row.shared for row in rows]),
            (" memory", [row.memory for row in rows]),
        ):
            if all(n in each for each in ratios):
                columns.append((f"{n:,}{more}", [each[n] for each in ratios]))
    return columns


def show(rows: Sequence[Row], sizes: Sequence[int]) -> None:
    """The table of the rival's time in ours, with medians and least ones; then ns of ours per row."""
    width, columns = max(len(row.name) for row in rows), columns_of(rows, sizes)
    print(f"{'rows':<{width}}" + "".join(f"{title:>15}" for title, _ in columns) + "   (ns of ours per row)")
    for k, row in enumerate(rows):
        ratios = "".join(f"{ratios[k]:15.2f}" for _, ratios in columns)
        print(f"{row.name:<{width}}{ratios}   {' '.join(f'{row.nanoseconds[n]:.0f}' for n in sizes)}")
    for title, summary in (("median", statistics.median), ("least", min)):
        print(f"{title:<{width}}" + "".join(f"{summary(ratios):15.2f}" for _, ratios in columns))


def main() -> int:
    """Reads the command line, benches, prints and writes the table."""
    parser = command_line(__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="formulas (one of each family)")
    parser.add_argument("--rows", type=int, nargs="+", default=ROWS)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the table as JSON")
    parser.add_argument("--build", type=Path, metavar="DIR", help="keep compiled C++ in this folder")
    arguments = parser.parse_args()
    chosen = [f for f in REGISTRY if f.name in arguments.names] or one_of_each_family()
    if not cpp_contenders.COMPILER:
        parser.error("the rival needs g++")
    rows = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.build or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        for formula in chosen:
            print(f"\r\033[K{formula.name}", end="", file=sys.stderr, flush=True)
            rows.append(bench(formula, arguments.rows, arguments.rounds, folder))
    print("\r\033[K", end="", file=sys.stderr)
    show(rows, arguments.rows)
    write_json(arguments.json, [asdict(row) for row in rows])
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
