"""What follows the sigma of an OBS line: relative sigma, heights of instrument and target, or a remark.

The grammar is Comp3D's: no number, one (the relative sigma) or three (relative sigma, height of the
instrument, height of the target); a remark may follow none or three. MMVII ignores all of it. Here a number
that is read is used, unless the user has said that such numbers are to be ignored.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import field

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.reading.text import TextFile, leading_numbers, parse_number

IGNORABLE = {
    "after-sigma": "everything after the sigma of an OBS line",
    "relative-sigmas": "relative sigmas of OBS lines",
    "heights": "heights of instrument and target in OBS lines",
    "deflections": "deflections of the vertical in COR lines, or of --geoid for projects",
    "frames": "reference frames and epochs of single observations",
    "reductions": "that observations of LandXML are reduced already (ReducedObservation)",
}
"""What may be left out on demand: what the user says, and what it is."""

LARGEST_RELATIVE = 0.1
"""Relative sigmas beyond it (of a distance; m on an angle: times 100) are mistakes or remarks."""
LARGEST_HEIGHT = 100.0
"""Heights of instruments and targets (m) beyond it are mistakes or remarks."""

Triple = tuple[float, float, float]
NOTHING: Triple = (0.0, 0.0, 0.0)


def checked_ignore(names: Collection[str]) -> frozenset[str]:
    """The names of what is to be ignored.

    Raises:
        InputError: one of them is unknown.
    """
    for name in names:
        if name not in IGNORABLE:
            raise InputError(f"--ignore {name}: unknown; known are {', '.join(IGNORABLE)}")
    return frozenset(names)


@dataclass
class AfterSigma:
    """Reads what follows the sigma of the lines of one file, and counts what it ignores.

    Attributes:
        file: The file.
        ignored: Names of what is to be ignored.
        counts: How many lines had something that was ignored, by its name.
    """

    file: TextFile
    ignored: frozenset[str]
    counts: dict[str, int] = field(default_factory=dict)

    def read(self, index: int, is_length: bool, fields: list[str]) -> Triple:
        """Relative sigma, a length (m, on an angle) or a share of the distance; heights of both ends (m)."""
        numbers = self._numbers(index, fields)
        if "after-sigma" in self.ignored:
            self._ignore("after-sigma", any(numbers))
            return NOTHING
        if not any(numbers):
            return NOTHING
        if len(numbers) != 3 and (len(numbers) != 1 or len(fields) > 1):
            raise self.file.error(index, _unclear(len(numbers), len(fields)))
        relative, origin, target = numbers if len(numbers) == 3 else (numbers[0], 0.0, 0.0)
        self._check(index, is_length, relative, max(abs(origin), abs(target)))
        if "relative-sigmas" in self.ignored:
            self._ignore("relative-sigmas", relative != 0.0)
            relative = 0.0
        if "heights" in self.ignored:
            self._ignore("heights", origin != 0.0 or target != 0.0)
            origin = target = 0.0
        return relative, origin, target

    def warnings(self) -> list[str]:
        """What was ignored, one sentence each."""
        return [
            f"{self.file.name}: {IGNORABLE[name]}: ignored in {count} lines, as asked for"
            for name, count in self.counts.items()
        ]

    def _numbers(self, index: int, fields: list[str]) -> list[float]:
        """The numbers before the first word."""
        try:
            return leading_numbers(fields, parse_number)
        except ValueError as error:
            raise self.file.error(index, f"{error} (after the sigma)") from error

    def _ignore(self, name: str, is_something: bool) -> None:
        if is_something:
            self.counts[name] = self.counts.get(name, 0) + 1

    def _check(self, index: int, is_length: bool, relative: float, height: float) -> None:
        largest = LARGEST_RELATIVE * (100.0 if is_length else 1.0)
        unit = "m across the sight" if is_length else "of the distance"
        if not 0.0 <= relative <= largest:
            raise self.file.error(
                index,
                f"a relative sigma of {relative:g} {unit} is not between 0 and {largest:g}; put a * before "
                "it if "
                "it is a remark, or leave such numbers out with --ignore after-sigma",
            )
        if height > LARGEST_HEIGHT:
            raise self.file.error(
                index,
                f"a height of instrument or target of {height:g} m is beyond {LARGEST_HEIGHT:g} m; correct "
                "it, or "
                "leave heights out with --ignore heights",
            )


def _unclear(count: int, length: int) -> str:
    found = f"{count} number{'s' if count > 1 else ''}{' and a remark' if count < length else ''}"
    return (
        f"{found} after the sigma, where one (relative sigma) or three (relative sigma, height of "
        "instrument, height of target) may stand, and a remark after none or three of them; write names "
        "without blanks, put a * before a remark, or leave them out with --ignore after-sigma"
    )
