"""The benches as one page: how many times as fast as its rival each part is, in one table and one JSON file.

Runs the benches that have a rival on this machine, one after the other, and leaves out those whose rival is
not here. All figures are ratios of CPU time (with two threads, of the clock) in interleaved rounds: what is
above 1 is faster than the rival.
With `--baseline`, the file of an earlier run, says what has become slower by more than noise; returns 1 then.

    python tools/benchmarks/page.py --quick
    python tools/benchmarks/page.py --json page.json --baseline before.json
"""

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from command import command_line

FOLDER = Path(__file__).parent
TRAFALGAR = FOLDER.parents[2] / "shared" / "data" / "bal-trafalgar-21" / "problem-21-11315-pre.txt"
FEW = ("Dist3D", "TopoHz", "BlocRigid", "EqColinearityCamPPC_Stenope_Dist_Rad3_Dec1_XY1")
SYNTHETIC = "50x10000x40000", "100x30000x150000", "40x100000x400000", "200x100000x500000"
NOISE = 0.15
"""Share by which ratios differ from run to run."""

GENERATED = "the original's way in C++"
START = "bench_start.py"


@dataclass(frozen=True)
class Row:
    """One line of the page.

    Attributes:
        what: What is timed.
        rival: Against what.
        times_as_fast: The rival's time over ours.
        wanted: What it should be at least; None where nothing is asked.
    """

    what: str
    rival: str
    times_as_fast: float
    wanted: float | None = None


@dataclass(frozen=True)
class Bench:
    """A bench: its file, its arguments in a whole run and in a quick one, and how its JSON becomes rows."""

    file: str
    rows: Callable[[Any], Iterable[Row]]
    whole: tuple[str, ...] = ()
    quick: tuple[str, ...] = ()

    def run(self, is_quick: bool, folder: Path, installed: str) -> list[Row]:
        """Runs it in a process of its own; no rows when it cannot run here, and why on standard error."""
        target = folder / f"{self.file}.json"
        command = [sys.executable, str(FOLDER / self.file), *(self.quick if is_quick else self.whole)]
        if self.file == START:
            command += ["--python", installed]
        done = subprocess.run([*command, "--json", str(target)], capture_output=True, text=True, check=False)
        if not target.exists():
            reason = (done.stderr or done.stdout).strip().splitlines()[-1:]
            print(f"{self.file}: left out: {' '.join(reason)}", file=sys.stderr)
            return []
        rows = list(self.rows(json.loads(target.read_text("utf-8"))))
        if not rows:
            print(f"{self.file}: its rival is not installed here", file=sys.stderr)
        return rows


def kernels(content: Any) -> Iterator[Row]:
    """Kernels in tiles."""
    ratios = [row["ratios"]["rival"] for row in content["formulas"] if "rival" in row["ratios"]]
    if ratios:
        yield Row(f"kernels in tiles, median of {len(ratios)}", GENERATED, statistics.median(ratios), 8.0)
        yield Row("kernels in tiles, the least", GENERATED, min(ratios), 3.0)


def evaluation(content: Any) -> Iterator[Row]:
    """Public evaluations."""
    rival = f"{GENERATED}, filled and copied"
    for rows, wanted in (("100", 1.5), ("1000", 5.0), ("10000", 3.0), ("100000", 3.0)):
        ratios = [row["ratios"][rows] for row in content]
        yield Row(f"values_and_jacobian, {rows} rows", rival, statistics.median(ratios), wanted)
        if rows == "1000":
            yield Row(f"values_and_jacobian, {rows} rows, the least", rival, min(ratios), 2.0)
        if shared := [row["shared"][rows] for row in content if rows in row["shared"]]:
            what = f"values_and_jacobian, {rows} rows, two threads"
            yield Row(what, rival, statistics.median(shared), wanted)


def small(content: Any) -> Iterator[Row]:
    """Small systems."""
    rival = 'scipy least_squares(method="lm"), derivatives given'
    for row, wanted in zip(content, (1.5, 2.0, 10.0), strict=True):
        yield Row(f"whole solution of {row['unknowns']} unknowns", rival, 1.0 / row["ratio"], wanted)
    for row in content:
        yield Row(f"1,000 systems of {row['unknowns']} unknowns as one", rival, row["together"], 1.5)


def bundles(content: Any) -> Iterator[Row]:
    """Bundle adjustments."""
    for name, figures in content.items():
        if "ratio" in figures:
            rival = f"Ceres, {figures['solver']}"
            yield Row(f"iteration of {name}", rival, 1.0 / figures["ratio"], 1.0 / 0.6)
            yield Row(f"whole of {name}", rival, figures["whole"], 1.8)
            yield Row(f"to the same cost, {name}", rival, figures["same"], 1.8)
            yield Row(f"memory of {name}", rival, figures["memory"], 1.0 / 1.1)
    wholes = [figures["whole"] for figures in content.values() if "whole" in figures]
    if len(wholes) > 1:
        yield Row(f"whole, median of {len(wholes)}", "Ceres", statistics.median(wholes), 2.5)


def solvers(content: Any) -> Iterator[Row]:
    """Sparse factorisation."""
    for problem in content["problems"]:
        for phase, against in problem["ratios"].items():
            if isinstance(against, dict) and (ratio := against.get("pardiso")):
                yield Row(f"{phase}, {problem['problem']}", "MKL PARDISO", 1.0 / ratio, 1.2)


def posegraphs(content: Any) -> Iterator[Row]:
    """Pose graphs."""
    for name, figures in content.items():
        if "ratio" in figures:
            yield Row(f"start and solution of {name}", "GTSAM", figures["ratio"], 1.3)
    ratios = [figures["ratio"] for figures in content.values() if "ratio" in figures]
    if ratios:
        yield Row("start and solution, median", "GTSAM", statistics.median(ratios), 1.6)


def start(content: Any) -> Iterator[Row]:
    """Networks as processes."""
    for what, wanted in (("4 points", 1.6), ("1000 points", 5.0)):
        yield Row(f"{what}, files to results", 'python -c "import numpy"', 1.0 / content[what], 1.0 / wanted)


def blocks(content: Any) -> Iterator[Row]:
    """Blocks of images."""
    for name, figures in content.items():
        yield Row(f"objects, {name}", "the engine by hand", 1.0 / figures["ratio"], 1.0 / 1.05)


BENCHES = (
    Bench("bench_kernels.py", kernels, ("--against", "rival"), (*FEW, "--against", "rival")),
    Bench("bench_evaluation.py", evaluation, (), (*FEW, "--rounds", "5")),
    Bench("bench_small.py", small, ("--jacobian",), ("--jacobian", "--rounds", "5")),
    Bench("bench_solvers.py", solvers, ("survey-10k", "survey-100k"), ("survey-10k", "--rounds", "3")),
    Bench("bench_posegraph.py", posegraphs, (), ("--rounds", "3")),
    Bench(START, start, (), ("--rounds", "5")),
    Bench(
        "bench_bundle.py",
        bundles,
        (str(TRAFALGAR), "--threads", "1", "2"),
        (str(TRAFALGAR), "--rounds", "3"),
    ),
    Bench(
        "bench_bundle.py",
        bundles,
        ("--synthetic", *SYNTHETIC, "--threads", "1", "2", "--rounds", "5"),
        ("--synthetic", SYNTHETIC[0], "--rounds", "3"),
    ),
    Bench("bench_blocks.py", blocks, (), ("--points", "20000", "--rounds", "3")),
)


def show(rows: Iterable[Row], before: dict[str, float]) -> None:
    """Prints rows of the table."""
    for row in rows:
        wanted = f"{row.wanted:8.2f}" if row.wanted else " " * 8
        mark = " " if row.wanted is None or row.times_as_fast >= row.wanted else "*"
        former = f"{before[row.what]:9.2f}" if row.what in before else ""
        print(f"{row.what:52}{row.rival:48}{row.times_as_fast:13.2f}{mark}{wanted}{former}", flush=True)


def rows_of(benches: Iterable[Bench], quick: bool, installed: str, before: dict[str, float]) -> list[Row]:
    """What the benches find, each run in a folder of its own, and printed as it ends."""
    print(f"{'':52}{'rival':48}{'times as fast':>14}{'wanted':>8}" + (f"{'before':>9}" if before else ""))
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder:
        for number, bench in enumerate(benches):
            (place := Path(folder) / str(number)).mkdir()
            found = bench.run(quick, place, installed)
            show(found, before)
            rows += found
    return rows


def asked() -> argparse.Namespace:
    """What the command line asks for."""
    parser = command_line(__doc__)
    parser.add_argument("--quick", action="store_true", help="few formulas and rounds: some minutes")
    parser.add_argument(
        "--python",
        default=sys.executable,
        metavar="FILE",
        help="Python whose start is timed: of an environment with the wheel, which has its machine code",
    )
    parser.add_argument("--only", nargs="+", default=[], metavar="WORD", help="benches whose file has a word")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the page as JSON")
    parser.add_argument("--baseline", type=Path, metavar="FILE", help="the page of an earlier run")
    return parser.parse_args()


def main() -> int:
    """Reads the command line, runs the benches, prints and writes the page."""
    arguments = asked()
    former = json.loads(arguments.baseline.read_text("utf-8"))["rows"] if arguments.baseline else []
    before = {row["what"]: row["times_as_fast"] for row in former}
    chosen = [b for b in BENCHES if not arguments.only or any(word in b.file for word in arguments.only)]
    rows = rows_of(chosen, arguments.quick, arguments.python, before)
    if arguments.json:
        content = {"format": "obseq-benches", "version": 1, "rows": [asdict(row) for row in rows]}
        arguments.json.write_text(json.dumps(content, indent=1) + "\n", "utf-8")
    slower = [row.what for row in rows if row.times_as_fast < (1 - NOISE) * before.get(row.what, 0.0)]
    if slower:
        print("slower than before: " + "; ".join(slower))
    return 1 if slower else 0


if __name__ == "__main__":
    raise SystemExit(main())
