#!/usr/bin/env python3
"""How long the suite takes: CPU seconds, and how often a fixed load would fit into them.

    tools/suite_time.py [ARGUMENTS OF PYTEST]

Machines differ, and one machine has slow minutes. So a fixed Python and NumPy load is measured before and
after the tests; the ratio is what compares. `tools/benchmarks/suite_time.json` has that of the whole suite,
which may not grow by more than a tenth by what is added. `--write` as first argument writes it down.
"""

import json
import os
import resource
import subprocess
import sys
import time
from pathlib import Path

os.environ["OPENBLAS_NUM_THREADS"] = "1"

import numpy as np

TOOLS = Path(__file__).resolve().parent
WRITTEN = TOOLS / "benchmarks" / "suite_time.json"
GROWTH = 1.1
SIZE, SOLVES, WORDS = 300, 60, 400_000


def yardstick() -> float:
    """CPU seconds of a fixed load: words counted in Python, systems solved and sorted in NumPy."""
    begun = time.process_time()
    counts: dict[str, int] = {}
    for number in range(WORDS):
        word = f"P{number * 7919 % 10007}"
        counts[word] = counts.get(word, 0) + len(word)
    matrix = np.random.default_rng(1).normal(size=(SIZE, SIZE)) + SIZE * np.eye(SIZE)
    for _ in range(SOLVES):
        matrix = np.linalg.inv(matrix) * SIZE
        np.sort(matrix, axis=None)
    return time.process_time() - begun


def children() -> float:
    """CPU seconds of all processes that were waited for, and of theirs."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def main(arguments: list[str]) -> int:
    """Runs the tests between two yardsticks; the exit code is theirs, or 1 where they take too long."""
    writes = arguments[:1] == ["--write"]
    before, begun = yardstick(), children()
    code = subprocess.run([TOOLS / "test", *arguments[writes:]], check=False).returncode
    seconds, stick = children() - begun, (before + yardstick()) / 2.0
    ratio = seconds / stick
    print(f"suite: {seconds:.0f} CPU seconds, {ratio:.0f} yardsticks of {stick:.3f} s")
    if writes:
        WRITTEN.write_text(json.dumps({"yardsticks": round(ratio)}) + "\n", encoding="utf-8")
    if arguments or not WRITTEN.exists():
        return code
    most = GROWTH * json.loads(WRITTEN.read_text("utf-8"))["yardsticks"]
    print(f"at most {most:.0f} were announced")
    return code or int(ratio > most)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
