"""The figures of docs/scaling.md, by one command: how a network grows, and what a second thread brings.

    python tools/benchmarks/scaling.py                   both tables, on the screen
    python tools/benchmarks/scaling.py --write           and in docs/scaling.md, between its marks
    python tools/benchmarks/scaling.py --points 10000 1000000 --shared-points 100000 --rounds 5

Each size and each number of threads is measured in a process of its own. The table of growth has seconds of
the processor, that of threads seconds of the clock: run it where nothing else runs. With its own sizes it
takes some three minutes on two quiet cores; a million points take three more, and nine GB.
"""

import argparse
import json
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from command import command_line

HERE = Path(__file__).resolve().parent
PAGE = HERE.parents[1] / "docs" / "scaling.md"
POINTS = (10_000, 30_000, 100_000, 300_000)
SHARED_POINTS = 100_000
BLOCK = "100x30000x150000"
GAIN = 1.3
"""Times as fast with two threads, from which on nothing is to be explained."""

Figures = dict[str, Any]


@dataclass(frozen=True)
class Line:
    """A line of the table of growth: its name, how it is read from the figures of a size, and written."""

    name: str
    read: Callable[[Figures], float]
    form: Callable[[float], str]


def seconds_of(phase: str) -> Callable[[Figures], float]:
    """Reads the seconds of the processor of a phase of `bench_network`."""
    return lambda figures: float(figures["seconds"][phase]["cpu"])


def rounded(value: float) -> str:
    """Two digits, as figures that differ from run to run deserve."""
    digits = max(0, 1 - math.floor(math.log10(value))) if value > 0.0 else 0
    return f"{value:,.{digits}f}"


def counted(value: float) -> str:
    """A number of things."""
    return f"{value:,.0f}"


GROWTH = (
    Line("unknowns", lambda f: float(f["unknowns"]), counted),
    Line("observations", lambda f: float(f["observations"]), counted),
    Line("entries of the factor, millions", lambda f: f["nnz_factor"] / 1e6, rounded),
    Line("operations of the factorisation, 10^9", lambda f: float(f["gigaflop"]), rounded),
    Line("unknowns and equations, once", seconds_of("unknowns and equations"), rounded),
    Line("pattern and positions, once", seconds_of("pattern and positions"), rounded),
    Line("symbolic analysis, once", seconds_of("symbolic analysis"), rounded),
    Line("assembly, each iteration", seconds_of("assembly"), rounded),
    Line("factorisation, each iteration", seconds_of("factorisation"), rounded),
    Line("solution, each iteration", seconds_of("solution"), rounded),
    Line("all standard deviations, once", seconds_of("all standard deviations"), rounded),
    Line("peak of memory, GB", lambda f: f["peak_mb"] / 1024, rounded),
)

FROM_FILES = {
    "read": "text, line by line, to columns: one thread of Python",
    "initial values": "each point from those before it: one thread",
    "gross errors": "observations one after the other with what surrounds them: one thread",
    "results": "names and texts: one thread of Python",
}
"""Phases of `Network` that are not shared, and why."""

WHY = {
    "unknowns and equations": "copies into columns: one thread",
    "pattern and positions": "sorting, once: one thread",
    "symbolic analysis": "a walk over the graph, once: one thread",
    "solution": "reads each number of the factor once: memory",
    "residuals and cost": "short: the evaluation is shared, NumPy's sums are not",
    "block: factorisation": "below 800 unknowns one thread is as fast",
    "block: solution": "short: one thread",
}
"""Why phases of the other benches do not gain, or little."""


def network_figures(points: int, threads: int, rounds: int) -> Figures:
    """Figures of `bench_network` for a survey, in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "figures.json"
        options = ("--points", points, "--threads", threads, "--rounds", rounds, "--json", target)
        command = [sys.executable, HERE / "bench_network.py", *options]
        subprocess.run([*map(str, command)], check=True, capture_output=True)
        found: Figures = json.loads(target.read_text("utf-8"))[0]
    return found


def block_seconds(size: str, threads: int, rounds: int) -> dict[str, float]:
    """Seconds of the phases of an iteration of a block of images, in a process of its own."""
    command = [sys.executable, __file__, "--block-alone", size, str(threads), str(rounds)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    found: dict[str, float] = json.loads(done.stdout)
    return found


def block_phases(size: str, threads: int, rounds: int) -> dict[str, float]:
    """Medians, by the clock, of what an iteration of a block consists of."""
    from bal import bundle, synthetic_problem

    from obseq.leastsquares.solvers.blas import one_blas_thread

    system = bundle(synthetic_problem(*map(int, size.split("x"))), threads=threads)
    analysis = system.analysis(reduced=True)
    equations, solver = analysis.equations, analysis.solver
    spent: dict[str, list[float]] = {}

    def timed(phase: str, work: Callable[..., Any], *arguments: Any) -> Any:
        start = time.perf_counter()
        result = work(*arguments)
        spent.setdefault(f"block: {phase}", []).append(time.perf_counter() - start)
        return result

    with one_blas_thread():
        for _ in range(rounds + 1):
            timed("assembly", equations.collect)
            reduced = timed("elimination of the points", equations.damped, 1e-3)
            timed("factorisation", solver.factor, reduced.values)
            step = timed("solution", solver.solve, -reduced.gradient)
            timed("points found again", equations.extended, step, 1e-3)
            timed("residuals and cost", equations.sums_of_squares)
    return {phase: median(values[1:]) for phase, values in spent.items()}


def survey_seconds(points: int) -> dict[str, float]:
    """Seconds of reading a survey from its files and of its initial values; no threads there."""
    from bench_survey import phases

    phases(500)
    return {f"files: {phase}": seconds for phase, seconds in phases(points).items() if phase in FROM_FILES}


def growth_table(sizes: Sequence[int], figures: Sequence[Figures]) -> str:
    """The table of growth; the exponent is that between the first and the last size."""
    head = ["points", *(f"{size:,}" for size in sizes), "grows as"]
    lines = [head, ["---"] * len(head)]
    for line in GROWTH:
        found = [line.read(each) for each in figures]
        power = math.log(found[-1] / found[0]) / math.log(sizes[-1] / sizes[0]) if len(sizes) > 1 else 1.0
        lines.append([line.name, *map(line.form, found), f"n^{power:.2f}"])
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def threads_table(alone: Mapping[str, float], shared: Mapping[str, float]) -> str:
    """The table of threads; a phase that is not shared has no second figure."""
    why = {f"files: {phase}": reason for phase, reason in FROM_FILES.items()} | WHY
    lines = [["seconds", "one thread", "two threads", "times as fast", "why not more"], ["---"] * 5]
    for phase, seconds in alone.items():
        gain = seconds / shared[phase] if phase in shared else 1.0
        second = rounded(shared[phase]) if phase in shared else "-"
        reason = why.get(phase, "threads share the way to memory") if gain < GAIN else ""
        lines.append([phase, rounded(seconds), second, f"{gain:.2f}", reason])
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def wall(figures: Figures) -> dict[str, float]:
    """Seconds of the clock of the phases of a network that come more than once, and of the first ones."""
    phases = figures["seconds"].items()
    return {phase: spent["wall"] for phase, spent in phases if not phase.endswith(", first")}


def written(text: str, name: str, table: str, tool: str = "scaling.py") -> str:
    """The page with a table between its marks.

    Raises:
        ValueError: the marks are not there.
    """
    begin, end = f"<!-- {name}: written by tools/benchmarks/{tool} -->", f"<!-- end of {name} -->"
    before, found, rest = text.partition(begin)
    _, closed, after = rest.partition(end)
    if not (found and closed):
        raise ValueError(f"{PAGE.name} has no marks for {name}")
    return f"{before}{begin}\n{table}\n{end}{after}"


def arguments() -> argparse.Namespace:
    """What the command line asks for."""
    parser = command_line(__doc__)
    parser.add_argument("--points", type=int, nargs="+", default=POINTS, help="sizes of the table of growth")
    parser.add_argument("--shared-points", type=int, default=SHARED_POINTS, help="size of that of threads")
    parser.add_argument("--block", default=BLOCK, metavar="CAMERASxPOINTSxOBSERVATIONS")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--write", action="store_true", help="write the tables in docs/scaling.md")
    parser.add_argument("--block-alone", nargs=3, metavar=("SIZE", "THREADS", "ROUNDS"))
    return parser.parse_args()


def main() -> None:
    """Measures, prints, writes."""
    options = arguments()
    if options.block_alone:
        size, threads, rounds = options.block_alone
        print(json.dumps(block_phases(size, int(threads), int(rounds))))
        return
    sizes = sorted(options.points)
    growth = growth_table(sizes, [network_figures(size, 1, options.rounds) for size in sizes])
    print(growth, flush=True)
    both = [
        wall(network_figures(options.shared_points, threads, options.rounds))
        | block_seconds(options.block, threads, options.rounds)
        for threads in (1, 2)
    ]
    threads_gain = threads_table(both[0] | survey_seconds(options.shared_points // 10), both[1])
    print(threads_gain)
    if options.write:
        page = written(written(PAGE.read_text("utf-8"), "growth", growth), "threads", threads_gain)
        PAGE.write_text(page, "utf-8")


if __name__ == "__main__":
    main()
