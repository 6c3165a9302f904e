"""Values of JSON files, with the way to them for messages."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.reading.tables import text_of


@dataclass(frozen=True, eq=False)
class Node:
    """A value of a JSON file.

    Attributes:
        value: what `json` made of it.
        where: file, and the keys that lead to it.
    """

    value: Any
    where: str

    def problem(self, said: str) -> InputError:
        """An error about this value."""
        return InputError(f"{self.where}: {said}")

    def __contains__(self, key: str) -> bool:
        return isinstance(self.value, dict) and key in self.value

    def __getitem__(self, key: str) -> Node:
        if key not in self:
            raise self.problem(f"{key!r} is missing")
        return Node(self.value[key], f"{self.where}/{key}")

    def get(self, key: str, default: object) -> Node:
        """The value of a key, or a default where there is none, or null."""
        found = self.value.get(key) if isinstance(self.value, dict) else None
        return Node(default if found is None else found, f"{self.where}/{key}")

    def items(self) -> Iterator[tuple[str, Node]]:
        """Keys and values of an object."""
        if not isinstance(self.value, dict):
            raise self.problem("an object is expected")
        for key, value in self.value.items():
            yield key, Node(value, f"{self.where}/{key}")

    def __iter__(self) -> Iterator[Node]:
        if not isinstance(self.value, list):
            raise self.problem("a list is expected")
        for number, value in enumerate(self.value):
            yield Node(value, f"{self.where}/{number}")

    def text(self) -> str:
        """A text; numbers are texts too."""
        if isinstance(self.value, bool) or not isinstance(self.value, str | int):
            raise self.problem("a text is expected")
        return str(self.value)

    def number(self) -> float:
        """A finite number; also where it is a text."""
        try:
            value = float("nan" if isinstance(self.value, bool) else self.value)
        except (TypeError, ValueError, OverflowError):
            value = np.nan
        if not np.isfinite(value):
            raise self.problem(f"{str(self.value)[:40]!r} is no finite number")
        return value

    def numbers(self, *shape: int) -> FloatArray:
        """Finite numbers of a shape; -1 for any length."""
        try:
            found = np.array(self.value, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            found = np.array(np.nan)
        fits = found.ndim == len(shape) and all(b in (-1, a) for a, b in zip(found.shape, shape, strict=True))
        if not fits or not np.isfinite(found).all():
            raise self.problem(f"{' by '.join(map(str, shape))} finite numbers are expected")
        return found


def read_json(path: Path) -> Node:
    """The value of a JSON file.

    Raises:
        InputError: it is none; file and line are named.
    """
    try:
        return Node(json.loads(text_of(path)), str(path))
    except json.JSONDecodeError as error:
        raise InputError(f"{path}:{error.lineno}: no JSON: {error.msg}") from None
    except RecursionError:
        raise InputError(f"{path}: lists are nested too deeply") from None
