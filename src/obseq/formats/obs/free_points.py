"""Point files in free formats, as MMVII's `ImportGCP` reads them.

The format is a sequence of field names, such as `NXYZ` or `A N X Y Z Sx Sy Sz Bla`. We differ from MMVII
where it fails or misleads: only names that are an integer as a whole are padded with zeros (`12A` is left
alone), and coordinates are multiplied first of all, so that the mean which defines a local frame is right.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from obseq.arguments import (
    NOTHING,
    NUMBER,
    PATH,
    TEXT,
    TEXTS,
    TRUTH,
    WHOLE,
    Expected,
    expecting,
    instance,
    require,
)
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.reading.text import (
    LARGEST_LENGTH,
    TextFile,
    check_default_sigma,
    quoted,
    read_text,
)
from obseq.survey.model import Points, merge_points
from obseq.survey.point_file_options import PointFileOptions

_MANDATORY = ("N", "X", "Y", "Z")
_SIGMAS = ("Sx", "Sy", "Sz")
_KNOWN = (*_MANDATORY, "A", *_SIGMAS, "Sxyz")
_SKIP, _REST = ("?", "S"), "Bla"
_HELP = (
    "a format is made of N (name), X, Y, Z, and perhaps A (information), Sx Sy Sz or Sxyz (sigmas), "
    "? or S (field to skip), Bla at the end (ignore the rest)"
)


@dataclass(frozen=True)
class _Format:
    fields: tuple[str, ...]
    takes_rest: bool

    def __contains__(self, name: str) -> bool:
        return name in self.fields


@expecting(path=PATH, field_format=TEXT, options=instance(PointFileOptions) | NOTHING)
def read_points(path: str | Path, field_format: str, options: PointFileOptions | None = None) -> Points:
    """Reads a point file in a given format; coordinates stay in the system of the file.

    Args:
        path: the file.
        field_format: names of the fields of a line, such as `ANXYZ`.
        options: everything else.

    Raises:
        InputError: a wrong format or option; a line with a missing, unreadable or surplus field; a point
            given twice; no point at all.
    """
    chosen = options or PointFileOptions()
    layout = _parse_format(field_format)
    _check_options(layout, chosen)
    file = read_text(path, chosen.encoding)
    parts: list[tuple[str, str, list[float], list[float], int]] = []
    for index, fields in _lines(file, chosen):
        point = _read_line(file, index, fields, layout, chosen)
        if point is not None:
            parts.append(point)
    if not parts:
        raise InputError(f"{file.name}: no point found; check the comment mark and the lines to read")
    names, infos, coordinates, sigmas, lines = zip(*parts, strict=True)
    points = Points(
        names=names,
        coordinates=np.array(coordinates, np.float64) * chosen.multiplier,
        sigmas=np.array(sigmas, np.float64),
        deflections=np.full((len(names), 2), np.nan),
        infos=infos,
        files=(file.name,),
        file_indices=np.zeros(len(names), np.int32),
        lines=np.array(lines, np.int32),
    )
    return merge_points([points])


def _parse_format(text: str) -> _Format:
    """The fields of a format string."""
    compact = re.sub(r"[\s,/]", "", text)
    fields = re.findall(r"[A-Z][a-z0-9]*|\?", compact)
    if "".join(fields) != compact or not fields:
        raise InputError(f"format {text!r}: cannot be read; {_HELP}")
    takes_rest = fields[-1] == _REST
    if takes_rest:
        fields.pop()
    for field in fields:
        if field not in _SKIP and field not in _KNOWN:
            raise InputError(f"format {text!r}: unknown field {field}; {_HELP}")
        if field not in _SKIP and fields.count(field) > 1:
            raise InputError(f"format {text!r}: field {field} occurs twice")
    missing = [field for field in _MANDATORY if field not in fields]
    if missing:
        raise InputError(f"format {text!r}: {', '.join(missing)} missing; {_HELP}")
    if 0 < sum(field in fields for field in _SIGMAS) < len(_SIGMAS):
        raise InputError(f"format {text!r}: Sx, Sy and Sz go together")
    return _Format(tuple(fields), takes_rest)


def _is_pair_of_texts(value: object) -> bool:
    return TEXTS.holds(value) and isinstance(value, Sequence) and len(value) == 2


_KINDS = {
    "sigma": NUMBER | NOTHING,
    "multiplier": NUMBER,
    "name_digits": WHOLE | NOTHING,
    "name_pattern": Expected("two texts (pattern, substitution)", _is_pair_of_texts) | NOTHING,
    "free_pattern": TEXT | NOTHING,
    "first_line": WHOLE,
    "last_line": WHOLE | NOTHING,
    "comment": TEXT,
    "separator": TEXT,
    "skip_repeated": TRUTH,
    "encoding": TEXT,
}


def _check_options(layout: _Format, options: PointFileOptions) -> None:
    for name, kind in _KINDS.items():
        require("PointFileOptions", name, getattr(options, name), kind)
    sources = [name for name in ("Sx", "Sxyz") if name in layout]
    if len(sources) + (options.sigma is not None) > 1:
        raise InputError("sigmas are given twice: keep one of Sx Sy Sz, Sxyz (format) and sigma (option)")
    if options.sigma is not None:
        check_default_sigma(options.sigma, "the sigma of the points (--point-sigma, sigma)", -LARGEST_LENGTH)
    if options.free_pattern is not None and "A" not in layout:
        raise InputError("a pattern of free points (AddInfoFree) needs the field A in the format")
    if len(options.comment) > 1:
        raise InputError(f"the comment mark {options.comment!r} must be one character")
    for pattern in (options.free_pattern, options.name_pattern[0] if options.name_pattern else None):
        try:
            re.compile(pattern or "")
        except re.error as error:
            raise InputError(f"pattern {pattern!r} is not a regular expression: {error}") from error


def _lines(file: TextFile, options: PointFileOptions) -> list[tuple[int, list[str]]]:
    """(index, fields) of the lines to read."""
    last = options.last_line
    stop = len(file.lines) if last is None or last < 0 else last
    seen: set[str] = set()
    found = []
    for index in range(max(options.first_line, 0), min(stop, len(file.lines))):
        line = file.lines[index]
        if options.skip_repeated and line in seen:
            continue
        seen.add(line)
        text = line.partition(options.comment)[0] if options.comment else line
        fields = [field for field in re.split(rf"[\s,{re.escape(options.separator)}]+", text) if field]
        if fields:
            found.append((index, fields))
    return found


def _read_line(
    file: TextFile, index: int, fields: list[str], layout: _Format, options: PointFileOptions
) -> tuple[str, str, list[float], list[float], int] | None:
    """Name, information, coordinates, sigmas and line of a point; None when its name is dropped."""
    wanted = len(layout.fields)
    if len(fields) < wanted or (len(fields) > wanted and not layout.takes_rest):
        raise file.error(
            index,
            f"{len(fields)} fields where the format has {wanted} ({' '.join(layout.fields)}); correct one "
            "of the two (? skips a field, Bla ignores the rest)",
        )
    values = dict(zip(layout.fields, fields, strict=False))
    file.check_name(index, values["N"])
    name = _renamed(values["N"], options)
    if not name:
        return None
    coordinates = [_number(file, index, values, field) for field in _MANDATORY[1:]]
    info = quoted(values.get("A", ""))
    return name, info, coordinates, _sigmas(file, index, values, options), index + 1


def _renamed(name: str, options: PointFileOptions) -> str:
    """The name as the pattern makes it; then a whole number gets its digits."""
    if options.name_pattern is not None:
        pattern, substitution = options.name_pattern
        template = re.sub(r"\$(\d+|&)", lambda m: rf"\g<{0 if m[1] == '&' else m[1]}>", substitution)
        try:
            name = "".join(match.expand(template) for match in re.finditer(pattern, name))
        except (re.error, IndexError) as error:
            raise InputError(f"substitution {substitution!r} of names: {error}") from error
    if options.name_digits is not None and re.fullmatch(r"[0-9]{1,18}", name):
        name = f"{int(name):0{max(options.name_digits, 1)}d}"
    return name


def _number(file: TextFile, index: int, values: dict[str, str], field: str) -> float:
    return file.number(index, values[field], f"field {field}: {{}}")


def _sigmas(file: TextFile, index: int, values: dict[str, str], options: PointFileOptions) -> list[float]:
    """Three sigmas; NaN for free components, as negative ones are."""
    given = [options.sigma if options.sigma is not None else 1.0] * 3
    if "Sx" in values:
        given = [_number(file, index, values, field) for field in _SIGMAS]
    elif "Sxyz" in values:
        given = [_number(file, index, values, "Sxyz")] * 3
    is_free = options.free_pattern is not None and re.fullmatch(options.free_pattern, values["A"]) is not None
    return [float("nan") if is_free or sigma < 0.0 else sigma for sigma in given]
