"""How much of what decides is tested: changed code must make tests fail (mutation testing, by cosmic-ray).

Each room has its folders and the tests that judge it. A seeded sample of the changes that cosmic-ray knows is
tried in a copy of the checkout; annotations and docstrings are left alone, for nothing runs them. What
survives is a test to write, or code to delete. It needs `obseq[mutation]`.

Example:
    python tools/mutation.py --sample 60 diagnosis
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator

    from cosmic_ray.work_item import WorkItem

ROOT = Path(__file__).parents[1]
WIDE = ("test_stale_code", "test_architecture")
"""Tests that name modules of all rooms, whatever these do."""
TIMEOUT = 400.0
"""Seconds after which the tests of a change are stopped: it is killed."""
SAME = ("_Eq_Is", "_NotEq_IsNot", "_BitAnd_Mul", "_BitOr_Add")
"""Changes that change nothing: of small numbers and names the first two, of truth values the others."""


class Room(NamedTuple):
    """What is judged together.

    Attributes:
        code: folders or files.
        tests: that judge them, beside those of each module.
    """

    code: tuple[str, ...]
    tests: tuple[str, ...]


ROOMS = {
    "diagnosis": Room(("src/obseq/diagnosis",), ("tests/diagnosis",)),
    "images": Room(
        ("src/obseq/images/causes", "src/obseq/images/diagnosing"),
        (
            "tests/images/test_block_model.py",
            "tests/images/test_causes.py",
            "tests/images/test_large_blocks.py",
        ),
    ),
    "causes": Room(("src/obseq/survey/causes",), ("tests/survey/test_planted_slips.py",)),
    "diagnosing": Room(
        ("src/obseq/survey/diagnosing",),
        ("tests/survey/test_planted_slips.py", "tests/survey/test_gross_errors.py"),
    ),
    "rest": Room(("src/obseq",), ()),
}


def main() -> int:
    """Tries a sample of each room that is named, and prints the scores."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("rooms", nargs="*", choices=[*ROOMS, []], metavar="ROOM", help=", ".join(ROOMS))
    parser.add_argument("--sample", type=int, default=100, help="changes that are tried in each room")
    parser.add_argument("--seed", type=int, default=0, help="of the sample")
    arguments = parser.parse_args()
    for name in arguments.rooms or ROOMS:
        with tempfile.TemporaryDirectory() as folder:
            killed, survived = tried(ROOMS[name], copied(Path(folder)), arguments.sample, arguments.seed)
        print(f"{name:12}{killed:4} of {killed + len(survived)} killed", flush=True)
        for place in survived:
            print(f"    {place}")
    return 0


def copied(folder: Path) -> Path:
    """The checkout, as it is, in another folder."""
    made = folder / ROOT.name
    command = ["git", "ls-files", "-co", "--exclude-standard"]
    for name in subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.split():
        if (ROOT / name).is_file():
            (made / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, made / name)
    for name in ("formulas", "codegen", "generated"):
        (made / "src" / "obseq" / name).symlink_to(made / name)
    if (ROOT.parent / "shared").exists():
        (folder / "shared").symlink_to((ROOT.parent / "shared").resolve())
    return made


def tried(room: Room, checkout: Path, count: int, seed: int) -> tuple[int, list[str]]:
    """How many of a sample of changes made tests fail, and where the others are."""
    from cosmic_ray.work_db import use_db
    from cosmic_ray.work_item import TestOutcome

    code = room.code if room.tests else _modules(checkout, room, count, seed)
    config, session = checkout / "cosmic-ray.toml", checkout / "session.sqlite"
    environment = os.environ | {"PYTHONPATH": str(checkout / "src"), "OPENBLAS_NUM_THREADS": "1"}

    def run(command: str, tests: tuple[str, ...], *more: str) -> int:
        line = f"{sys.executable} -m pytest -q -x -n 0 -p no:cacheprovider {' '.join(tests)}"
        config.write_text(
            f"[cosmic-ray]\nmodule-path = {list(code)!r}\ntimeout = {TIMEOUT}\n"
            f'excluded-modules = []\ntest-command = "{line}"\n[cosmic-ray.distributor]\nname = "local"\n'
        )
        whole = [sys.executable, "-m", "cosmic_ray.cli", command, str(config), *more]
        return subprocess.run(whole, cwd=checkout, env=environment, check=False).returncode

    run("init", room.tests, str(session))
    judged_by: dict[tuple[str, ...], list[WorkItem]] = {}
    with use_db(session) as base:
        for item in _sample(checkout, list(base.work_items), count, seed):
            tests = dict.fromkeys((*_tests_of(checkout, _file(item)), *room.tests))
            judged_by.setdefault(tuple(tests), []).append(item)
    killed, survived = 0, list[str]()
    for tests, items in judged_by.items():
        if run("baseline", tests):
            print(f"not tried, for they fail or take too long unchanged: {' '.join(tests)}", flush=True)
            continue
        with use_db(session) as base:
            base.clear()
            base.add_work_items(items)
        run("exec", tests, str(session))
        with use_db(session) as base:
            outcomes = {job: result.test_outcome for job, result in base.results}
        survived += [_place(item) for item in items if outcomes[item.job_id] is TestOutcome.SURVIVED]
        killed += sum(outcome is TestOutcome.KILLED for outcome in outcomes.values())
    return killed, sorted(survived)


def _modules(checkout: Path, room: Room, count: int, seed: int) -> list[str]:
    """Modules that files of tests judge, at random by size: listing the changes of all takes an hour."""
    found = [path for folder in room.code for path in sorted((checkout / folder).rglob("*.py"))]
    own = [path for path in found if not any(part.is_symlink() for part in path.parents)]
    names = [path.relative_to(checkout).as_posix() for path in own]
    tested = [name for name in names if _tests_of(checkout, name)]
    sizes = [(checkout / name).stat().st_size for name in tested]
    return sorted(set(random.Random(seed).choices(tested, sizes, k=count)))


def _tests_of(checkout: Path, module: str) -> tuple[str, ...]:
    """Tests of a module: those of the table, of its name or its room's, and those that import it."""
    table = tomllib.loads((checkout / "tests" / "modules.toml").read_text(encoding="utf-8"))
    place = Path(module).relative_to("src/obseq").with_suffix("")
    begin = tuple(f"test_{name}{end}" for name in (place.name, place.parent.name) for end in ("_", "."))
    named = re.compile(rf"\bobseq\.{'.'.join(place.parts)}\b")
    found = [checkout / table[name]] if (name := f"{place.as_posix()}.py") in table else []
    found += [
        path
        for path in sorted((checkout / "tests").rglob("test_*.py"))
        if path.name.startswith(begin)
        or (path.stem not in WIDE and named.search(path.read_text(encoding="utf-8")))
    ]
    return tuple(path.relative_to(checkout).as_posix() for path in dict.fromkeys(found))


def _place(item: WorkItem) -> str:
    (change,) = item.mutations
    line = f"{change.module_path}:{change.start_pos[0]}:{change.start_pos[1]}"
    return f"{line} {change.operator_name.removeprefix('core/')} {change.occurrence}"


def _sample(checkout: Path, items: list[WorkItem], count: int, seed: int) -> list[WorkItem]:
    """Changes of what runs, in the order of their places."""
    files = {_file(item) for item in items}
    idle = {name: list(_idle((checkout / name).read_text("utf-8"))) for name in files}
    live = [
        item
        for item in items
        if not item.mutations[0].operator_name.endswith(SAME)
        and not any(first <= item.mutations[0].start_pos < last for first, last in idle[_file(item)])
    ]
    live.sort(key=_place)
    return random.Random(seed).sample(live, min(count, len(live)))


def _file(item: WorkItem) -> str:
    return str(item.mutations[0].module_path)


def _idle(text: str) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
    """Where annotations, imports for them, and decorators stand: first and last place of each."""
    for node in ast.walk(ast.parse(text)):
        parts: list[ast.AST | None] = []
        if isinstance(node, ast.FunctionDef):
            parts = [node.returns, *node.decorator_list]
        elif isinstance(node, ast.ClassDef):
            parts = [*node.decorator_list, *node.bases]
        elif isinstance(node, ast.arg | ast.AnnAssign):
            parts = [node.annotation]
        elif isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING":
            parts = [node]
        for part in parts:
            if isinstance(part, ast.expr | ast.stmt):
                first = part.lineno, part.col_offset
                yield first, (part.end_lineno or 0, part.end_col_offset or 0)


if __name__ == "__main__":
    sys.exit(main())
