"""Observations of a Comp3D project: its dialect of OBS files, and the files of sub-frames, axes and vectors.

Against MMVII's dialect: rounds outlive their file, there are no keywords, codes 14 and 15 are differences of
coordinates along the axes of the project, and the unit of angles is a setting.
"""

from __future__ import annotations

from obseq.formats.columns import Columns, Measure
from obseq.formats.comp3d.sets import SETS, SetReader
from obseq.formats.includes import Folder
from obseq.formats.obs.after_sigma import NOTHING, AfterSigma
from obseq.formats.obs.obs import centring, check_measure, value_and_sigma
from obseq.reading.text import TextFile, quoted
from obseq.survey.kinds.components import DX, DY
from obseq.survey.kinds.directions import AZIM, HZ, ZEN
from obseq.survey.kinds.kind import ObservationKind
from obseq.survey.kinds.lengths import DH, DIST, DIST_HZ0
from obseq.survey.model import FieldBook, Orientation

MOST_IGNORED = 8
"""Names of ignored points that a warning quotes."""
NEW_ROUND, ROUND, CENTRING = 7, 5, 9
LINES: dict[int, ObservationKind] = {
    1: DIST,
    2: DIST_HZ0,
    3: DIST,
    4: DH,
    ROUND: HZ,
    6: ZEN,
    NEW_ROUND: HZ,
    8: AZIM,
    CENTRING: DX,
    14: DX,
    15: DY,
}
"""Kind of the lines of each code; a centring makes two observations."""
OWN_STATION = {8: Orientation.FIX, CENTRING: Orientation.GRID, 14: Orientation.GRID, 15: Orientation.GRID}
"""How the stations are turned that hold one line of these codes and no other."""


def read_observations(
    folder: Folder, name: str, unit: float, ignored: frozenset[str], *, has_place: bool
) -> FieldBook:
    """Reads the observations of a project.

    Args:
        folder: The folder of the project.
        name: Its OBS file.
        unit: Radians in one unit of angles.
        ignored: Points whose observations are left out.
        has_place: Whether the project is georeferenced: geocentric vectors have a meaning.

    Raises:
        InputError: Naming file and line, what is wrong and what to do.
    """
    reader = _Reader(folder, unit, ignored, has_place)
    for file, index, fields in folder.lines(name, reader.open_file):
        reader.read_line(file, index, fields)
    if reader.n_ignored:
        names = sorted(ignored)
        shown = ", ".join(names[:MOST_IGNORED]) + (" ..." if len(names) > MOST_IGNORED else "")
        reader.columns.warnings.append(
            f"{reader.n_ignored} lines of observations name points that are to be ignored (-1: {shown}): "
            "left out"
        )
    return reader.columns.field_book()


class _Reader:
    def __init__(self, folder: Folder, unit: float, ignored: frozenset[str], has_place: bool) -> None:
        self.folder, self.unit, self.ignored = folder, unit, ignored
        self.columns = Columns()
        self.rounds: dict[int, int] = {}
        self.plumb: dict[int, int] = {}
        self.numbers: dict[str, int] = {}
        self.n_ignored = 0
        self.sets = SetReader(folder, self.columns, unit, ignored, has_place)

    def open_file(self, file: TextFile) -> None:
        """A file whose lines follow."""
        self.numbers[file.name] = self.columns.open_file(file)

    def read_line(self, file: TextFile, index: int, fields: list[str]) -> None:
        """Adds the observations of one line."""
        code = _code(file, index, fields[0])
        if abs(code) in SETS:
            if code < 0:
                raise file.error(index, "a file of observations has no sign; switch off the lines inside it")
            self.n_ignored += self.sets.read(code, file, index, fields)
            return
        if len(fields) < 5:
            raise file.error(
                index, f"{len(fields)} fields where at least 5 are needed: code from to value sigma"
            )
        if self.ignored.intersection(fields[1:3]):
            self.n_ignored += 1
            return
        for measure in self._measures(file, index, code, fields):
            self.columns.append(measure, self.numbers[file.name], index)

    def _measures(self, file: TextFile, index: int, signed: int, fields: list[str]) -> tuple[Measure, ...]:
        code, is_on = abs(signed), signed > 0
        kind = LINES[code]
        value, sigma = value_and_sigma(file, index, fields)
        unit, is_active = (self.unit if kind.is_angle else 1.0), is_on and sigma >= 0.0
        if is_active and code != CENTRING:
            check_measure(file, index, kind, fields, value * unit, sigma)
        rest = AfterSigma(file, frozenset())
        after = (
            rest.read(index, kind.is_angle or code == CENTRING, fields[5:]) if len(fields) > 5 else NOTHING
        )
        origin, target = (self.columns.point(file, index, name) for name in fields[1:3])
        station = self._station(code, origin)
        if code == CENTRING:
            return centring(origin, target, station, sigma, after, is_on)
        return (Measure(kind, origin, target, value * unit, sigma * unit, is_active, *after, station),)

    def _station(self, code: int, origin: int) -> int:
        """Station of a line: a round; for a zenith angle any plumb station; else one of its own."""
        if not LINES[code].needs_station:
            return -1
        if code in OWN_STATION:
            return self.columns.open_station(origin, OWN_STATION[code])
        known = self.plumb if code == 6 else self.rounds
        if code == NEW_ROUND or origin not in known:
            station = self.columns.open_station(origin, Orientation.VERT)
            self.plumb[origin] = station
            if code != 6:
                self.rounds[origin] = station
            return station
        return known[origin]


def _code(file: TextFile, index: int, text: str) -> int:
    try:
        code = int(text)
    except ValueError:
        code = 0
    if abs(code) not in LINES and abs(code) not in SETS:
        known = ", ".join(str(number) for number in sorted((*LINES, *SETS)))
        raise file.error(index, f"{quoted(text)!r} is not a code of Comp3D ({known})")
    return code
