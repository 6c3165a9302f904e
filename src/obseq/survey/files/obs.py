"""OBS files: reading (`read_obs`) and writing (`write_obs`).

The grammar is MMVII's (`src/Topo/ctopodata.cpp`). We differ where it lets a mistake through:

* a sigma of 0 and a distance that is not positive are errors (MMVII: infinite weight, nonsense);
* an observation from a point to itself is an error;
* a line switched off by a negative sigma is kept, inactive; a code 7 line that is switched off still opens
  a new station (MMVII skips it, and the following readings join the previous set-up of that point);
* numbers after the sigma that are not zero (Comp3D: relative sigma, heights of instrument and target) are not
  used, as in MMVII, but the field book carries a warning.
"""

from __future__ import annotations

import math
from array import array
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.survey.files.text import (
    LEAST_SIGMA,
    TextFile,
    check_writable,
    parse_number,
    quoted,
    read_text,
)
from obseq.survey.model import (
    FieldBook,
    Observations,
    ObservationType,
    Orientation,
    Stations,
    group_by_station,
)
from obseq.writing import write_text

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

RADIANS_PER_GON = math.pi / 200.0
_WHITE_SPACE = " \t\r\f\v"
_FULL_TURN_GON = 400.0
_OPENS_STATION = 7
_CODES = {str(kind.value): kind.value for kind in ObservationType} | {str(_OPENS_STATION): _OPENS_STATION}
_KEYWORDS = {orientation.keyword: orientation for orientation in Orientation}
_NEW = "#NEW"
_COMP3D_HINTS = {
    1: "code 1 of Comp3D (horizontal distance) is not supported; give the slope distance with code 3",
    2: "code 2 of Comp3D (horizontal distance) is not supported; give the slope distance with code 3",
    8: "an azimuth (code 8 of Comp3D) is written as a line of code 5 after a line #FIX, then #VERT again",
    9: "a centring (code 9 of Comp3D) is written as lines of codes 14 and 15 after a line #FIX",
    11: "a sub-frame (code 11 of Comp3D) is written as lines of codes 14, 15 and 16 after a line #BASC",
}


def read_obs(paths: str | Path | Sequence[str | Path], encoding: str = "utf-8") -> FieldBook:
    """Reads OBS files; each starts afresh (`#VERT`, no open station), all go in one field book.

    Args:
        paths: one file, or several.
        encoding: of the point names; comments may be in any encoding.

    Raises:
        InputError: naming file and line, what is wrong and what to do.
    """
    reader = _Reader()
    for path in [paths] if isinstance(paths, str | Path) else paths:
        reader.read(read_text(path, encoding))
    return reader.field_book()


class _Reader:
    """Collects the columns of a field book, one file after another."""

    def __init__(self) -> None:
        self.names: dict[str, int] = {}
        self.files: list[str] = []
        self.warnings: list[str] = []
        self.types, self.active = array("b"), array("b")
        self.from_points, self.to_points = array("i"), array("i")
        self.values, self.sigmas = array("d"), array("d")
        self.stations, self.file_indices, self.lines = array("i"), array("i"), array("i")
        self.origins, self.orientations = array("i"), array("b")
        self.orientation = Orientation.VERT
        self.open_stations: dict[int, int] = {}

    def read(self, file: TextFile) -> None:
        """Adds the observations of one file."""
        self.orientation, self.open_stations = Orientation.VERT, {}
        self.files.append(file.name)
        before, surplus = len(self.values), []
        for index, line in enumerate(file.lines):
            fields = line.partition("*")[0].split()
            if not fields:
                continue
            if fields[0].startswith("#"):
                self._read_status(file, index, line)
            elif self._read_measure(file, index, fields):
                surplus.append(index)
        if len(self.values) == before:
            raise InputError(f"{file.name}: holds no observation (every line is empty or a comment)")
        if surplus:
            self.warnings.append(_surplus_warning(file, surplus))

    def _read_status(self, file: TextFile, index: int, line: str) -> None:
        word = line.partition("*")[0].strip(_WHITE_SPACE)
        if word not in _KEYWORDS and word != _NEW:
            known = f"{', '.join([*_KEYWORDS, _NEW])} (comments begin with *)"
            raise file.error(
                index,
                f"unknown keyword {quoted(word)!r}; alone on a line: {known}",
            )
        self.open_stations = {}
        self.orientation = _KEYWORDS.get(word, self.orientation)

    def _read_measure(self, file: TextFile, index: int, fields: list[str]) -> bool:
        """Adds one observation; true when non-zero numbers follow the sigma."""
        code = _CODES.get(fields[0]) or _slow_code(file, index, fields[0])
        if len(fields) < 5:
            raise file.error(
                index,
                f"{len(fields)} fields where at least 5 are needed: code from to value sigma",
            )
        try:
            value, sigma = parse_number(fields[3]), parse_number(fields[4])
        except ValueError as error:
            raise file.error(index, f"{error} (fields are: code from to value sigma)") from error
        kind = ObservationType.Hz if code == _OPENS_STATION else code
        if sigma >= 0.0:
            _check_measure(file, index, kind, fields, value, sigma)
        self._append(file, index, code, kind, fields, value, sigma)
        return len(fields) > 5 and _any_non_zero(fields[5:])

    def _append(
        self, file: TextFile, index: int, code: int, kind: int, fields: list[str], value: float, sigma: float
    ) -> None:
        origin, target = self._point(file, index, fields[1]), self._point(file, index, fields[2])
        unit = RADIANS_PER_GON if kind in (ObservationType.Hz, ObservationType.Zen) else 1.0
        self.types.append(kind)
        self.from_points.append(origin)
        self.to_points.append(target)
        self.values.append(value * unit)
        self.sigmas.append(abs(sigma) * unit)
        self.active.append(sigma >= 0.0)
        self.stations.append(self._station(code, origin))
        self.file_indices.append(len(self.files) - 1)
        self.lines.append(index + 1)

    def _point(self, file: TextFile, index: int, name: str) -> int:
        row = self.names.get(name)
        if row is None:
            file.check_name(index, name)
            row = self.names[name] = len(self.names)
        return row

    def _station(self, code: int, origin: int) -> int:
        """Station of a measure, opened if needed; code 7 hides the open station of its point."""
        if code in (ObservationType.Dist, ObservationType.DH):
            return -1
        station = self.open_stations.get(origin, -1)
        if station < 0 or code == _OPENS_STATION:
            station = self.open_stations[origin] = len(self.origins)
            self.origins.append(origin)
            self.orientations.append(self.orientation)
        return station

    def field_book(self) -> FieldBook:
        """Everything read; stations without an active observation are dropped."""
        active = np.array(self.active, np.bool_)
        declared = np.array(self.stations, np.int32)
        used = np.zeros(len(self.origins) + 1, np.bool_)
        used[declared[active]] = True
        used[-1] = False
        numbers = np.where(used, np.cumsum(used) - 1, -1).astype(np.int32)
        stations = numbers[declared]
        kept = used[:-1]
        starts, members = group_by_station(stations, int(kept.sum()))
        return FieldBook(
            point_names=tuple(self.names),
            observations=Observations(
                types=np.array(self.types, np.int8),
                from_points=np.array(self.from_points, np.int32),
                to_points=np.array(self.to_points, np.int32),
                values=np.array(self.values, np.float64),
                sigmas=np.array(self.sigmas, np.float64),
                active=active,
                stations=stations,
                file_indices=np.array(self.file_indices, np.int32),
                lines=np.array(self.lines, np.int32),
            ),
            stations=Stations(
                origins=np.array(self.origins, np.int32)[kept],
                orientations=np.array(self.orientations, np.int8)[kept],
                starts=starts,
                members=members,
            ),
            files=tuple(self.files),
            warnings=tuple(self.warnings),
        )


def _slow_code(file: TextFile, index: int, text: str) -> int:
    """Code of a line that is not written in the usual way, such as `05`; or the error it deserves."""
    try:
        code = int(text) if text.isascii() and "_" not in text else None
    except ValueError:
        code = None
    known = "3 Dist, 4 DH, 5 Hz, 6 Zen, 7 Hz of a new station, 14 DX, 15 DY, 16 DZ"
    if code is None:
        raise file.error(
            index, f"{quoted(text)!r} is neither a code ({known}) nor a keyword (#FIX, #VERT, #BASC, #NEW)"
        )
    if str(code) in _CODES:
        return code
    hint = _COMP3D_HINTS.get(code, "")
    if code < 0:
        hint = "to switch an observation off, give it a negative sigma"
    raise file.error(index, f"unknown code {code} (known: {known})" + (f"; {hint}" if hint else ""))


def _check_measure(
    file: TextFile, index: int, kind: int, fields: list[str], value: float, sigma: float
) -> None:
    if sigma < LEAST_SIGMA:
        raise file.error(
            index,
            f"the sigma {fields[4]} makes the weight infinite; give the standard deviation of the measure",
        )
    if kind == ObservationType.Dist and value <= 0.0:
        raise file.error(index, f"the distance {fields[3]} is not positive; correct it or switch it off")
    if kind in (ObservationType.Hz, ObservationType.Zen) and abs(value) > _FULL_TURN_GON:
        raise file.error(
            index,
            f"the angle {fields[3]} gon is beyond one turn (-400 to 400 gon)",
        )
    if fields[1] == fields[2]:
        raise file.error(index, f"point {fields[1]} is observed from itself; correct one of the two names")


def _any_non_zero(fields: list[str]) -> bool:
    """True when numbers directly after the sigma are not all zero; other text is a remark."""
    for text in fields[:3]:
        try:
            if float(text) != 0.0:
                return True
        except ValueError:
            return False
    return False


def _surplus_warning(file: TextFile, indices: list[int]) -> str:
    return (
        f"{file.name}: {len(indices)} lines carry numbers after the sigma that are not 0 (first: line "
        f"{indices[0] + 1}); relative sigmas and heights of instrument or target are not used"
    )


def write_obs(path: str | Path, book: FieldBook) -> None:
    """Writes a field book as one OBS file; `read_obs` gives it back, stations in the same order.

    Raises:
        InputError: a name cannot be written (blank or `*` inside), or the file cannot be written.
    """
    for name in book.point_names:
        check_writable(name)
    text = "\n".join(_obs_lines(book)) + "\n"
    write_text(path, text)


def _obs_lines(book: FieldBook) -> Iterable[str]:
    """Stations first, each opened by its own keyword, then distances and height differences."""
    current = Orientation.VERT
    for station in range(len(book.stations)):
        orientation = Orientation(book.stations.orientations[station])
        if station > 0 or orientation != current:
            yield orientation.keyword if orientation != current else _NEW
        current = orientation
        for row in book.stations.observations(station):
            yield _obs_line(book, int(row))
    yield from _lines_without_station(book)


def _lines_without_station(book: FieldBook) -> Iterable[str]:
    """Distances and height differences, then the switched-off readings that belong to no station."""
    rows = np.flatnonzero(book.observations.stations < 0)
    is_simple = np.isin(book.observations.types[rows], (ObservationType.Dist, ObservationType.DH))
    for row in rows[is_simple]:
        yield _obs_line(book, int(row))
    if not is_simple.all():
        yield _NEW
    for row in rows[~is_simple]:
        yield _obs_line(book, int(row))


def _obs_line(book: FieldBook, row: int) -> str:
    observations = book.observations
    kind = ObservationType(observations.types[row])
    unit = RADIANS_PER_GON if kind.is_angle else 1.0
    value, sigma = observations.values[row] / unit, observations.sigmas[row] / unit
    signed = sigma if observations.active[row] else -sigma
    origin = book.point_names[observations.from_points[row]]
    target = book.point_names[observations.to_points[row]]
    return f"{kind.value} {origin} {target} {value:.15g} {signed:.6g}"
