"""Python files of the project as syntax trees, each read once by the tests of a process, however many ask."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import TypeVar

Node = TypeVar("Node", bound=ast.AST)


@cache
def tree(path: Path) -> ast.Module:
    """What is written in a file."""
    return ast.parse(path.read_text("utf-8"))


def forget() -> None:
    """Lets go of what was read: more than a million nodes, which whoever looks for garbage would visit."""
    tree.cache_clear()
    _by_kind.cache_clear()


def statements(path: Path) -> Iterator[ast.AST]:
    """Every statement, wherever in a file, and what holds statements."""
    waiting: list[ast.AST] = [tree(path)]
    while waiting:
        node = waiting.pop()
        yield node
        for name in ("body", "orelse", "finalbody", "handlers", "cases"):
            waiting += getattr(node, name, ())


def nodes(path: Path, *kinds: type[Node]) -> Iterator[Node]:
    """Every node of some kinds, wherever in a file; kind by kind."""
    found = _by_kind(path)
    for kind in kinds:
        yield from found.get(kind, ())  # type: ignore[misc]


@cache
def _by_kind(path: Path) -> dict[type[ast.AST], list[ast.AST]]:
    found: dict[type[ast.AST], list[ast.AST]] = {}
    for node in ast.walk(tree(path)):
        found.setdefault(type(node), []).append(node)
    return found
