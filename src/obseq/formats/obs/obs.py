"""OBS files: reading (`read_obs`) and writing (`write_obs`).

The grammar is MMVII's (`src/Topo/ctopodata.cpp`). We differ where it lets a mistake through:

* a sigma of 0 and a distance that is not positive are errors (MMVII: infinite weight, nonsense);
* an observation from a point to itself is an error;
* a line switched off by a negative sigma is kept, inactive; a code 7 line that is switched off still opens
  a new station (MMVII skips it, and the following readings join the previous set-up of that point);
* numbers after the sigma are relative sigma and heights of instrument and target, as in Comp3D (see
  `after_sigma`); MMVII ignores them.

Codes that only Comp3D has: 1, the same as 3; 8, an azimuth, which belongs to no round; 9, a plane centring,
two components of value 0; a minus before the code switches a line off.

A keyword of ours: `#INSTRUMENT TS15` names the instrument of the lines that follow.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path

import numpy as np

from obseq.arguments import PATH, PATHS, TEXT, WORDS, expecting, instance
from obseq.errors import InputError
from obseq.formats.columns import Columns, Measure
from obseq.formats.obs.after_sigma import NOTHING, AfterSigma, Triple, checked_ignore
from obseq.formats.once import require_distinct
from obseq.reading.text import (
    LEAST_SIGMA,
    TextFile,
    check_writable,
    parse_number,
    quoted,
    read_text,
    words,
)
from obseq.survey.kinds.components import DX, DY
from obseq.survey.kinds.directions import AZIM, HZ
from obseq.survey.kinds.kind import ObservationKind
from obseq.survey.kinds.lengths import DIST
from obseq.survey.kinds.registry import BY_CODE, KINDS
from obseq.survey.model import FieldBook, GroupKind, Observations, Orientation
from obseq.writing import write_text

RADIANS_PER_GON = math.pi / 200.0
_WHITE_SPACE = " \t\r\f\v"
_OPENS_STATION = 7
_SLOPE, _CENTRING = 1, 9
_LINES: dict[int, ObservationKind] = {kind.code: kind for kind in KINDS if kind.is_line} | {
    _OPENS_STATION: HZ,
    _SLOPE: DIST,
    _CENTRING: DX,
}
"""Kind of the (first) observation that a line of each code makes."""
_CODES = {str(sign * code): (code, sign < 0) for code in _LINES for sign in (1, -1)}
"""Codes as lines begin with them: the code, and whether a minus before it switches the line off."""
_UNITS = {
    code: (RADIANS_PER_GON if kind.is_angle else 1.0, kind.is_angle or code == _CENTRING)
    for code, kind in _LINES.items()
}
"""Metres or radians in the unit of a line of each code, and whether its relative sigma is a length."""
_ALONE = (AZIM.code, _CENTRING)
"""Codes whose lines are stations of their own, in the axes of the place."""
_KEYWORDS = {orientation.keyword: orientation for orientation in Orientation}
_NEW = "#NEW"
_INSTRUMENT = "#INSTRUMENT"
"""What names the instrument of the lines that follow, for unknowns of its own; alone it ends that."""
_ALL_KEYWORDS = ", ".join([*_KEYWORDS, _NEW, _INSTRUMENT])
_KNOWN = ", ".join(
    [f"{kind.code} {kind.name}" for kind in KINDS if kind.is_line]
    + [f"{_SLOPE} as 3", f"{_OPENS_STATION} Hz of a new station", f"{_CENTRING} centring"]
)
_HINTS = {
    11: "a sub-frame (code 11 of Comp3D) is read in Comp3D projects; in an OBS file write its lines with "
    "codes "
    "14, 15 and 16 after a line #BASC",
    12: "a polar sub-frame (code 12 of Comp3D) is read in Comp3D projects only",
    18: "an axis of rotation (code 18 of Comp3D) is read in Comp3D projects only",
    19: "a baseline (code 19 of Comp3D) is read in Comp3D projects only",
    21: "equal height differences (code 21 of Comp3D) are read in Comp3D projects only",
    22: "equal distances (code 22 of Comp3D) are read in Comp3D projects only",
}


@expecting(paths=PATHS, encoding=TEXT, ignore=WORDS)
def read_obs(
    paths: str | Path | Sequence[str | Path], encoding: str = "utf-8", ignore: Collection[str] = ()
) -> FieldBook:
    """Reads OBS files; each starts afresh (`#VERT`, no open station), all go in one field book.

    Args:
        paths: one file, or several.
        encoding: of the point names; comments may be in any encoding.
        ignore: what is to be left out, with a warning (see `after_sigma.IGNORABLE`).

    Raises:
        InputError: naming file and line, what is wrong and what to do; or the same file given twice.
    """
    reader, files = _Reader(checked_ignore(ignore)), [paths] if isinstance(paths, str | Path) else paths
    require_distinct(files)
    for path in files:
        reader.read(read_text(path, encoding))
    return reader.columns.field_book()


class _Reader:
    """Reads one file after another into the columns of a field book."""

    def __init__(self, ignored: frozenset[str]) -> None:
        self.ignored = ignored
        self.columns = Columns()
        self.orientation = Orientation.VERT
        self.open_stations: dict[int, int] = {}
        self.instrument = -1

    def read(self, file: TextFile) -> None:
        """Adds the observations of one file."""
        self.orientation, self.open_stations, self.instrument = Orientation.VERT, {}, -1
        self.number = self.columns.open_file(file)
        before, rest = len(self.columns), AfterSigma(file, self.ignored)
        for index, line in enumerate(file.lines):
            fields = words(line.partition("*")[0])
            if not fields:
                continue
            if fields[0].startswith("#"):
                self._read_status(file, index, line)
            else:
                self._read_measure(file, index, fields, rest)
        if len(self.columns) == before:
            raise InputError(f"{file.name}: holds no observation (every line is empty or a comment)")
        self.columns.warnings.extend(rest.warnings())

    def _read_status(self, file: TextFile, index: int, line: str) -> None:
        word = line.partition("*")[0].strip(_WHITE_SPACE)
        first, *name = word.split(maxsplit=1)
        if first == _INSTRUMENT:
            file.check_name(index, " ".join(name))
            self.instrument = self.columns.instrument(" ".join(name))
            return
        if word not in _KEYWORDS and word != _NEW:
            known = f"{_ALL_KEYWORDS} (comments begin with *)"
            raise file.error(index, f"unknown keyword {quoted(word)!r}; alone on a line: {known}")
        self.open_stations = {}
        self.orientation = _KEYWORDS.get(word, self.orientation)

    def _read_measure(self, file: TextFile, index: int, fields: list[str], rest: AfterSigma) -> None:
        """Adds the observations of one line."""
        code, is_off = _CODES.get(fields[0]) or _code(file, index, fields[0])
        if len(fields) < 5:
            raise file.error(
                index,
                f"{len(fields)} fields where at least 5 are needed: code from to value sigma",
            )
        value, sigma = value_and_sigma(file, index, fields)
        kind, (unit, is_length) = _LINES[code], _UNITS[code]
        is_active = sigma >= 0.0 and not is_off
        if is_active:
            check_measure(file, index, kind, fields, value * unit, sigma)
        after = rest.read(index, is_length, fields[5:]) if len(fields) > 5 else NOTHING
        columns = self.columns
        origin, target = columns.point(file, index, fields[1]), columns.point(file, index, fields[2])
        station = self._station(code, origin) if kind.needs_station else -1
        if code == _CENTRING:
            for measure in centring(origin, target, station, sigma, after, not is_off):
                columns.append(measure._replace(group=self.instrument), self.number, index)
            return
        integers = (kind.code, origin, target, -1, station, self.instrument, self.number, index + 1)
        columns.add(integers, (value * unit, abs(sigma) * unit, *after), is_active)

    def _station(self, code: int, origin: int) -> int:
        """Station of a measure, opened if needed; code 7 hides the open station of its point.

        An azimuth or a centring is a station of its own, and leaves the open ones as they are.
        """
        if code in _ALONE:
            return self.columns.open_station(origin, Orientation.FIX)
        station = self.open_stations.get(origin, -1)
        if station < 0 or code == _OPENS_STATION:
            station = self.columns.open_station(origin, self.orientation)
            self.open_stations[origin] = station
        return station


def centring(
    origin: int, target: int, station: int, sigma: float, after: Triple, is_on: bool
) -> tuple[Measure, ...]:
    """Two components of value 0; the first number after the sigma is the sigma of the second, if any."""
    second = after[0] if abs(after[0]) > LEAST_SIGMA else sigma
    return tuple(
        Measure(kind, origin, target, 0.0, spread, spread >= 0.0 and is_on, 0.0, *after[1:], station)
        for kind, spread in ((DX, sigma), (DY, second))
    )


def _code(file: TextFile, index: int, text: str) -> tuple[int, bool]:
    """Code of a line that writes it in another way (05, +5), and whether a minus switches the line off."""
    try:
        code = int(text) if text.isascii() and "_" not in text else None
    except ValueError:
        code = None
    if code is None:
        raise file.error(
            index, f"{quoted(text)!r} is neither a code ({_KNOWN}) nor a keyword ({_ALL_KEYWORDS})"
        )
    if abs(code) not in _LINES:
        hint = _HINTS.get(abs(code), "")
        raise file.error(index, f"unknown code {code} (known: {_KNOWN})" + (f"; {hint}" if hint else ""))
    return abs(code), code < 0


def value_and_sigma(file: TextFile, index: int, fields: list[str]) -> tuple[float, float]:
    """Value and sigma of a line, in its units."""
    try:
        return parse_number(fields[3]), parse_number(fields[4])
    except ValueError as error:
        raise file.error(
            index, f"{error} (fields are: code from to value sigma; a name has no blanks)"
        ) from error


def check_measure(
    file: TextFile, index: int, kind: ObservationKind, fields: list[str], value: float, sigma: float
) -> None:
    """Refuses an infinite weight, a value (m or rad) that its kind cannot have, a point seen from itself."""
    if sigma < LEAST_SIGMA:
        raise file.error(
            index,
            f"the sigma {fields[4]} makes the weight infinite; give the standard deviation of the measure",
        )
    problem = kind.problem(value)
    if problem is not None:
        raise file.error(
            index, f"the value {fields[3]} ({kind.words}) {problem}; correct it or switch it off"
        )
    if fields[1] == fields[2]:
        raise file.error(index, f"point {fields[1]} is observed from itself; correct one of the two names")


@expecting(path=PATH, book=instance(FieldBook))
def write_obs(path: str | Path, book: FieldBook) -> None:
    """Writes a field book as one OBS file; `read_obs` gives it back, stations in the same order.

    Raises:
        InputError: a name cannot be written (blank or `*` inside), or the file cannot be written.
    """
    write_text(path, obs_text(book))


def obs_text(book: FieldBook) -> str:
    """The text of an OBS file, as `write_obs` writes it.

    Raises:
        InputError: a name or an observation cannot be written.
    """
    for name in book.point_names:
        check_writable(name)
    rows = book.observations
    without = np.flatnonzero(~np.isin(rows.types, [kind.code for kind in KINDS if kind.is_line]))
    if without.size:
        words = BY_CODE[int(rows.types[without[0]])].words
        raise InputError(f"{book.label(int(without[0]))}: an OBS file has no line for this ({words})")
    if book.clusters:
        first = book.label(int(book.clusters[0].rows[0]))
        raise InputError(
            f"{first}: it is correlated with others, which an OBS file cannot say; write .obs.csv (or "
            ".gkf, in a plane)"
        )
    return "\n".join(_with_instruments(book)) + "\n"


def _with_instruments(book: FieldBook) -> Iterable[str]:
    """The lines, with the names of the instruments before the first one of each."""
    named, current = book.in_groups(GroupKind.INSTRUMENT), -1
    for line in _obs_lines(book):
        if isinstance(line, str):
            yield line
            continue
        group = int(book.observations.groups[line]) if named[line] else -1
        if group != current:
            yield f"{_INSTRUMENT} {book.groups[group].name}" if group >= 0 else _INSTRUMENT
        current = group
        yield _obs_line(book, line)


def _obs_lines(book: FieldBook) -> Iterable[str | int]:
    """Keywords, and rows: stations first, each opened by its own, then distances and height differences."""
    current = Orientation.VERT
    for station in range(len(book.stations)):
        orientation = Orientation(book.stations.orientations[station])
        if station > 0 or orientation != current:
            yield orientation.keyword if orientation != current else _NEW
        current = orientation
        for row in book.stations.observations(station):
            yield int(row)
    yield from _lines_without_station(book)


def _lines_without_station(book: FieldBook) -> Iterable[str | int]:
    """Rows of distances and height differences, then the switched-off readings that belong to no station."""
    rows = np.flatnonzero(book.observations.stations < 0)
    with_axes = [kind.code for kind in KINDS if kind.needs_station]
    is_simple = ~np.isin(book.observations.types[rows], with_axes)
    for row in rows[is_simple]:
        yield int(row)
    if not is_simple.all():
        yield _NEW
    for row in rows[~is_simple]:
        yield int(row)


def _obs_line(book: FieldBook, row: int) -> str:
    observations = book.observations
    kind = BY_CODE[int(observations.types[row])]
    unit = RADIANS_PER_GON if kind.is_angle else 1.0
    value, sigma = observations.values[row] / unit, observations.sigmas[row] / unit
    signed = sigma if observations.active[row] else -sigma
    origin = book.point_names[observations.from_points[row]]
    target = book.point_names[observations.to_points[row]]
    return f"{kind.code} {origin} {target} {value:.15g} {signed:.6g}{_rest(observations, row)}"


def _rest(observations: Observations, row: int) -> str:
    """Relative sigma and heights, when there are some."""
    relative, origin, target = (
        float(column[row])
        for column in (observations.relative_sigmas, observations.from_heights, observations.to_heights)
    )
    if origin or target:
        return f" {relative:.6g} {origin:.9g} {target:.9g}"
    return f" {relative:.6g}" if relative else ""
