"""Text that can be shown anywhere: what a terminal would obey, or nobody would see, becomes an escape."""

from __future__ import annotations

import re
from collections.abc import Sequence

KEPT = frozenset("\n\t")
FIRST_BYTE, BYTES = 0xDC00, ("\udc80", "\udcff")
"""What stands for bytes that the encoding of a file does not have (surrogateescape)."""


def printable(text: str) -> str:
    r"""The text with every character that cannot be printed as an escape, line ends and tabs kept.

    Example:
        >>> print(printable("A\x1b[2J"))
        A\x1b[2J
    """
    if text.isascii() and text.replace("\n", "").replace("\t", "").isprintable():
        return text
    return "".join(c if c.isprintable() or c in KEPT else _escaped(c) for c in text)


def printable_line(text: str) -> str:
    """The same on one line: line ends and tabs are escapes too."""
    return text if text.isprintable() else "".join(c if c.isprintable() else _escaped(c) for c in text)


def json_escaped(text: str) -> str:
    """JSON text in which what cannot be printed stands as JSON's own escape; it means the same."""
    is_plain = text.isascii() and text.replace("\n", "").isprintable()
    return text if is_plain else _UNPRINTABLE.sub(_json_escape, text)


def composed(text: str) -> str:
    """The text with a letter and its accents as one character (NFC): names that look the same are equal."""
    if text.isascii():
        return text
    from unicodedata import normalize

    return normalize("NFC", text)


def listed(names: Sequence[str], most: int) -> str:
    """Names with commas between them, the first few of many.

    Example:
        >>> listed(["A", "B", "C"], 2)
        'A, B and 1 more'
    """
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


_UNPRINTABLE = re.compile(r"[^\x20-\x7e\n]")


def _json_escape(match: re.Match[str]) -> str:
    c = match[0]
    if c.isprintable():
        return c
    units = c.encode("utf-16-be", "surrogatepass").hex()
    return "".join(f"\\u{units[k : k + 4]}" for k in range(0, len(units), 4))


def _escaped(c: str) -> str:
    if BYTES[0] <= c <= BYTES[1]:  # of another encoding, which could not be decoded
        return f"\\x{ord(c) - FIRST_BYTE:02x}"
    return c.encode("unicode_escape").decode()
