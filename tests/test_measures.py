"""The size of things: functions, files, documentation, and names that stay where they are."""

import ast
import hashlib
import statistics
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from sources import nodes, tree
from unchanged import Seen

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

THEIRS = {"_codegen", "_data_layout", "_final_module", "_getvalue"}
"""Of numba, for which there are no other names."""

NAMED_TUPLE = {"_asdict", "_fields", "_make", "_replace"}
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
Function = ast.FunctionDef | ast.AsyncFunctionDef


def files(rooms: tuple[str, ...]) -> list[Path]:
    """Python files of rooms; what links of the package lead to is counted in its own place."""
    found = [path for room in rooms for path in sorted((ROOT / room).rglob("*.py"))]
    links = tuple(path for path in (ROOT / "src" / "obseq").iterdir() if path.is_symlink())
    return [path for path in found if not any(path.is_relative_to(link) for link in links)]


@cache
def state() -> str:
    """Digest of what is measured, and of these rules: taken in a hundredth of the time of measuring."""
    found = hashlib.sha256(sys.version.encode())
    for path in (*files((*ROOMS, *OTHERS)), ROOT / "pyproject.toml"):
        found.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return found.hexdigest()


def test_files_are_short() -> None:
    sizes = {path.relative_to(ROOT).as_posix(): lines_of(path) for path in files((*ROOMS, *OTHERS))}
    assert {name: size for name, size in sizes.items() if size >= LONGEST_FILE} == {}


def lines_of(path: Path) -> int:
    return path.read_text("utf-8").count("\n")


@pytest.mark.parametrize("rooms", USUAL_FUNCTION, ids=" ".join)
def test_functions_are_short(rooms: tuple[str, ...], seen: Seen) -> None:
    if seen.has(name := f"measures/functions/{rooms[-1]}", state()):
        return
    sizes = {
        f"{path.relative_to(ROOT)}:{node.lineno} {node.name}": length_of(node)
        for path in files(rooms)
        for node in nodes(path, *FUNCTIONS)
    }
    ordered = sorted(sizes.values())
    assert {name: size for name, size in sizes.items() if size > LONGEST_FUNCTION} == {}
    assert ordered[int(0.9 * len(ordered))] <= LONG_FUNCTION
    assert statistics.median(ordered) <= USUAL_FUNCTION[rooms]
    seen.add(name, state())


def length_of(node: Function) -> int:
    """Lines of a body, its words apart."""
    body = node.body[1:] if ast.get_docstring(node) is not None else node.body
    return (body[-1].end_lineno or 0) - body[0].lineno + 1 if body else 0


def test_public_things_say_what_they_are(seen: Seen) -> None:
    if seen.has("measures/words", state()):
        return
    missing, found = [], 0
    for path in files(ROOMS):
        for node in public(tree(path)):
            found += 1
            if not ast.get_docstring(node):
                missing.append(f"{path.relative_to(ROOT)}:{node.lineno} {node.name}")
    assert found > 2000
    assert 1.0 - len(missing) / found >= LEAST_DOCUMENTED, missing
    seen.add("measures/words", state())


def public(tree: ast.AST) -> Iterator[Function | ast.ClassDef]:
    """Classes, functions and methods whose names are public, setters and overloads apart."""
    for node in ast.iter_child_nodes(tree):
        if not isinstance(node, Function | ast.ClassDef) or node.name.startswith("_"):
            continue
        if not any(("setter" in (text := ast.unparse(d))) or "overload" in text for d in node.decorator_list):
            yield node
        if isinstance(node, ast.ClassDef):
            yield from public(node)


def test_types_are_said(seen: Seen) -> None:
    if seen.has("measures/types", state()):
        return
    said = sum(node.id == "Any" for path in files(ROOMS) for node in nodes(path, ast.Name))
    ignored = sum(path.read_text("utf-8").count("type: ignore") for path in files(ROOMS))
    assert (said <= MOST_ANY, ignored <= MOST_IGNORED) == (True, True), (said, ignored)
    seen.add("measures/types", state())


@pytest.mark.parametrize("room", ROOMS)
def test_no_private_name_is_used_from_another_file(room: str, seen: Seen) -> None:
    if seen.has(name := f"measures/names/{room}", state()):
        return
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: {name}"
        for path in files(ROOMS)
        if path.is_relative_to(ROOT / room)
        for line, name in foreign(path)
    ]
    assert wrong == []
    seen.add(name, state())


def foreign(path: Path) -> Iterator[tuple[int, str]]:
    """Private names of our own that a file takes from another one; those of other packages' apart."""
    own = {*defined(path), *THEIRS}
    imports = [*nodes(path, ast.Import), *(node for node in nodes(path, ast.ImportFrom) if not is_ours(node))]
    imported = {alias.asname or alias.name.partition(".")[0] for node in imports for alias in node.names}
    for node in nodes(path, ast.ImportFrom):
        if is_ours(node):
            yield from ((node.lineno, alias.name) for alias in node.names if is_private(alias.name))
    for attribute in nodes(path, ast.Attribute):
        if is_private(attribute.attr) and attribute.attr not in own:
            text = ast.unparse(attribute)
            if text.partition(".")[0] not in imported:
                yield attribute.lineno, text


def is_ours(node: ast.ImportFrom) -> bool:
    return (node.module or "").startswith("obseq")


def is_private(name: str) -> bool:
    return name.startswith("_") and not name.startswith("__") and name not in NAMED_TUPLE


def defined(path: Path) -> Iterator[str]:
    """Names that a file gives a meaning to: definitions, assignments, slots."""
    yield from (node.name for node in nodes(path, *FUNCTIONS, ast.ClassDef))
    yield from (node.id for node in nodes(path, ast.Name) if isinstance(node.ctx, ast.Store))
    yield from (node.attr for node in nodes(path, ast.Attribute) if isinstance(node.ctx, ast.Store))
    yield from (node.value for node in nodes(path, ast.Constant) if isinstance(node.value, str))
