"""Functions to be compiled, and the digest of what their machine code depends on.

The digest covers the text of a function, the constants and the functions that it names, and theirs in turn.
It needs neither numba nor the order in which things were imported.
"""

from __future__ import annotations

import hashlib
import importlib.util
import linecache
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

from obseq.cached import cached_property
from obseq.compilation.settings import SETTINGS
from obseq.dataclass import dataclass

DIGITS = 16
"""Hexadecimal digits of a digest."""

SUMS = frozenset({"reassoc", "nsz", "contract"})
"""Sums may be taken in any order, hence by vectors."""

CONTRACT = frozenset({"contract"})
"""A product and a sum may be rounded once."""


@dataclass(frozen=True)
class Instruction:
    """An operation written in LLVM's own terms, in a module that imports numba: `module` is imported last.

    Attributes:
        module: module that has it.
        name: its name there.
    """

    module: str
    name: str

    @property
    def text(self) -> str:
        """Text of the whole module."""
        return _module_text(self.module)

    def __call__(self, *arguments: object) -> Any:
        """Has a meaning in compiled functions only."""
        raise TypeError(f"{self.name} can be called by compiled functions only")


class Function:
    """A plain function that machine code is made from: a loop, a kernel, or what these call.

    Attributes:
        python: the function.
        flags: freedom of floating-point arithmetic, as LLVM calls it.
        always_inline: whether the text is put where it is called, whatever its length.
    """

    def __init__(
        self, python: FunctionType, flags: frozenset[str] = frozenset(), always_inline: bool = False
    ) -> None:
        self.python = python
        self.flags = flags
        self.always_inline = always_inline
        self._text = function_text(python)

    @property
    def name(self) -> str:
        """Name of the function."""
        return self.python.__name__

    @cached_property
    def digest(self) -> str:
        """Digest of the function and of everything it names; two functions with the same one do the same."""
        parts = [*SETTINGS, *sorted(self._parts(set()))]
        return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:DIGITS]

    def _parts(self, seen: set[int]) -> Iterator[str]:
        if id(self) in seen:
            return
        seen.add(id(self))
        flags = " ".join(sorted(self.flags))
        yield f"{self.python.__module__}.{self.name} {flags} {self.always_inline}\n{self._text}"
        for name, value in named_values(self.python):
            if isinstance(value, Function):
                yield f"{self.name} {name}={value.python.__module__}.{value.name}"
                yield from value._parts(seen)
            elif isinstance(value, Instruction):
                yield f"{self.name} {name}={value}\n{value.text}"
            else:
                yield f"{self.name} {name}={_constant_text(name, value)}"


def named_values(function: FunctionType) -> list[tuple[str, object]]:
    """Names of a function that its module defines, or that it takes from around it, with their values."""
    names = sorted(_names(function.__code__))
    found = [(name, function.__globals__[name]) for name in names if name in function.__globals__]
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    return found + [(name, cell.cell_contents) for name, cell in cells]


def _names(code: CodeType) -> set[str]:
    inner = (_names(constant) for constant in code.co_consts if isinstance(constant, CodeType))
    return set(code.co_names).union(*inner)


def _constant_text(name: str, value: object) -> str:
    """What machine code may depend on: all of a constant, the name of a module or a type."""
    if isinstance(value, bool | int | float | str | np.generic) or value is None:
        return repr(value)
    if isinstance(value, tuple):
        return "(" + " ".join(_constant_text(name, part) for part in value) + ")"
    if isinstance(value, ModuleType | BuiltinFunctionType):
        return value.__name__
    if isinstance(value, type):
        return f"{value.__module__}.{value.__qualname__} {getattr(value, '_fields', '')}"
    raise TypeError(
        f"{name}: compiled functions may name constants, modules, types and their like, not {value!r}"
    )


def function_text(function: FunctionType) -> str:
    """Text of a function from its first line, decorators included, to its last.

    Raises:
        OSError: the file of the function cannot be read.
    """
    lines = _lines(function.__code__.co_filename, function.__module__)
    first = function.__code__.co_firstlineno - 1
    indent = len(lines[first]) - len(lines[first].lstrip())
    last, in_body = first, False
    for k in range(first, len(lines)):
        line = lines[k]
        if not line.strip():
            continue
        depth = len(line) - len(line.lstrip())
        if in_body and depth <= indent and not line.lstrip().startswith(")"):
            break
        in_body = in_body or line.lstrip().startswith("def ")
        last = k
    return "\n".join(lines[first : last + 1])


def _lines(file: str, module: str) -> list[str]:
    path = Path(file)
    if path.is_file():
        return _file_lines(path, path.stat().st_mtime_ns)
    if file in linecache.cache:  # text that was never in a file
        return [line.rstrip("\n") for line in linecache.getlines(file)]
    return _module_text(module).splitlines()


@cache
def _file_lines(path: Path, changed: int) -> list[str]:
    return path.read_text(encoding="utf-8").splitlines()


@cache
def _module_text(module: str) -> str:
    spec = importlib.util.find_spec(module)
    read = getattr(spec.loader, "get_source", None) if spec else None
    text = read(module) if read else None
    if text is None:
        raise OSError(f"the text of {module} cannot be read; compiled code depends on it")
    return str(text)
