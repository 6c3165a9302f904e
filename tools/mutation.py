"""How much of what decides is tested: changed code must make tests fail (mutation testing, by cosmic-ray).

Each room has its folders. A seeded sample of the changes that cosmic-ray knows is tried in a copy of the
checkout; annotations and decorators are left alone. `tools/covered_by.py` has found which tests run a line:
those are asked, the quick ones first, then those that belong to the module. Each change is tried in a process
that has the libraries already. What survives is a test to write, or code to delete.
It needs `obseq[mutation]`.

Example:
    python tools/covered_by.py tests/diagnosis tests/survey
    python tools/mutation.py --sample 60 diagnosis
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from collections import Counter
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from changes import ROOMS, ROOT, Change, changed, difference, place, runs, sample, statement
from covered_by import Covered

if TYPE_CHECKING:
    from collections.abc import Iterable

WIDE = ("test_stale_code", "test_architecture")
"""Tests that name modules of all rooms, whatever these do."""
MODULE_SHARE = 0.4
"""Of the time of a change, for tests of its module that are not known to run its line."""
MEMORY = 6 << 30
"""Bytes that a changed program may take."""
LIBRARIES = "numpy scipy.sparse.linalg scipy.spatial scipy.stats numba pyproj hypothesis pytest msgspec"
"""What most tests import: the process that tries changes has it before it is asked."""
LOADED = "ignore:Module already imported:pytest.PytestAssertRewriteWarning"
"""What pytest says of them."""


class Outcome(NamedTuple):
    """What the tests said of a change.

    Attributes:
        change: that was tried.
        end: "killed", "stopped" (its tests took far longer than they do), "survived" or "not covered".
        by: the test that failed, if one did.
        tests: how many were asked.
        text: the line before and after.
    """

    change: Change
    end: str
    by: str
    tests: int
    text: str


def main() -> int:
    """Tries a sample of each room that is named, and prints the scores."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    known = [*ROOMS, "rest"]
    parser.add_argument("rooms", nargs="*", choices=[*known, []], metavar="ROOM", help=", ".join(known))
    parser.add_argument("--sample", type=int, default=100, help="changes that are tried in each room")
    parser.add_argument("--seed", type=int, default=0, help="of the sample")
    parser.add_argument("--seconds", type=float, default=30.0, help="of tests, for each change")
    parser.add_argument("--only", default="", help="try only those whose place has this pattern")
    arguments = parser.parse_args()
    covered = Covered()
    with tempfile.TemporaryDirectory() as folder:
        copy = copied(Path(folder))
        covered.forget_others(tests_there(copy, covered))
        for name in arguments.rooms or known:
            found = sample(name, arguments.sample, arguments.seed)
            asked_for = [one for one in found if re.search(arguments.only, place(one))]
            report(name, tried(asked_for, copy, covered, arguments.seconds))
    return 0


def report(name: str, outcomes: list[Outcome]) -> None:
    """Prints the score of a room, and what survived."""
    from scipy.stats import binomtest

    ends = Counter(one.end for one in outcomes)
    killed, count = ends["killed"] + ends["stopped"], len(outcomes)
    if not count:
        print(f"{name}: nothing to try")
        return
    low, high = binomtest(killed, count).proportion_ci()
    others = ", ".join(f"{number} {end}" for end, number in sorted(ends.items()))
    score = f"{killed} of {count}, {killed / count:.0%} (95 %: {low:.0%} to {high:.0%})"
    print(f"{name}: {score}; {others}", flush=True)
    for one in sorted(outcomes):
        if one.end not in ("killed", "stopped"):
            print(f"  {place(one.change)}: {one.end}, {one.tests} tests\n{one.text}", flush=True)


def copied(folder: Path) -> Path:
    """The checkout, as it is, in another folder."""
    made = folder / ROOT.name
    command = ["git", "ls-files", "-co", "--exclude-standard"]
    for name in subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.split():
        if (ROOT / name).is_file():
            (made / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, made / name)
    for name in ("formulas", "codegen", "generated"):
        (made / "src" / "obseq" / name).symlink_to(made / name)
    if (ROOT.parent / "shared").exists():
        (folder / "shared").symlink_to((ROOT.parent / "shared").resolve())
    return made


def tests_there(copy: Path, covered: Covered) -> set[str]:
    """Tests that the files of the map hold now."""
    files = sorted({name.partition("::")[0] for name in covered.tests})
    there = [name for name in files if (copy / name).exists()]
    command = [
        sys.executable,
        "-m",
        "pytest",
        "--collect-only",
        "-q",
        "-n",
        "0",
        "-p",
        "no:cacheprovider",
        *there,
    ]
    environment = os.environ | {"PYTHONPATH": str(copy / "src")}
    said = subprocess.run(
        command, cwd=copy, env=environment, capture_output=True, text=True, check=False
    ).stdout
    return set(said.splitlines())


def tried(changes: list[Change], copy: Path, covered: Covered, seconds: float) -> list[Outcome]:
    """What the tests say of each change; a test that fails unchanged too has no say."""
    prepare()
    found = list[Outcome]()
    for change in changes:
        tests = judges(change, covered, seconds)
        known = Counter(one.by for one in found)  # what found others is asked first
        tests.sort(key=lambda name, known=known: -known[name])
        last = outcome(change, copy, covered, tests)
        print(f"{last.end:12}{last.tests:5} {place(change)} {last.by}", file=sys.stderr, flush=True)
        found.append(last)
    wrong = {test for test in {one.by for one in found} - {""} if asked([test], copy, 600.0)[0] != "survived"}
    if wrong:
        print(f"these fail unchanged too, and what they killed is not counted: {' '.join(wrong)}", flush=True)
    return [one for one in found if one.by not in wrong]


def outcome(change: Change, copy: Path, covered: Covered, tests: list[str]) -> Outcome:
    """What the tests say of one change, made in a copy of the checkout."""
    path = copy / change.module
    before, stamp = path.read_text("utf-8"), path.stat()
    after = changed(before, change)
    text = difference(before, after)
    if not tests:
        return Outcome(change, "not covered", "", 0, text)
    path.write_text(after, encoding="utf-8")
    try:
        end, by = asked(tests, copy, 30.0 + 4.0 * sum(map(covered.seconds, tests)))
    finally:
        path.write_text(before, encoding="utf-8")
        os.utime(path, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
    if end == "killed" and not by and asked(tests, copy, 600.0) != ("survived", ""):
        raise SystemExit(f"The tests of {change.module} do not run unchanged: measure them anew.")
    return Outcome(change, end, by, len(tests), text)


def judges(change: Change, covered: Covered, seconds: float) -> list[str]:
    """Tests that run a changed line, then others of its module: the quick ones first, up to a time."""
    by_line = _by_line(covered, change.module)
    first, last, is_called = statement(change)
    lines = range(first, last + 1) if is_called else [line for line in by_line if runs(change.module, line)]
    near = set[str]().union(*(by_line.get(line, ()) for line in lines))
    files = {*_tests_of(change.module), *(name.partition("::")[0] for name in near)}
    return [
        *_quickest(near, covered, seconds),
        *_quickest(covered.of_files(files) - near, covered, MODULE_SHARE * seconds),
    ]


def _quickest(tests: Iterable[str], covered: Covered, seconds: float) -> list[str]:
    chosen, total = [], 0.0
    for name in sorted(tests, key=lambda name: (covered.seconds(name), name)):
        total += covered.seconds(name)
        if chosen and total > seconds:
            break
        chosen.append(name)
    return chosen


@cache
def _by_line(covered: Covered, module: str) -> dict[int, set[str]]:
    return covered.by_line(module)


def prepare() -> None:
    """Imports what tests need, for the processes that are forked from this one."""
    os.environ |= {"OPENBLAS_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1", "HYPOTHESIS_NO_PLUGINS": "1"}
    sys.dont_write_bytecode = True
    for name in LIBRARIES.split():
        __import__(name)


def asked(tests: list[str], copy: Path, seconds: float) -> tuple[str, str]:
    """Whether tests fail, and which: run in a process of its own, with a limit of its processor's seconds."""
    temporary = Path(tempfile.mkdtemp(dir="/dev/shm" if Path("/dev/shm").is_dir() else None))
    process = os.fork()
    if not process:
        _ask(tests, copy, temporary, seconds)
    code = _waited(process, 10.0 * seconds + 300.0)
    noted = temporary / "failed"
    by = noted.read_text("utf-8") if noted.exists() else ""
    shutil.rmtree(temporary, ignore_errors=True)
    if code == 0:
        return "survived", ""
    return ("stopped" if code is None or code == -signal.SIGXCPU else "killed"), by


def _waited(process: int, seconds: float) -> int | None:
    """The code with which a process ends; nothing if it had to be ended."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        found, status = os.waitpid(process, os.WNOHANG)
        if found:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.05)
    os.killpg(process, signal.SIGKILL)
    os.waitpid(process, 0)
    return None


def _ask(tests: list[str], copy: Path, temporary: Path, seconds: float) -> None:
    """Runs tests, and ends this process."""
    code = 1
    try:
        os.setsid()
        resource.setrlimit(resource.RLIMIT_CPU, (int(seconds), int(seconds) + 5))
        resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
        nothing = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(nothing, stream)
        os.environ |= {"PYTHONPATH": str(copy / "src"), "TMPDIR": str(temporary)}
        tempfile.tempdir = str(temporary)
        sys.path.insert(0, str(copy / "src"))
        os.chdir(copy)
        import pytest

        options = ["-q", "-x", "-n", "0", "-p", "no:cacheprovider", "-W", LOADED, *tests]
        code = int(pytest.main(options, plugins=[Failed(temporary / "failed")]))
    finally:
        os._exit(code)


class Failed:
    """A plugin of pytest that notes the test that failed."""

    def __init__(self, file: Path) -> None:
        self.file = file

    def pytest_runtest_logreport(self, report: object) -> None:
        """Writes its name."""
        if getattr(report, "failed", False):
            self.file.write_text(getattr(report, "nodeid", ""), encoding="utf-8")


@cache
def _texts() -> dict[str, str]:
    found = sorted((ROOT / "tests").rglob("test_*.py"))
    return {path.relative_to(ROOT).as_posix(): path.read_text("utf-8") for path in found}


@cache
def _tests_of(module: str) -> tuple[str, ...]:
    """Files of tests of a module: of the table, of its name or its room's, and those that import it."""
    table = tomllib.loads((ROOT / "tests" / "modules.toml").read_text("utf-8"))
    place = Path(module).relative_to("src/obseq").with_suffix("")
    begin = tuple(f"test_{name}{end}" for name in (place.name, place.parent.name) for end in ("_", "."))
    named = re.compile(rf"\bobseq\.{'.'.join(place.parts)}\b")
    found = [table[name]] if (name := f"{place.as_posix()}.py") in table else []
    for name, text in _texts().items():
        own = Path(name)
        if own.name.startswith(begin) or (own.stem not in WIDE and named.search(text)):
            found.append(name)
    return tuple(dict.fromkeys(found))


if __name__ == "__main__":
    sys.exit(main())
