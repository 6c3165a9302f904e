"""Where rows were read."""

from __future__ import annotations

from collections.abc import Sequence

from obseq.dataclass import dataclass


@dataclass(frozen=True)
class Origin:
    """Where rows were read, for messages.

    Attributes:
        path: of the file or folder.
        lines: (n,) line of each row; empty where rows are no lines.
    """

    path: str
    lines: Sequence[int] = ()

    def place(self, row: int) -> str:
        """`file:line` of a row, or the file alone."""
        return f"{self.path}:{self.lines[row]}" if self.lines else self.path
