"""Data files of SNAP (`.dat`): blocks of observations, each laid out as the `#data` before it says."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace

from obseq.dataclass import dataclass
from obseq.errors import CrsError
from obseq.formats.dynadjust.records import radians_of_packed, radians_of_parts
from obseq.formats.snap.systems import System, system_of
from obseq.reading.angles import SECOND
from obseq.reading.text import TextFile, quoted

ANGLES, SIDED = ("HA", "ZD", "AZ", "PB"), {"LT": "NS", "LN": "EW"}
LENGTHS = ("SD", "HD", "ED", "MD", "DR")
VECTORS = ("GB", "GX")
TYPES = (*LENGTHS, *ANGLES, *SIDED, *VECTORS, "LV", "OH", "EH")
"""All data types."""
OF_POINTS = ("LT", "LN", "OH", "EH", "GX")
GROUPED = ("HA", "DR")
ERRORS = {
    "ds_error": ({"mm": 1e-3, "ppm": 1e-6}, LENGTHS),
    "ha_error": ({"sec": SECOND, "mm": 1e-3}, ("HA",)),
    "az_error": ({"sec": SECOND, "mm": 1e-3}, ("AZ", "PB")),
    "zd_error": ({"sec": SECOND, "mmh": 1e-3, "mmv": 1e-3}, ("ZD",)),
    "lv_error": ({"mm": 1e-3}, ("LV",)),
    "oh_error": ({"mm": 1e-3}, ("OH",)),
    "eh_error": ({"mm": 1e-3}, ("EH",)),
    "lt_error": ({"sec": SECOND}, ("LT",)),
    "ln_error": ({"sec": SECOND}, ("LN",)),
    "gps_enu_error": ({"mm": 1e-3, "ppm": 1e-6}, ("GB",)),
    "gx_enu_error": ({"mm": 1e-3, "mmr": 1e-3, "ppmr": 1e-6}, ("GX",)),
}
"""Commands of standard errors: units of their parts, and data types."""
FORMS = {"full": 6, "correlation": 6, "diagonal": 3, "enu": 3}
"""Numbers of the error of a vector by itself, by form."""
UNITS = {"dms_angles": "dms", "hp_angles": "hp", "deg_angles": "deg"}
PASSED = ("date", "time", "note", "classify")
PARAMETERS = (
    "reference_frame",
    "refraction_coefficient",
    "distance_scale_error",
    "bearing_orientation_error",
)
"""Commands that name parameters of what follows."""
ONE_WORD = ("id", "date", "time", *PARAMETERS)
"""Items of observations that are one word, and change nothing."""
Parts = dict[str, list[float]]
"""Of a standard error: numbers by unit."""


@dataclass(frozen=True)
class Block:
    """What `#data` says of the lines after it: data types with their items, and how they are laid out."""

    types: tuple[tuple[str, tuple[str, ...]], ...]
    has_heights: bool = True
    is_grouped: bool = False

    @property
    def is_of_points(self) -> bool:
        """Whether lines name one station."""
        return self.types[0][0] in OF_POINTS


@dataclass(frozen=True, eq=False)
class Settings:
    """What the commands before an observation say of it.

    Attributes:
        block: How lines are laid out; None before the first `#data`.
        defaults: Standard errors, by data type.
        classes: Names of classes that `#data` may announce.
        unit: Of angles: dms, hp or deg.
        form: Of the errors of vectors.
        projection: Of bearings.
        parameters: Names of parameters, by command; empty for none.
    """

    block: Block | None = None
    defaults: Mapping[str, Parts] = field(default_factory=dict)
    classes: frozenset[str] = frozenset()
    unit: str = "dms"
    form: str = "full"
    projection: System | None = None
    parameters: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Sight:
    """One observation of a line.

    Attributes:
        code: Data type.
        ends: Codes of its stations.
        heights: Of instrument and target.
        values: A number, or three.
        errors: Numbers of its standard error; None where the default counts.
        is_active: False when it is rejected.
        index: Line, from 0.
    """

    code: str
    ends: tuple[str, ...]
    heights: tuple[float, float]
    values: tuple[float, ...]
    errors: tuple[float, ...] | None
    is_active: bool
    index: int


@dataclass(frozen=True, eq=False)
class Together:
    """Observations that belong together: one, or a set.

    Attributes:
        sights: Of one data type.
        triangle: Numbers of the covariance or correlation after the set; None where no `#end_set` is.
        settings: What the commands before it say.
    """

    sights: tuple[Sight, ...]
    triangle: tuple[float, ...] | None
    settings: Settings


def _logical(lines: Sequence[str]) -> Iterator[tuple[int, str]]:
    """Lines (from 0) without comments; those that end in `&` go on in the next."""
    held, first = "", 0
    for index, line in enumerate(lines):
        text = line.partition("!")[0].strip()
        if not held:
            first = index
        if text.endswith("&"):
            held += f"{text[:-1]} "
        elif held or text:
            yield first, (held + text).strip()
            held = ""


@dataclass(frozen=True)
class _Words:
    """What is left of a line."""

    file: TextFile
    index: int
    left: deque[str]

    def next(self, what: str) -> str:
        """The next word, which is expected to be something."""
        if not self.left:
            raise self.file.error(self.index, f"the line ends where {what} is expected")
        return self.left.popleft()

    def skip(self, word: str) -> bool:
        """Whether the next word is this one, which is taken then."""
        found = bool(self.left) and self.left[0].lower() == word
        if found:
            self.left.popleft()
        return found

    def numbers(self, count: int) -> tuple[float, ...]:
        """The next words as numbers."""
        return tuple(self.file.number(self.index, self.next("a number")) for _ in range(count))

    def station(self, block: Block) -> tuple[str, float]:
        """A station, and the height over it."""
        return self.next("a station"), self.numbers(1)[0] if block.has_heights else 0.0


class DataFile:
    """One data file, read line by line."""

    def __init__(self, file: TextFile) -> None:
        self.file = file
        self._now = Settings()
        self._origin: tuple[str, float] | None = None
        self._set: list[Sight] = []

    def read(self) -> Iterator[Together]:
        """Its observations; the first line is the title.

        Raises:
            InputError: Naming file and line, what is wrong.
        """
        lines = _logical(self.file.lines)
        next(lines, None)
        for index, text in lines:
            if not text.startswith("#"):
                yield from self._line(index, text)
                continue
            name, *rest = text[1:].split() or [""]
            if name.lower() == "end_set":
                yield from self._finished(self._triangle(index, lines))
            else:
                if name.lower() != "note":
                    yield from self._finished()
                self._command(index, name.lower(), rest)
        yield from self._finished()

    def _command(self, index: int, name: str, rest: list[str]) -> None:
        now = self._now
        if name == "data":
            self._now = replace(now, block=self._announced(index, rest))
        elif name in ERRORS:
            parts = self._parts(index, name, rest)
            self._now = replace(now, defaults={**now.defaults, **dict.fromkeys(ERRORS[name][1], parts)})
        elif name in UNITS:
            self._now = replace(now, unit=UNITS[name])
        elif name == "gps_error_type":
            form = rest[0].lower() if rest else ""
            if form not in FORMS:
                raise self.file.error(index, f"#gps_error_type is one of {', '.join(FORMS)}")
            self._now = replace(now, form=form)
        elif name == "classification":
            self._now = replace(now, classes=now.classes | {word.lower() for word in rest})
        elif name == "projection":
            self._now = replace(now, projection=self._system(index, rest))
        elif name in PARAMETERS:
            value = rest[0].lower() if rest and rest[0].lower() != "none" else ""
            self._now = replace(now, parameters={**now.parameters, name: value})
        elif name not in PASSED:
            raise self.file.error(index, f"#{quoted(name)} is no command of a data file of SNAP")

    def _system(self, index: int, rest: list[str]) -> System:
        try:
            found = system_of(rest[0] if rest else "")
        except CrsError as error:
            raise self.file.error(index, str(error)) from error
        if not found.projection:
            raise self.file.error(index, "#projection names no projection")
        return found

    def _parts(self, index: int, name: str, words: list[str]) -> Parts:
        """A standard error: numbers, then their unit, once or more."""
        units, _ = ERRORS[name]
        parts: Parts = {}
        numbers: list[float] = []
        for word in words:
            unit = word.lower()
            if unit in units and numbers:
                parts[unit] = [number * units[unit] for number in numbers]
                numbers = []
            else:
                numbers.append(self.file.number(index, word))
        if numbers or not parts:
            raise self.file.error(
                index, f"#{name}: numbers with their unit are expected ({', '.join(units)})"
            )
        return parts

    def _announced(self, index: int, words: list[str]) -> Block:
        types: list[tuple[str, list[str]]] = []
        options = set()
        for word in words:
            name = word.lower()
            code = {"GPS": "GB"}.get(word.upper(), word.upper())
            if name in ("grouped", "no_heights"):
                options.add(name)
            elif code in TYPES:
                types.append((code, []))
            elif types and (name in ("value", "error", *ONE_WORD) or name in self._now.classes):
                types[-1][1].append(name)
            else:
                raise self.file.error(
                    index, f"#data: {quoted(word)!r} is neither a data type nor an item of one"
                )
        if not types:
            raise self.file.error(index, f"#data names no data type ({', '.join(TYPES)})")
        whole = [(code, tuple(items if "value" in items else ["value", *items])) for code, items in types]
        if len({code in OF_POINTS for code, _ in whole}) > 1:
            raise self.file.error(index, "#data: observations of one station and of two do not go together")
        grouped = "grouped" in options or any(code in GROUPED for code, _ in whole)
        return Block(tuple(whole), "no_heights" not in options, grouped)

    def _line(self, index: int, text: str) -> Iterator[Together]:
        block = self._now.block
        if block is None:
            raise self.file.error(index, "an observation before #data, which says what it is")
        words = _Words(self.file, index, deque(text.replace("*", " * ").split()))
        is_off = words.skip("*")
        first = words.station(block)
        if block.is_of_points:
            yield from self._take(words, block, (first,), is_off)
        elif not block.is_grouped:
            yield from self._take(words, block, (first, words.station(block)), is_off)
        elif not words.left:
            yield from self._finished()
            self._origin = first
        elif self._origin is None:
            raise self.file.error(index, "a target before the line of its instrument station")
        else:
            yield from self._take(words, block, (self._origin, first), is_off)

    def _take(
        self, words: _Words, block: Block, ends: tuple[tuple[str, float], ...], is_off: bool
    ) -> Iterator[Together]:
        """The observations of a line; those of sets are put by."""
        names = tuple(name for name, _ in ends)
        heights = ends[0][1], ends[-1][1] if len(ends) > 1 else 0.0
        for code, items in block.types:
            if words.skip("-"):
                continue
            values: tuple[float, ...] = ()
            errors: tuple[float, ...] | None = None
            is_active = not is_off
            for item in items:
                if item == "value":
                    is_active &= not words.skip("*")
                    values = self._value(words, code)
                    if words.skip("error"):
                        errors = self._errors(words, code, "enu")
                elif item == "error":
                    errors = self._errors(words, code, self._now.form)
                else:
                    words.next(item)
            sight = Sight(code, names, heights, values, errors, is_active, words.index)
            if block.is_grouped and code in (*VECTORS, *GROUPED):
                self._set.append(sight)
            else:
                yield Together((sight,), None, self._now)
        if words.left:
            raise self.file.error(words.index, f"{quoted(words.left[0])!r} follows what #data announces")

    def _value(self, words: _Words, code: str) -> tuple[float, ...]:
        if code in VECTORS:
            return words.numbers(3)
        if code not in ANGLES and code not in SIDED:
            return words.numbers(1)
        unit = self._now.unit
        try:
            if unit == "dms":
                angle = radians_of_parts(*words.numbers(3))
            else:
                (number,) = words.numbers(1)
                angle = radians_of_packed(number) if unit == "hp" else math.radians(number)
        except ValueError as error:
            raise self.file.error(words.index, str(error)) from error
        if code not in SIDED or unit == "deg":
            return (angle,)
        side = words.next(" or ".join(SIDED[code])).upper()
        if side not in SIDED[code]:
            raise self.file.error(words.index, f"{' or '.join(SIDED[code])} is missing after the angle")
        return (-angle if side in "SW" else angle,)

    def _errors(self, words: _Words, code: str, form: str) -> tuple[float, ...]:
        if code in VECTORS:
            is_set = self._now.block is not None and self._now.block.is_grouped
            return words.numbers(FORMS[form] if not is_set else {"full": 0}.get(form, 3))
        (size,) = words.numbers(1)
        if code in ANGLES or code in SIDED:
            size = math.radians(size) if self._now.unit == "deg" else size * SECOND
        return (size,)

    def _finished(self, triangle: tuple[float, ...] | None = None) -> Iterator[Together]:
        """The set that has been put by."""
        kept, self._set = self._set, []
        for code in dict.fromkeys(sight.code for sight in kept):
            yield Together(tuple(sight for sight in kept if sight.code == code), triangle, self._now)

    def _triangle(self, index: int, lines: Iterator[tuple[int, str]]) -> tuple[float, ...]:
        """Numbers of the lower triangle of the covariance after a set; none where its form has none."""
        n = 3 * len(self._set)
        wanted = {"full": n * (n + 1) // 2, "correlation": n * (n - 1) // 2}.get(self._now.form, 0)
        if not self._set or self._set[0].errors is None:
            return ()
        found: list[float] = []
        while len(found) < wanted:
            row, text = next(lines, (index, ""))
            if not text:
                break
            found += [self.file.number(row, word) for word in text.split()]
        if len(found) != wanted:
            raise self.file.error(index, f"{wanted} numbers of a matrix follow #end_set; {len(found)} do")
        return tuple(found)
