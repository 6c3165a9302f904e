"""Lines and numbers of a text file written by people, with errors that name file and line."""

from __future__ import annotations

import math
import re
import stat
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.printable import composed, printable
from obseq.stopwatch import Tally

_MARKS_OF_UTF16 = b"\xff\xfe", b"\xfe\xff"
_LONGEST_QUOTE = 160
_STRIDE = 1000
"""Lines that are read between two looks at the clock."""
LEAST_SIGMA = 1e-12
"""Sigmas below it (m, gon) would make weights infinite."""
_HIDDEN = ("Zs", "Cc")
"""Blanks and signs of control, as Unicode sorts them."""
_NO_WIDTH = "\u00ad\u200b\u2060\ufeff"
_WORD = re.compile(r"\S+", re.ASCII)
LONGEST_NAME = 200
"""Names beyond it are a mistake of the file: nothing could be printed of them."""
LARGEST_FILE = 1 << 31
"""Bytes above which a file is refused."""
_NO_FILES = (
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
)
LARGEST_LENGTH = 1e9
"""Lengths and coordinates beyond this (m) are mistakes: no survey reaches a million kilometres."""


@dataclass(frozen=True)
class TextFile:
    """A text file in memory.

    Attributes:
        name: how messages call it (the path as the user gave it).
        lines: its lines, without their ends; bytes that are not in the encoding are lone surrogates.
        is_clean: true when the whole file is in the encoding.
        encoding: the encoding it was read with.
    """

    name: str
    lines: list[str]
    is_clean: bool
    encoding: str

    def place(self, index: int) -> str:
        """What messages call line `index` (from 0)."""
        return f"{self.name}:{index + 1}"

    def error(self, index: int, problem: str) -> InputError:
        """An error about line `index` (from 0), which it quotes."""
        if hidden := invisible(self.lines[index]):
            problem += f" (the line holds {hidden!a}, which nobody sees)"
        return InputError(f"{self.place(index)}: {problem}\n    {quoted(self.lines[index])}")

    def number(self, index: int, text: str, said: str = "{}") -> float:
        """The number in a text of line `index`; `said` is how the reason is told when it is none."""
        try:
            return parse_number(text)
        except ValueError as error:
            raise self.error(index, said.format(error)) from error

    def check_name(self, index: int, name: str) -> None:
        """Refuses a point name that is not in the encoding of the file, or that nobody could read."""
        if len(name) > LONGEST_NAME:
            raise self.error(
                index,
                f"a name has {len(name)} characters; give it at most {LONGEST_NAME} (are blanks missing?)",
            )
        if invisible(name):
            raise self.error(
                index, f"the name {quoted(name)} holds a character that nobody sees; type it again"
            )
        if not self.is_clean and _has_surrogates(name):
            raise self.error(
                index,
                f"the name {quoted(name)} is not written in {self.encoding}; save the file as UTF-8, or give "
                "its encoding (--encoding latin-1 on the command line, encoding='latin-1' in Python)",
            )


class _CountedLines(list[str]):
    """Lines that tell how far they have been read."""

    def __init__(self, lines: list[str], tally: Tally) -> None:
        super().__init__(lines)
        self._tally = tally

    def __iter__(self) -> Iterator[str]:
        for k, line in enumerate(super().__iter__()):
            if k % _STRIDE == 0 and self._tally.is_due:
                self._tally.tell(k + 1)
            yield line

    def __getitem__(self, index: Any) -> Any:
        if type(index) is int and index % _STRIDE == 0 and self._tally.is_due:
            self._tally.tell(index + 1)
        return super().__getitem__(index)


def counted(path: str | Path, lines: list[str]) -> list[str]:
    """The lines of a file; they tell how far they have been read where somebody listens."""
    tally = Tally(f"read {path}: line", len(lines))
    return _CountedLines(lines, tally) if tally.is_heard else lines


def read_text(path: str | Path, encoding: str = "utf-8") -> TextFile:
    """Reads a text file; line ends may be LF, CRLF or CR, a mark of UTF-8 is dropped, one of UTF-16 obeyed.

    Letters with accents that are written as two characters become one (NFC): names that look the same are
    the same. Comments in another encoding are accepted; names are checked one by one with
    `TextFile.check_name`.

    Raises:
        InputError: absent, a directory, unreadable, empty, binary, or unknown encoding.
    """
    data = read_bytes(Path(path))
    encoding = encoding_of(data, encoding)
    _refuse_binary(path, data, encoding)
    try:
        text = composed(data.decode(encoding, "surrogateescape"))
    except (LookupError, ValueError) as error:
        raise InputError(f"{path}: cannot be read in encoding {encoding!r}: {error}") from error
    if not text.strip():
        raise InputError(f"{path}: the file is empty")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    name = encoding.upper().removesuffix("-SIG")
    return TextFile(str(path), counted(path, lines), not _has_surrogates(text), name)


def encoding_of(data: bytes, encoding: str = "utf-8") -> str:
    """The encoding of what a file holds: UTF-16 where its first bytes say so, whatever was expected."""
    if data.startswith(_MARKS_OF_UTF16):
        return "utf-16"
    return "utf-8-sig" if encoding.lower() in ("utf-8", "utf8") else encoding


def read_bytes(path: Path, largest: int = LARGEST_FILE) -> bytes:
    """What a file holds.

    Raises:
        InputError: absent, a directory, a device or a pipe (they may have no end), too large, or unreadable.
    """
    with _readable(path):
        check_file(path, largest)
        return path.read_bytes()


def start_of(path: Path, size: int) -> bytes:
    """The first bytes of a file; errors as of `read_bytes`."""
    with _readable(path):
        check_file(path)
        with path.open("rb") as file:
            return file.read(size)


def check_file(path: Path, largest: int = LARGEST_FILE) -> None:
    """Refuses what may have no end, before a library opens it.

    Raises:
        InputError: a device or a pipe, or too large.
    """
    if not path.exists():
        return
    status = path.stat()
    kind = next((words for test, words in _NO_FILES if test(status.st_mode)), "")
    if kind:
        raise InputError(f"{path}: is {kind}, which may have no end; save what it gives in a file")
    if status.st_size > largest:
        raise InputError(f"{path}: the file is larger than {largest >> 20} MiB")


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """Makes errors of the system say what is wrong with a file."""
    try:
        yield
    except FileNotFoundError as error:
        raise InputError(f"{path}: there is no such file; check the path") from error
    except IsADirectoryError as error:
        raise InputError(f"{path}: is a directory; give a file") from error
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from error


def _refuse_binary(path: str | Path, data: bytes, encoding: str) -> None:
    position = -1 if encoding.lower().startswith(("utf-16", "utf16")) else data.find(b"\0")
    if position < 0:
        return
    if 2 * data.count(0) >= len(data) - 2:
        raise InputError(
            f"{path}: looks like UTF-16 that does not begin with its mark; save it as UTF-8 (or say its "
            "encoding: --encoding utf-16-le on the command line)"
        )
    line = data.count(b"\n", 0, position) + 1
    raise InputError(f"{path}:{line}: holds a zero byte: this is a binary file, not a text file")


def _has_surrogates(text: str) -> bool:
    try:
        text.encode("utf-8")
    except UnicodeEncodeError:
        return True
    return False


def invisible(text: str) -> str:
    """The first blank that is not of the keyboard, or sign without a width, of a text; "" for none."""
    if text.isprintable():
        return ""
    from unicodedata import category

    return next((c for c in text if c not in " \t" and (c in _NO_WIDTH or category(c) in _HIDDEN)), "")


def words(text: str) -> list[str]:
    """The parts of a text between blanks of the keyboard; any other is part of a word, which is refused."""
    return text.split() if text.isascii() else _WORD.findall(text)


def quoted(text: str) -> str:
    """The text as it can be printed anywhere: unprintable characters escaped, cut when very long."""
    shown = printable(text.strip()[: 4 * _LONGEST_QUOTE])
    return shown if len(shown) <= _LONGEST_QUOTE else shown[:_LONGEST_QUOTE] + "..."


def leading_numbers(fields: Sequence[str], parse: Callable[[str], float]) -> list[float]:
    """The numbers before the first word among fields; `parse` refuses those that may not be."""
    numbers: list[float] = []
    for text in fields:
        try:
            float(text)
        except ValueError:
            break
        numbers.append(parse(text))
    return numbers


def parse_number(text: str) -> float:
    """A finite decimal number up to `LARGEST_LENGTH`, written in ASCII with a point.

    Raises:
        ValueError: with the reason, to be completed with file and line by the caller.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if abs(value) <= LARGEST_LENGTH and text.isascii() and "_" not in text:
        return value
    raise ValueError(_no_number(text))


def _no_number(text: str) -> str:
    """Why a text is no number."""
    try:
        value = float(text) if text.isascii() and "_" not in text else None
    except ValueError:
        value = None
    if value is None:
        hint = "; the decimal separator is a point" if "," in text else ""
        return f"{quoted(text)!r} is not a number{hint}"
    if not math.isfinite(value):
        return f"{quoted(text)!r} is not a finite number"
    return f"{quoted(text)!r} is beyond {LARGEST_LENGTH:g}"


def check_default_sigma(sigma: float, what: str, least: float = 0.0) -> None:
    """Refuses a sigma of coordinates (m) that stands for those a file does not give.

    Raises:
        InputError: It is below the least one, beyond the largest length, or neither 0 nor a weight.
    """
    if not least <= sigma <= LARGEST_LENGTH or 0.0 < abs(sigma) < LEAST_SIGMA:
        raise InputError(
            f"{what}: {sigma!r} is not a sigma in metres (0, or {LEAST_SIGMA:g} to {LARGEST_LENGTH:g})"
        )


def check_writable(name: str) -> None:
    """Refuses a point name that OBS and COR files cannot hold."""
    if not name or name.split() != [name] or "*" in name:
        raise InputError(f"point name {name!r} cannot be written: it is empty or holds a blank or a *")
