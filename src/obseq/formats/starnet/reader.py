"""Data files of STAR*NET (`.dat`): points, observations, traverses, direction sets and inline options.

Such a file is half of a project: dimension, units and standard errors may stand in the project file
(`.snproj`, `.prj`). Without that, what the data files do not say is asked for (`--sigmas`) or told (metres
and degrees).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from obseq.formats.columns import Columns
from obseq.formats.includes import DEEPEST, Folder
from obseq.formats.levelled_points import hold_plans, with_heights
from obseq.formats.project import Project, Reading, only_one
from obseq.formats.starnet.observations import CODES, ObservationLines
from obseq.formats.starnet.points import PointLines
from obseq.formats.starnet.project_file import read_project_file
from obseq.formats.starnet.values import Line, Options, changed, fields_of, full_name
from obseq.formats.starnet.vectors import CODES as VECTORS
from obseq.formats.starnet.vectors import VectorLines
from obseq.formats.stochastic import StochasticModel
from obseq.printable import listed
from obseq.reading.text import TextFile, read_text

PROJECTS = (".snproj", ".prj")
"""Suffixes of project files."""
SHOWN = 5
"""Names of many that a warning gives."""
REFUSED = {
    "p": "geographic coordinates need a datum, which such a file does not name; give grid coordinates (C)",
    "ph": "geographic coordinates need a datum, which such a file does not name; give grid coordinates (C)",
    "ch": "ellipsoidal heights need a geoid, which such a file does not name; give elevations (C)",
    "eh": "ellipsoidal heights need a geoid, which such a file does not name; give elevations (E)",
}
"""Codes that are known and not read, with the reason."""
IGNORED_OPTIONS = (
    ".title",
    ".loststations",
    ".pswt",
    ".plot",
    ".ellipse",
    ".relative",
    ".ptolerance",
    ".copyexternal",
)
"""Options that change nothing of an adjustment."""


def read_starnet(paths: tuple[Path, ...], reading: Reading) -> Project:
    """Reads data files of STAR*NET, one after the other, with those that they include; or a project file.

    Args:
        paths: The data files, or the project file.
        reading: How to read them; `sigmas` are what stands for missing standard errors.

    Raises:
        InputError: Naming file and line, what is wrong and what to do.
    """
    if paths[0].suffix.lower() in PROJECTS:
        return _read_project(only_one(paths), reading)
    model = StochasticModel(reading.sigmas, reading.instruments)
    reader = _Reader(Folder(paths[0].parent, reading.encoding, reading.outside), model, Options())
    reader.has_defaults = bool(reading.sigmas)
    for path in paths:
        reader.read_file(path)
    return reader.project()


def _read_project(path: Path, reading: Reading) -> Project:
    """The network of a project file; options of the user go before what it says."""
    given = read_project_file(path, reading.encoding)
    own = given.model
    model = StochasticModel({**own.default, **reading.sigmas}, {**own.instruments, **reading.instruments})
    reader = _Reader(Folder(path.parent, reading.encoding, reading.outside), model, given.options)
    reader.has_units = True
    for name in given.files:
        reader.read_file(reader.folder.path(name))
    found = reader.project()
    told = []
    if given.others:
        told.append(f"{path}: {len(given.others)} data files take no part: {listed(given.others, SHOWN)}")
    if given.grid and given.points_crs is None:
        told.append(
            f"{path}: its grid {given.grid} is not known here: give --points-crs, or a plane is taken"
        )
    return replace(found, points_crs=given.points_crs or found.points_crs, book=found.book.warned(*told))


class _Reader:
    def __init__(self, folder: Folder, model: StochasticModel, options: Options) -> None:
        self.folder = folder
        self._options = options
        self._model = model
        self._columns = Columns()
        self._files: dict[str, int] = {}
        self._points = PointLines()
        self._observations = ObservationLines(self._columns, self._files, model)
        self._vectors = VectorLines(self._columns, self._files)
        self._skipped: list[int] = []
        self.has_defaults = self.has_units = self._is_over = False
        self._first: TextFile | None = None

    def read_file(self, path: Path) -> None:
        """Takes all lines of a data file; the options at its end hold in the next one."""
        self._is_over = False
        for line in self._lines(path):
            self.read(line)

    def _lines(self, path: Path, depth: int = 0) -> Iterator[Line]:
        """The lines that hold something, those of included files in place."""
        file = read_text(path, self.folder.encoding)
        self._first = self._first or file
        self._files.setdefault(file.name, self._columns.open_file(file))
        for index, text in enumerate(file.lines):
            fields = fields_of(text.partition("#")[0].partition("'")[0])
            if self._is_over or not fields:
                continue
            line = Line(file, index, fields, self._options)
            if line.is_option and full_name(fields[0].lower()) == ".include":
                if len(fields) != 2 or depth == DEEPEST:
                    raise line.error(
                        f".INCLUDE names one file, {DEEPEST} levels deep at most; is there a loop?"
                    )
                yield from self._lines(self.folder.path(fields[1], path.parent), depth + 1)
            else:
                yield line

    def read(self, line: Line) -> None:
        """Takes one line."""
        word = line.fields[0].lower()
        if line.is_option:
            self._read_option(line, full_name(word))
        elif not self._options.is_on:
            self._skipped.append(line.index + 1)
        elif word in REFUSED:
            raise line.error(
                f"{line.fields[0]} is a record which obseq cannot adjust from here: {REFUSED[word]}"
            )
        elif word in ("c", "e"):
            self._settle(self._points.read(line))
        elif word in VECTORS:
            self._vectors.read(line)
        elif word in CODES:
            self._observations.read(line)
        else:
            raise line.error(
                f"unknown code {line.fields[0][:20]!r} (known: C, E, {', '.join(CODES).upper()})"
            )

    def _read_option(self, line: Line, name: str) -> None:
        self.has_units |= name == ".units"
        if name == ".end":
            self._is_over = True
        elif name not in IGNORED_OPTIONS:
            self._options = changed(self._options, line)

    def _settle(self, is_plane: bool | None) -> None:
        """Takes the dimension of the network from its first point where no option has said it."""
        if self._options.is_plane is None and is_plane is not None:
            self._options = replace(self._options, is_plane=is_plane)

    def project(self) -> Project:
        """The network, once all lines are read."""
        assert self._first is not None
        self._observations.finish()
        self._vectors.finish()
        if not len(self._columns):
            raise self._first.error(0, "the file holds no observation")
        is_plane = bool(self._options.is_plane)
        book = self._columns.field_book()
        points = self._points.points(self._first.name, book.point_names, is_plane)
        points = with_heights(hold_plans(points, book), book)
        told = (*self._told(), *self.folder.warnings(), *self._observations.warnings, *book.warnings)
        refraction = self._options.refraction
        system = "Local" if is_plane else None  # heights can have a place on the Earth, which the user gives
        shown, units = self._options.shown, self._points.units(points.names)
        book = replace(book, warnings=told)
        return Project(
            points,
            book,
            system,
            system,
            refraction,
            shown=shown,
            units=units,
            is_from_grid_north=True,
            stochastic=self._model,
            centred=tuple(self._observations.centred),
            vertical_factors=self._vectors.vertical_factors,
        )

    def _told(self) -> Iterator[str]:
        name = self._first.name if self._first else ""
        if not self.has_units:
            yield f"{name}: no .UNITS: metres and degrees are taken"
        unknown = [g.name for g in self._columns.groups if g.name not in self._model.instruments]
        if unknown and self.has_defaults:
            yield (
                f"{name}: instruments ({', '.join(unknown)}): their standard errors are in the project file; "
                "those of --sigmas are taken for all of them where a line has none"
            )
        if self._skipped:
            lines = ", ".join(str(line) for line in self._skipped[:8])
            yield f"{name}: {len(self._skipped)} lines are switched off by .DATA OFF ({lines}...)"
