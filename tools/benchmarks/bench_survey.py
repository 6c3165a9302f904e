"""A survey network from its files to its adjustment at several sizes: seconds by phase, and how they grow.

Also what a script pays before it computes anything: import of obseq, a compiled kernel read from its cache,
and the second run of the demo. The growth of a phase is the exponent p of size^p between the first and the
last size: 1 is linear, 2 would be quadratic.

Example:
    python tools/benchmarks/bench_survey.py --points 2500 10000 40000 --json survey.json
"""

import math
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from command import command_line, write_json

from obseq.compilation import cache
from obseq.kernels import formula_names, load
from obseq.kernels.loading import routine
from obseq.survey import Network

HERE = Path(__file__).parent
FRAME = "RTL*657700*6860700*0*IGNF:LAMB93"


def made_network(folder: Path, n_points: int) -> tuple[Path, Path]:
    """OBS and COR files of a synthetic network, six observations a point."""
    command = [sys.executable, HERE / "make_network.py", "--points", n_points, "--observations", 6 * n_points]
    subprocess.run([*map(str, command), "--out", str(folder)], check=True, capture_output=True)
    return folder / "network.obs", folder / "network.cor"


def phases(n_points: int) -> dict[str, float]:
    """Seconds of each phase of one adjustment."""
    with tempfile.TemporaryDirectory() as folder:
        observations, points = made_network(Path(folder), n_points)
        return dict(Network.read(observations, points, frame=FRAME).adjust().phases)


def start_up() -> dict[str, float]:
    """Seconds before anything is computed."""
    importing = [
        sys.executable,
        "-c",
        "import time; t = time.process_time(); import obseq; print(time.process_time() - t)",
    ]
    imported = subprocess.run(importing, check=True, capture_output=True, text=True).stdout
    return {"import obseq": float(imported), "cached kernel": cached_kernel(), "second demo": second_demo()}


def cached_kernel() -> float:
    """Seconds to read a compiled kernel from its cache: the middle one of a few."""
    spent = []
    for name in formula_names()[::12]:
        symbol = routine(load(name).module, "value_and_jacobian").symbol
        load(name).value_and_jacobian_address  # noqa: B018 (compiled where it is not yet)
        start = time.process_time()
        code = cache.read(symbol)
        spent.append(time.process_time() - start if code else 0.0)
    return sorted(spent)[len(spent) // 2]


def second_demo() -> float:
    """Seconds on the clock of the demo as a command, once its kernels are compiled."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "obseq.cli.main", "demo", "--out", folder]
        subprocess.run(command, check=True, capture_output=True)
        start = time.perf_counter()
        subprocess.run(command, check=True, capture_output=True)
        return time.perf_counter() - start


def main() -> int:
    """Runs the bench, prints the figures and writes them if asked to."""
    parser = command_line(__doc__)
    parser.add_argument("--points", nargs="+", type=int, default=[2500, 10_000, 40_000])
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures as JSON")
    arguments = parser.parse_args()
    starting = start_up()
    phases(min(arguments.points))  # compiles
    sizes = {n: phases(n) for n in sorted(arguments.points)}
    show(starting, sizes)
    write_json(arguments.json, {"start": starting, "sizes": sizes})
    return 0


def show(starting: dict[str, float], sizes: dict[int, dict[str, float]]) -> None:
    """Prints the table."""
    for name, seconds in starting.items():
        print(f"{name:28}{seconds:10.4f} s")
    print(f"\n{'seconds':28}" + "".join(f"{n:>10}" for n in sizes) + f"{'growth':>10}")
    first, last = min(sizes), max(sizes)
    for phase in sizes[first]:
        row = [sizes[n][phase] for n in sizes]
        growth = math.log(row[-1] / row[0]) / math.log(last / first) if last > first else math.nan
        print(f"{phase:28}" + "".join(f"{seconds:10.2f}" for seconds in row) + f"{growth:10.2f}")


if __name__ == "__main__":
    sys.exit(main())
