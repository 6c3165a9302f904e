"""The size of things: functions, files, documentation, and names that stay where they are."""

import ast
import statistics
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ("src/obseq", "formulas", "codegen")
OTHERS = ("tests", "tools")
LONGEST_FILE = 400
"""Lines; what comes near is to be divided by purpose before it gets there."""

LONGEST_FUNCTION, LONG_FUNCTION = 60, 16
USUAL_FUNCTION = {ROOMS: 5, ("tools",): 6}
LEAST_DOCUMENTED = 0.97
MOST_ANY, MOST_IGNORED = 106, 19
"""Half of what the library had before its rooms were drawn, when it was less than half as large."""

THEIRS = {"_codegen", "_data_layout", "_getvalue"}
"""Of numba, for which there are no other names."""

NAMED_TUPLE = {"_asdict", "_fields", "_make", "_replace"}
Function = ast.FunctionDef | ast.AsyncFunctionDef


def files(rooms: tuple[str, ...]) -> list[Path]:
    """Python files of rooms; what links of the package lead to is counted in its own place."""
    found = [path for room in rooms for path in sorted((ROOT / room).rglob("*.py"))]
    links = tuple(path for path in (ROOT / "src" / "obseq").iterdir() if path.is_symlink())
    return [path for path in found if not any(path.is_relative_to(link) for link in links)]


@cache
def trees(rooms: tuple[str, ...] = ROOMS) -> dict[Path, ast.Module]:
    return {path: ast.parse(path.read_text("utf-8")) for path in files(rooms)}


def test_files_are_short() -> None:
    sizes = {path.relative_to(ROOT).as_posix(): lines_of(path) for path in files((*ROOMS, *OTHERS))}
    assert {name: size for name, size in sizes.items() if size >= LONGEST_FILE} == {}


def lines_of(path: Path) -> int:
    return path.read_text("utf-8").count("\n")


@pytest.mark.parametrize("rooms", USUAL_FUNCTION, ids=" ".join)
def test_functions_are_short(rooms: tuple[str, ...]) -> None:
    sizes = {
        f"{path.relative_to(ROOT)}:{node.lineno} {node.name}": length_of(node)
        for path, tree in trees(rooms).items()
        for node in ast.walk(tree)
        if isinstance(node, Function)
    }
    ordered = sorted(sizes.values())
    assert {name: size for name, size in sizes.items() if size > LONGEST_FUNCTION} == {}
    assert ordered[int(0.9 * len(ordered))] <= LONG_FUNCTION
    assert statistics.median(ordered) <= USUAL_FUNCTION[rooms]


def length_of(node: Function) -> int:
    """Lines of a body, its words apart."""
    body = node.body[1:] if ast.get_docstring(node) is not None else node.body
    return (body[-1].end_lineno or 0) - body[0].lineno + 1 if body else 0


def test_public_things_say_what_they_are() -> None:
    missing, found = [], 0
    for path, tree in trees().items():
        for node in public(tree):
            found += 1
            if not ast.get_docstring(node):
                missing.append(f"{path.relative_to(ROOT)}:{node.lineno} {node.name}")
    assert found > 2000
    assert 1.0 - len(missing) / found >= LEAST_DOCUMENTED, missing


def public(tree: ast.AST) -> Iterator[Function | ast.ClassDef]:
    """Classes, functions and methods whose names are public, setters and overloads apart."""
    for node in ast.iter_child_nodes(tree):
        if not isinstance(node, Function | ast.ClassDef) or node.name.startswith("_"):
            continue
        if not any(("setter" in (text := ast.unparse(d))) or "overload" in text for d in node.decorator_list):
            yield node
        if isinstance(node, ast.ClassDef):
            yield from public(node)


def test_types_are_said() -> None:
    said = sum(isinstance(n, ast.Name) and n.id == "Any" for tree in trees().values() for n in ast.walk(tree))
    ignored = sum(path.read_text("utf-8").count("type: ignore") for path in trees())
    assert (said <= MOST_ANY, ignored <= MOST_IGNORED) == (True, True), (said, ignored)


@pytest.mark.parametrize("room", ROOMS)
def test_no_private_name_is_used_from_another_file(room: str) -> None:
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: {name}"
        for path, tree in trees().items()
        if path.is_relative_to(ROOT / room)
        for line, name in foreign(tree)
    ]
    assert wrong == []


def foreign(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Private names of our own that a file takes from another one; those of other packages' apart."""
    own = {name for node in ast.walk(tree) for name in defined(node)}
    imported = {
        alias.asname or alias.name.partition(".")[0]
        for node in ast.walk(tree)
        if isinstance(node, ast.Import) or (isinstance(node, ast.ImportFrom) and not is_ours(node))
        for alias in node.names
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and is_ours(node):
            yield from ((node.lineno, alias.name) for alias in node.names if is_private(alias.name))
        elif isinstance(node, ast.Attribute) and is_private(node.attr):
            root = ast.unparse(node).partition(".")[0]
            if node.attr not in own | THEIRS and root not in imported:
                yield node.lineno, ast.unparse(node)


def is_ours(node: ast.ImportFrom) -> bool:
    return (node.module or "").startswith("obseq")


def is_private(name: str) -> bool:
    return name.startswith("_") and not name.startswith("__") and name not in NAMED_TUPLE


def defined(node: ast.AST) -> Iterator[str]:
    """Names that a node gives a meaning to: definitions, assignments, slots."""
    if isinstance(node, Function | ast.ClassDef):
        yield node.name
    elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
        yield node.id
    elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
        yield node.attr
    elif isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
