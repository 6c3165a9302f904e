"""Which changes of the library there are to try, by room: those that cosmic-ray knows of what runs."""

from __future__ import annotations

import ast
import random
from collections import Counter
from functools import cache
from itertools import chain, islice
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

ROOT = Path(__file__).resolve().parents[1]
SAME = ("_Eq_Is", "_NotEq_IsNot", "_BitAnd_Mul", "_BitOr_Add")
"""Changes that change nothing: of small numbers and names the first two, of truth values the others."""

ROOMS = {
    "diagnosis": ("src/obseq/diagnosis",),
    "causes": ("src/obseq/survey/causes",),
    "diagnosing": ("src/obseq/survey/diagnosing",),
    "images": ("src/obseq/images/causes", "src/obseq/images/diagnosing"),
    "joint": ("src/obseq/joint/causes.py",),
    "verdict": ("src/obseq/report/verdict.py", "src/obseq/report/worst_test.py"),
    "screening": ("src/obseq/survey/checks", "src/obseq/images/measure_checks.py"),
    "strategies": (
        "src/obseq/leastsquares/iterations/strategies.py",
        "src/obseq/leastsquares/iterations/arrival.py",
        "src/obseq/images/adjustment/approach.py",
        "src/obseq/survey/adjustment/contest.py",
    ),
}
"""The rooms that decide; `rest` is everything else."""


class Change(NamedTuple):
    """A change of one place of a module: the operator of cosmic-ray and how manieth place of it."""

    module: str
    first: tuple[int, int]
    last: tuple[int, int]
    operator: str
    occurrence: int


def sample(room: str, count: int, seed: int) -> list[Change]:
    """Changes of what runs, in the order of their places."""
    chance = random.Random(seed)
    own = _modules(ROOMS[room]) if room in ROOMS else _others()
    if room in ROOMS:
        return _some(sorted(change for module in own for change in _changes(module)), count, chance)
    drawn = Counter(chance.choices(own, [(ROOT / name).stat().st_size for name in own], k=count))
    some = (_some(_changes(name), number, chance) for name, number in sorted(drawn.items()))
    return list(chain.from_iterable(some))


def _some(changes: list[Change], count: int, chance: random.Random) -> list[Change]:
    """Some of them at random, in the order of their places; not those that are no Python."""
    chance.shuffle(changes)
    return sorted(islice((change for change in changes if _is_python(change)), count))


def _is_python(change: Change) -> bool:
    """Whether a change can be read, and is none of the mark of arguments that are given by name."""
    before = (ROOT / change.module).read_text("utf-8")
    after = changed(before, change)
    try:
        return ast.dump(ast.parse(after)) != ast.dump(_tree(change.module)) and not _is_mark(before, change)
    except SyntaxError:
        return False


def _is_mark(text: str, change: Change) -> bool:
    """Whether what is changed is the star after which arguments are given by name."""
    line, column = change.first
    return text.splitlines()[line - 1][column:].replace(" ", "").startswith("*,")


def _modules(places: Iterable[str]) -> list[str]:
    found = set[Path]()
    for place in places:
        found |= {ROOT / place} if place.endswith(".py") else set((ROOT / place).rglob("*.py"))
    links = {path for path in found if any(parent.is_symlink() for parent in path.parents)}
    return sorted(path.relative_to(ROOT).as_posix() for path in found - links)


def _others() -> list[str]:
    """Modules of no room that decides, but for what is made or tested from lists."""
    rooms = {module for places in ROOMS.values() for module in _modules(places)}
    return [name for name in _modules(["src/obseq"]) if name not in rooms and not name.endswith("__.py")]


def _changes(module: str) -> list[Change]:
    """All changes that cosmic-ray knows of a module, but those of what does not run."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.plugins import get_operator, operator_names

    text = (ROOT / module).read_text("utf-8")
    nodes, idle = list(ast_nodes(get_ast(text))), list(_idle(text))
    found = []
    for name in operator_names():
        operator = get_operator(name)
        if name.endswith(SAME) or operator.arguments():
            continue
        places = (ends for node in nodes for ends in operator().mutation_positions(node))
        found += [Change(module, *ends, name, at) for at, ends in enumerate(places)]
    return sorted(one for one in found if not any(begin <= one.first < end for begin, end in idle))


def changed(text: str, change: Change) -> str:
    """The text of a module with a change."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    return str(mutate_code(text, get_operator(change.operator)(), change.occurrence))


def difference(before: str, after: str) -> str:
    """The first line that differs, before and after."""
    lines = zip(before.splitlines(), after.splitlines(), strict=False)
    return next((f"    - {old.strip()}\n    + {new.strip()}" for old, new in lines if old != new), "")


@cache
def _tree(module: str) -> ast.Module:
    return ast.parse((ROOT / module).read_text("utf-8"))


def statement(change: Change) -> tuple[int, int, bool]:
    """First and last line of the statement of a change, and whether a call runs it or the import."""
    found = change.first[0], change.last[0]
    for node in ast.walk(_tree(change.module)):  # outer ones first
        if isinstance(node, ast.stmt):
            body = getattr(node, "body", None)
            end = max(body[0].lineno - 1, node.lineno) if body else node.end_lineno or 0
            if node.lineno <= change.first[0] <= end:
                found = node.lineno, end
    return *found, runs(change.module, change.first[0])


def runs(module: str, line: int) -> bool:
    """Whether a line stands in the body of a function."""
    return any(
        node.body[0].lineno <= line <= (node.end_lineno or 0)
        for node in ast.walk(_tree(module))
        if isinstance(node, ast.FunctionDef)
    )


def place(change: Change) -> str:
    """What a change is called: file, line and column, and what is done there."""
    line, column = change.first
    return f"{change.module}:{line}:{column} {change.operator.removeprefix('core/')} {change.occurrence}"


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
