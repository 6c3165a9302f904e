"""What kernels rely on in the run time: the hash of the functions that they call, and of no others."""

import ast
import hashlib
import importlib.util
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import NamedTuple

FUNCTIONS = "obseq.kernels.functions"
LAYOUT = "obseq.kernels.layout"
SIZES = ("LANES", "STRIDE")
"""What every kernel takes from the layout."""


def functions_hash(called: Iterable[str]) -> str:
    """Hash of the code of some kernel functions and of all that it refers to, whatever the words in it."""
    content = code_of(_source(FUNCTIONS), called) + "\n" + code_of(_source(LAYOUT), SIZES)
    return hashlib.sha256(content.encode()).hexdigest()[:16]


def _source(module: str) -> str:
    spec = importlib.util.find_spec(module)
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(module)
    return Path(spec.origin).read_text("utf-8")


def code_of(source: str, names: Iterable[str]) -> str:
    """The code that defines some names of a module, and the names of the same module that it uses in turn.

    Args:
        source: Text of the module.
        names: Names that it defines; others are left out.
    """
    statements = _statements(source)
    definitions = {name: statement for statement in statements for name in statement.defined}
    needed: set[str] = set()
    pending = [name for name in names if name in definitions]
    while pending:
        if (name := pending.pop()) not in needed:
            needed.add(name)
            pending += definitions[name].used & definitions.keys()
    return "\n".join(statement.code for statement in statements if needed.intersection(statement.defined))


class _Statement(NamedTuple):
    """A statement of a module: the names that it defines, those that it uses, its code without docstrings."""

    defined: tuple[str, ...]
    used: frozenset[str]
    code: str


@cache
def _statements(source: str) -> tuple[_Statement, ...]:
    found = ast.parse(source).body
    return tuple(
        _Statement(tuple(_defined(each)), _used(each), ast.unparse(_without_docstrings(each)))
        for each in found
    )


def _defined(statement: ast.stmt) -> list[str]:
    """The names that a statement of a module defines."""
    if isinstance(statement, ast.FunctionDef | ast.ClassDef):
        return [statement.name]
    if isinstance(statement, ast.Import | ast.ImportFrom):
        return [alias.asname or alias.name for alias in statement.names]
    nodes = [node for node in ast.walk(statement) if isinstance(node, ast.Name)]
    return [node.id for node in nodes if isinstance(node.ctx, ast.Store)]


def _used(statement: ast.stmt) -> frozenset[str]:
    return frozenset(node.id for node in ast.walk(statement) if isinstance(node, ast.Name))


def _without_docstrings(statement: ast.stmt) -> ast.stmt:
    for node in ast.walk(statement):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            node.body = [part for part in node.body if not _is_docstring(part)] or [ast.Pass()]
    return statement


def _is_docstring(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
