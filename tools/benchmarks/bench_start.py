"""CPU time of a network as a process, files to results, against `python -c "import numpy"`: medians of turns.

The network of four points is local; the one of a thousand points is made (`make_network.py`), in Lambert 93,
and writes its result file. What is installed runs: from a source tree kernels come from the cache of numba;
`--python` takes that of an environment with the wheel.

    python tools/benchmarks/bench_start.py [--rounds N] [--json FILE]
"""

import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

from command import command_line, write_json

FOUR = """7 A B 0 0.001
6 A B 100.0008 0.001
3 A B 10.004 0.005
5 A C 349.9989 0.001
6 A C 100.0006 0.001
3 A C 14.146 0.005
7 D B 0 0.001
6 D B 99.9993 0.001
3 D B 14.1362 0.005
5 D C 379.5177 0.001
6 D C 100 0.001
3 D C 22.3657 0.005
"""
POINTS = """1 A 1000 2000 10 0.001 0.001 0.001
0 B 1010 2000 10
0 C 1010 2010 10
1 D 1000 1990 10 0.001 0.001 0.001
"""
FRAME = "RTL*657700*6860700*0*IGNF:LAMB93"


def seconds(command: list[str]) -> float:
    """Seconds of the processor that a process takes."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def commands(folder: Path, python: str = sys.executable) -> dict[str, list[str]]:
    """What is timed, its files written to a folder."""
    (folder / "four.obs").write_text(FOUR)
    (folder / "four.cor").write_text(POINTS)
    maker = str(Path(__file__).with_name("make_network.py"))
    size = ["--points", "1000", "--observations", "6000"]
    subprocess.run([sys.executable, maker, *size, "--out", str(folder)], check=True, capture_output=True)
    adjust = [python, "-m", "obseq", "adjust"]
    files = [str(folder / name) for name in ("four.obs", "four.cor", "network.obs", "network.cor")]
    return {
        "4 points": [*adjust, *files[:2]],
        "1000 points": [*adjust, *files[2:], "--frame", FRAME, "--json", str(folder / "result.json")],
    }


def main() -> None:
    """Reads the command line, benches, prints the times of `import numpy` that each takes."""
    parser = command_line(__doc__)
    parser.add_argument("--rounds", type=int, default=11)
    parser.add_argument("--python", default=sys.executable, metavar="FILE", help="the one that is timed")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures as JSON")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        python = arguments.python
        timed = {"numpy": [python, "-c", "import numpy"]} | commands(Path(folder), python)
        rounds = [
            {what: seconds(command) for what, command in timed.items()} for _ in range(arguments.rounds)
        ]
    figures = {
        what: median(each[what] / each["numpy"] for each in rounds) for what in timed if what != "numpy"
    }
    for what, times in figures.items():
        print(f"{what}: {times:.2f} times import numpy ({median(each[what] for each in rounds):.3f} s)")
    write_json(arguments.json, figures)


if __name__ == "__main__":
    main()
