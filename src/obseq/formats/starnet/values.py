"""Values of STAR*NET files: angles, bearings, standard errors, heights of instrument and target."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import replace

from obseq.dataclass import dataclass
from obseq.reading.angles import DASHED, GON, SECOND, dashed, dms
from obseq.reading.text import TextFile, quoted
from obseq.records.shown_units import ShownUnits, length_named

FEET = {"feetus": 1200.0 / 3937.0, "feetint": 0.3048}
FREE, FIXED, DEFAULT, NOT_MEASURED = "*", "!", "&", "?"
MARKS = (FREE, FIXED, DEFAULT)
HELD_LENGTH, HELD_ANGLE = 1e-6, 1e-9
"""Standard deviations (m, rad) of observations that are fixed (`!`)."""
_JOINED = re.compile(r"[*!&]{2,}")
"""Codes of standard errors that are written together."""
FULL_TURN = 2.0 * math.pi * (1.0 + 1e-12)
_PACKED = re.compile(r"([+-]?)(\d{1,3})(?:\.(\d*))?", re.ASCII)
_BEARING = re.compile(r"([NS])(.+)([EW])", re.IGNORECASE)


@dataclass(frozen=True)
class Options:
    """What inline options have said so far.

    Attributes:
        metres: In one unit of length.
        has_gons: Whether angles are in gon, not in degrees, minutes and seconds.
        is_plane: Whether the network has no heights; None while nothing has said it.
        east_first: Whether eastings come before northings.
        from_first: Whether angles are named From-At-To, not At-From-To.
        delta: Whether distances are horizontal, with height differences.
        separator: Between the names of points.
        refraction: Coefficient of zenith angles (k, twice that of STAR*NET).
        is_on: Whether data lines are read.
        instrument: Name of the instrument; empty for none.
        correlations: Whether GNSS vectors have standard errors and correlations, not covariances.
        factor: What the standard errors of GNSS vectors are multiplied by.
        vertical: What those along the vertical are multiplied by, beyond that.
        adds_centring: Whether centring counts for standard errors that stand in lines too.
    """

    metres: float = 1.0
    has_gons: bool = False
    is_plane: bool | None = None
    east_first: bool = False
    from_first: bool = False
    delta: bool = False
    separator: str = "-"
    refraction: float = 0.14
    is_on: bool = True
    instrument: str = ""
    correlations: bool = False
    factor: float = 1.0
    vertical: float = 1.0
    adds_centring: bool = False

    @property
    def shown(self) -> ShownUnits:
        """Units of reports: those of the file."""
        return ShownUnits(length_named(self.metres), "gon" if self.has_gons else "dms")


def fields_of(text: str) -> tuple[str, ...]:
    """The fields of a line; codes that are written together (`!!*`) are as many fields."""
    found: list[str] = []
    for word in text.split():
        found += word if _JOINED.fullmatch(word) else [word]
    return tuple(found)


@dataclass(frozen=True)
class Line:
    """A data line.

    Attributes:
        file: Its file.
        index: Its number, from 0.
        fields: What stands in it.
        options: In force there.
    """

    file: TextFile
    index: int
    fields: tuple[str, ...]
    options: Options

    @property
    def is_option(self) -> bool:
        """Whether it changes how others are read."""
        return self.fields[0].startswith(".")

    def error(self, problem: str) -> Exception:
        """An error about this line."""
        return self.file.error(self.index, problem)

    def number(self, text: str) -> float:
        """A finite number."""
        return self.file.number(self.index, text)

    def length(self, text: str) -> float:
        """A length, in metres."""
        return self.number(text) * self.options.metres

    def angle(self, text: str) -> float:
        """An angle in gon, `d-m-s` or packed `d.mmss`, in radians; at most a turn."""
        found = self.number(text) * GON if self.options.has_gons else self._dms(text)
        if abs(found) > FULL_TURN:
            raise self.error(f"the angle {text} is beyond one turn")
        return found

    def _dms(self, text: str) -> float:
        try:
            found = dashed(text)
            if found is None and _PACKED.fullmatch(text):
                found = dms(text)
        except ValueError as error:
            packed = "" if DASHED.fullmatch(text) else " (it is read as packed ddd.mmss)"
            raise self.error(f"the angle {text}: {error}{packed}") from error
        if found is None:
            raise self.error(f"{quoted(text)!r} is no angle: ddd-mm-ss.s, or packed ddd.mmss")
        return found

    def bearing(self, text: str) -> float:
        """An azimuth, or a bearing such as `N23-10-15E`, in radians from north."""
        found = _BEARING.fullmatch(text)
        if found is None:
            return self.angle(text)
        angle = self.angle(found[2])
        from_north = angle if found[1].upper() == "N" else math.pi - angle
        return from_north if found[3].upper() == "E" else -from_north

    def fixed_bearing(self, text: str) -> float | None:
        """The bearing or azimuth that stands in place of the name of a backsight; None for a name.

        As in STAR*NET it is one when it has dashes and can be read so.
        """
        found = _BEARING.fullmatch(text)
        is_bearing = DASHED.fullmatch(found[2] if found else text) is not None
        return self.bearing(text) if is_bearing else None

    def names(self, text: str, count: int) -> list[str]:
        """Names of points in one text.

        Raises:
            InputError: There are more or fewer, or one occurs twice.
        """
        names = text.split(self.options.separator)
        if len(names) != count or not all(names):
            shape = self.options.separator.join(("At", "From", "To")[-count:])
            raise self.error(f"{quoted(text)!r} is not {shape}; the separator of names is set by .SEP")
        if len(set(names)) < count:
            raise self.error(f"{quoted(text)!r} names a point twice; correct one of the names")
        return names

    def three(self, text: str) -> tuple[str, str, str]:
        """At, from and to of an angle, whatever their order in the file."""
        first, second, target = self.names(text, 3)
        return (second, first, target) if self.options.from_first else (first, second, target)


@dataclass(frozen=True)
class Sigma:
    """A standard error as written.

    Attributes:
        value: In metres or radians; None for the default.
        is_active: False when it is free: the observation has no part.
        is_fixed: Whether the observation is to be held.
    """

    value: float | None = None
    is_active: bool = True
    is_fixed: bool = False


def sigma_of(line: Line, text: str, is_angle: bool) -> Sigma:
    """A standard error: a number, `&` default, `!` fixed or `*` free."""
    if text == DEFAULT:
        return Sigma()
    if text == FREE:
        return Sigma(None, is_active=False)
    if text == FIXED:
        return Sigma(HELD_ANGLE if is_angle else HELD_LENGTH, is_fixed=True)
    value = line.number(text)
    if value <= 0.0:
        raise line.error(f"the standard error {text} is not above zero; `!` holds, `*` frees")
    unit = (GON * 1e-3 if line.options.has_gons else SECOND) if is_angle else line.options.metres
    return Sigma(value * unit)


def split_rest(
    line: Line, texts: tuple[str, ...], angles: tuple[bool, ...]
) -> tuple[list[Sigma], tuple[float, float]]:
    """Standard errors of values, and heights of instrument and target, of what follows the values.

    Args:
        line: The line.
        texts: What follows.
        angles: Of each value, whether it is an angle.
    """
    heights = [text for text in texts if "/" in text]
    errors = [text for text in texts if "/" not in text]
    if len(heights) > 1 or len(errors) not in (0, len(angles)) or (heights and texts[-1] != heights[0]):
        raise line.error(
            f"{len(texts)} fields after the values: {len(angles)} standard errors, perhaps HI/HT"
            " after them, are possible"
        )
    pair = (0.0, 0.0)
    if heights:
        parts = heights[0].split("/")
        if len(parts) != 2:
            raise line.error(f"{quoted(heights[0])!r} is not HI/HT")
        pair = (line.length(parts[0]), line.length(parts[1]))
    found = [sigma_of(line, text, is_angle) for text, is_angle in zip(errors, angles, strict=False)]
    return found or [Sigma()] * len(angles), pair


def changed(options: Options, line: Line) -> Options:
    """The options after a dot line.

    Raises:
        InputError: Nobody here knows it, or it needs what is not there.
    """
    word, *rest = (field.lower() for field in line.fields)
    simple: Mapping[str, dict[str, object]] = {".2d": {"is_plane": True}, ".3d": {"is_plane": False}}
    if word in simple and not rest:
        return replace(options, **simple[word])  # type: ignore[arg-type]  # names and kinds are those above
    change = _CHANGES.get(full_name(word))
    if change is not None:
        return change(options, line, rest)
    raise line.error(
        f"the option {quoted(line.fields[0])} is not known here (known: .2D, .3D, .INCLUDE, .END, "
        f"{', '.join(_CHANGES).upper()}); remove it, or say what it says in another way"
    )


def full_name(word: str) -> str:
    """The name of an option that may be abbreviated as far as it stays the only one; else the word itself."""
    if word in NAMES:
        return word
    found = [name for name in NAMES if name.startswith(word)]
    return found[0] if len(found) == 1 else word


def _units(options: Options, line: Line, rest: list[str]) -> Options:
    for word in rest:
        if "meters".startswith(word) and word:
            options = replace(options, metres=1.0)
        elif word in FEET:
            options = replace(options, metres=FEET[word])
        elif word.startswith("feet"):
            raise line.error("which foot? write .UNITS FeetUS (1200/3937 m) or FeetInt (0.3048 m)")
        elif "gons".startswith(word) or word == "grads":
            options = replace(options, has_gons=True)
        elif word == "dms":
            options = replace(options, has_gons=False)
        else:
            raise line.error(f"{quoted(word)!r} is none of Meters, FeetUS, FeetInt, DMS, GONS")
    return options


def _order(options: Options, line: Line, rest: list[str]) -> Options:
    for word in rest:
        if word in ("ne", "en"):
            options = replace(options, east_first=word == "en")
        elif word in ("atfromto", "fromatto"):
            options = replace(options, from_first=word == "fromatto")
        else:
            raise line.error(f"{quoted(word)!r} is none of NE, EN, AtFromTo, FromAtTo")
    return options


def _switch(line: Line, rest: list[str]) -> bool:
    if rest not in (["on"], ["off"]):
        raise line.error(f"{line.fields[0]} is ON or OFF")
    return rest == ["on"]


def _separator(options: Options, line: Line, rest: list[str]) -> Options:
    if len(rest) != 1 or len(rest[0]) != 1 or rest[0].isalnum():
        raise line.error(".SEP is followed by one character that is neither a letter nor a digit")
    return replace(options, separator=rest[0])


def _refraction(options: Options, line: Line, rest: list[str]) -> Options:
    if len(rest) != 1:
        raise line.error(".REFRACTION is followed by the coefficient, such as 0.07")
    return replace(options, refraction=2.0 * line.number(rest[0]))


def _gps(options: Options, line: Line, rest: list[str]) -> Options:
    if len(rest) == 2 and rest[0] == "weight":
        for name, correlations in (("covariance", False), ("stderrcorrelation", True)):
            if name.startswith(rest[1]):
                return replace(options, correlations=correlations)
    if rest[::2] in (["factor"], ["factor", "vert"]) and len(rest) % 2 == 0:
        factor, vertical = line.number(rest[1]), line.number(rest[-1])
        if factor > 0.0 and vertical > 0.0:
            return replace(options, factor=factor, vertical=vertical / factor)
    raise line.error(
        ".GPS is followed by WEIGHT COVARIANCE, WEIGHT STDERRCORRELATION, or FACTOR and a number above zero, "
        "perhaps VERT and another one"
    )


_CHANGES: dict[str, Callable[[Options, Line, list[str]], Options]] = {
    ".units": _units,
    ".order": _order,
    ".delta": lambda options, line, rest: replace(options, delta=_switch(line, rest)),
    ".data": lambda options, line, rest: replace(options, is_on=_switch(line, rest)),
    ".sep": _separator,
    ".refraction": _refraction,
    ".instrument": lambda options, line, _: replace(options, instrument=" ".join(line.fields[1:])),
    ".gps": _gps,
    ".addcentering": lambda options, line, rest: replace(options, adds_centring=_switch(line, rest)),
}
"""What the options change, by their full names."""
NAMES = (
    *(
        ".2d",
        ".3d",
        *_CHANGES,
        ".include",
        ".end",
        ".title",
        ".loststations",
        ".pswt",
        ".plot",
        ".ptolerance",
        ".alias",
    ),
    *(".average", ".copyexternal", ".curvature", ".edm", ".elevation", ".ellipse", ".geoid", ".lweight"),
    *(
        ".mapmode",
        ".mapscale",
        ".measure",
        ".multiplier",
        ".network",
        ".prism",
        ".relative",
        ".scale",
        ".vscale",
    ),
)
"""Options of STAR*NET: those that are not read make abbreviations ambiguous."""
