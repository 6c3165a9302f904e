"""Files that name other files: where they may be, and how deep that goes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import field
from pathlib import Path

from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.formats.once import TWICE
from obseq.reading.text import TextFile, read_text

DEEPEST = 5
"""Levels of files that include files."""
SHORTEST = 2
"""Lines with fewer letters hold nothing, as in Comp3D: some end with the mark of old files (Ctrl-Z)."""


@dataclass(frozen=True)
class Folder:
    """A project's folder.

    Attributes:
        root: The folder.
        encoding: Of the names in its files.
        outside: Whether files outside of it may be read.
        strays: Those that were read all the same.
        finished: Places of the files whose lines have been read to the end.
    """

    root: Path
    encoding: str
    outside: bool
    strays: dict[str, None] = field(default_factory=dict)
    finished: set[Path] = field(default_factory=set)

    def path(self, name: str, beside: Path | None = None) -> Path:
        r"""The path of a file that another one names; `\` counts as `/`.

        Raises:
            InputError: it is outside the folder, and that was not allowed.
        """
        found = (beside or self.root) / name.replace("\\", "/")
        if found.resolve().is_relative_to(self._place):
            return found
        if not self.outside:
            raise InputError(
                f"{found}: this file is outside the folder of the project; if you trust the project, allow "
                "it (--outside)"
            )
        self.strays[str(found)] = None
        return found

    @cached_property
    def _place(self) -> Path:
        """Where the folder is, links followed."""
        return self.root.resolve()

    def warnings(self) -> tuple[str, ...]:
        """A sentence about each file outside the folder that was read."""
        return tuple(f"{path}: read from outside the folder of the project" for path in self.strays)

    def open(self, name: str, beside: Path | None = None) -> TextFile:
        """A file that another one names."""
        return read_text(self.path(name, beside), self.encoding)

    def lines(
        self,
        name: str,
        opened: Callable[[TextFile], object],
        includes: bool = True,
        beside: Path | None = None,
    ) -> Iterator[tuple[TextFile, int, list[str]]]:
        """The lines that hold something: file, index (from 0) and fields; those of included files in place.

        Args:
            name: The file.
            opened: Called with each file before its lines.
            includes: Whether a line `@file` includes a file.
            beside: Folder from which the name counts; the root when None.

        Raises:
            InputError: a file cannot be read, or files include each other without end.
        """
        yield from self._lines(self.path(name, beside), opened, includes, 0)

    def _lines(
        self, path: Path, opened: Callable[[TextFile], object], includes: bool, depth: int
    ) -> Iterator[tuple[TextFile, int, list[str]]]:
        file = read_text(path, self.encoding)
        opened(file)
        for index, line in enumerate(file.lines):
            data = line.partition("*")[0].strip()
            if len(data) < SHORTEST:
                continue
            fields = data.split()
            if not fields[0].startswith("@"):
                yield file, index, fields
                continue
            if not includes:
                raise file.error(index, "a file of this kind includes no other file")
            if depth == DEEPEST:
                raise file.error(
                    index, f"files include files more than {DEEPEST} levels deep; is there a loop?"
                )
            included = self.path(fields[0][1:], path.parent)
            if included.resolve() in self.finished:
                raise file.error(index, f"{included} has been read already: {TWICE}")
            yield from self._lines(included, opened, includes, depth + 1)
        self.finished.add(path.resolve())
