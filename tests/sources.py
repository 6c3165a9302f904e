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
    imports.cache_clear()
    _by_kind.cache_clear()


def statements(path: Path) -> Iterator[ast.AST]:
    """Every statement, wherever in a file, and what holds statements."""
    return _within(tree(path))


@cache
def imports(path: Path) -> tuple[ast.Import | ast.ImportFrom, ...]:
    """Every statement that imports, wherever in a file: what stands after the last one is not read."""
    text = path.read_text("utf-8") + "\n"
    end = text.find("\n", text.rfind("import")) + 1 if "import" in text else 0
    try:
        top = ast.parse(text[:end])
    except SyntaxError:  # the word stands inside something that ends further down
        top = tree(path)
    return tuple(node for node in _within(top) if isinstance(node, ast.Import | ast.ImportFrom))


def _within(top: ast.AST) -> Iterator[ast.AST]:
    waiting = [top]
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
    waiting: list[ast.AST] = [tree(path)]
    while waiting:
        node = waiting.pop()
        found.setdefault(type(node), []).append(node)
        for name in node._fields:
            value = getattr(node, name, None)
            if isinstance(value, list):
                waiting += [item for item in value if isinstance(item, ast.AST)]
            elif isinstance(value, ast.AST):
                waiting.append(value)
    return found
