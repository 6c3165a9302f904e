"""Headers of Borea's text files: one letter per column."""

from __future__ import annotations

from typing import TYPE_CHECKING

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.images.aerial.heights import HeightType
from obseq.reading.text import parse_number

if TYPE_CHECKING:
    from collections.abc import Iterable

_Z_TYPES = {"Z": HeightType.ALTITUDE, "H": HeightType.HEIGHT}
_NUMBERS = frozenset("XYZHOPK")


@dataclass(frozen=True)
class Columns:
    """What the columns of a file mean.

    Attributes:
        letters: one per column.
    """

    letters: str

    @classmethod
    def of(cls, header: str, needed: str, allowed: str, *, has_z: bool) -> Columns:
        """The columns of a header string.

        Raises:
            InputError: an unknown letter, one that is missing or given twice, or both Z and H.
        """
        known = set(allowed) | {"S"} | (set(_Z_TYPES) if has_z else set())
        for letter in header:
            if letter not in known:
                raise InputError(
                    f"header {header!r}: {letter!r} has no meaning here; letters are {_listed(known)}."
                )
            if letter != "S" and header.count(letter) > 1:
                raise InputError(f"header {header!r}: {letter} stands twice.")
        missing = [letter for letter in needed if letter not in header]
        if missing:
            raise InputError(f"header {header!r}: {_listed(missing)} missing.")
        if has_z and sum(letter in header for letter in _Z_TYPES) != 1:
            raise InputError(f"header {header!r}: needs Z (altitude) or H (ellipsoidal height), one of them.")
        return cls(header)

    @property
    def height_type(self) -> HeightType | None:
        """Altitude for Z, height for H."""
        return next((kind for letter, kind in _Z_TYPES.items() if letter in self.letters), None)

    def read(self, line: str) -> dict[str, str | float]:
        """The fields of a line by letter, z under Z.

        Raises:
            ValueError: with the reason.
        """
        words = line.split()
        if len(words) != len(self.letters):
            raise ValueError(
                f"has {len(words)} columns, the header {self.letters!r} names {len(self.letters)}"
            )
        found: dict[str, str | float] = {}
        for letter, word in zip(self.letters, words, strict=True):
            if letter != "S":
                found["Z" if letter == "H" else letter] = self._value(letter, word)
        return found

    def _value(self, letter: str, word: str) -> str | float:
        is_angle_letter = "N" in self.letters and "C" in self.letters
        if letter not in _NUMBERS or (letter == "P" and not is_angle_letter):
            return word
        return parse_number(word)

    def is_title(self, line: str) -> bool:
        """Whether no column that should hold a number does."""
        words = line.split()
        return len(words) == len(self.letters) and not any(_is_number(word) for word in words)


def _is_number(word: str) -> bool:
    try:
        parse_number(word)
    except ValueError:
        return False
    return True


def _listed(letters: Iterable[str]) -> str:
    return ", ".join(sorted(letters))
