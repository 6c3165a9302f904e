"""Surveys in LandXML 1.0 to 1.2: set-ups with raw observations, and coordinate points.

Such files hold no standard deviations: these are asked for (`--sigmas`). Points that `pntSurv` calls control
are held; the others start where the file puts them.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq import crs
from obseq.formats.columns import Columns
from obseq.formats.landxml.observations import HEIGHTS, SurveyReader
from obseq.formats.landxml.units import Units, units_of
from obseq.formats.levelled_points import hold_plans
from obseq.formats.project import Project, Reading, only_one
from obseq.formats.stochastic import StochasticModel
from obseq.reading.xml import Element, read_xml
from obseq.survey.model import Points, points_of_lines

if TYPE_CHECKING:
    from pathlib import Path

    from obseq.survey.model import FieldBook

ROOT = "LandXML"
CONTROL = "control"
_NOWHERE = (math.nan, math.nan, math.nan)


def read_landxml(paths: tuple[Path, ...], reading: Reading) -> Project:
    """Reads the survey of a LandXML file.

    Args:
        paths: The file.
        reading: How to read it; `sigmas` are the standard deviations of its observations.

    Raises:
        InputError: Naming file and line, what is wrong and what to do.
    """
    root = read_xml(only_one(paths))
    if root.name != ROOT:
        raise root.error(f"<{root.name}> is not a LandXML file")
    units = units_of(root)
    table = PointTable(units)
    for element in root.children:
        if element.name in ("CgPoints", "Survey"):
            table.read_all(element)
    columns = Columns()
    file, takes_reduced = columns.open_file(root.file), "reductions" in reading.ignore
    reader = SurveyReader(columns, file, units, reading.sigmas, table, takes_reduced=takes_reduced)
    for survey in root.named("Survey"):
        reader.read(survey)
    if not len(columns):
        left_out = " ".join(reader.warnings(root.file.name))
        raise root.error(f"the file holds no raw observation of a survey. {left_out}".strip())
    book = replace(columns.field_book(), warnings=tuple(reader.warnings(root.file.name)))
    points = hold_plans(table.points(root, book), book)
    lengths = np.full(len(points), units.metres)
    system = _system(root)
    return Project(
        points,
        book,
        None,
        system,
        shown=units.shown,
        units=lengths,
        is_from_grid_north=True,
        stochastic=StochasticModel(reading.sigmas, reading.instruments),
        centred=tuple(range(len(columns))),
    )


def _system(root: Element) -> str | None:
    """Definition of the system of the points, if the file names one by its number."""
    element = root.first("CoordinateSystem")
    code = element.get("epsgCode") if element else None
    if element is None or code is None:
        return None
    try:
        return crs.parse(f"EPSG:{code}").definition
    except crs.CrsError as error:
        raise element.error(f"the coordinate system EPSG:{code} cannot be used: {error}") from error


class PointTable:
    """Coordinate points, by name."""

    def __init__(self, units: Units) -> None:
        self._units = units
        self._values: dict[str, tuple[float, float, float]] = {}
        self._lines: dict[str, int] = {}
        self._control: set[str] = set()

    def read_all(self, element: Element) -> None:
        """Takes the points of an element and of those in it."""
        for child in element.children:
            if child.name == "CgPoint":
                self._read(child)
            elif child.name in ("CgPoints", "InstrumentSetup"):
                self.read_all(child)

    def _read(self, element: Element) -> None:
        name = element.get("name") or element.get("oID")
        if element.get("pntRef") and not element.text.strip():
            return
        if name is None:
            raise element.error("<CgPoint> has no name; give it one")
        if name in self._lines:
            raise element.error(f"point {name} is given twice (first in line {self._lines[name]})")
        self.take(element, name)
        if element.get("pntSurv") == CONTROL:
            self._control.add(name)

    def take(self, element: Element, name: str) -> None:
        """Takes the coordinates in the text of an element: north, east and perhaps height."""
        texts = element.text.split()
        if not texts:
            return
        if len(texts) not in (2, 3):
            raise element.error(f"{len(texts)} numbers in <{element.name}>: north, east and perhaps height")
        element.file.check_name(element.line - 1, name)
        north, east, *height = (element.parsed(text, "coordinates") * self._units.metres for text in texts)
        self._values.setdefault(name, (east, north, height[0] if height else math.nan))
        self._lines.setdefault(name, element.line)

    def points(self, root: Element, book: FieldBook) -> Points:
        """All points of the file and of its observations, in metres.

        Raises:
            InputError: None is held.
        """
        names = list(dict.fromkeys([*self._values, *book.point_names]))
        coordinates = np.array([self._values.get(name, _NOWHERE) for name in names]).reshape(-1, 3)
        held = np.array([name in self._control for name in names])
        if not held.any():
            raise root.error(
                'no CgPoint has pntSurv="control": nothing says which points are known; mark them so'
            )
        sigmas = np.full((len(names), 3), np.nan)
        sigmas[held] = np.where(np.isnan(coordinates[held]), np.nan, 0.0)
        if not np.isin(book.observations.types, HEIGHTS).any():
            coordinates[:, 2], sigmas[:, 2] = 0.0, 0.0
        return points_of_lines(names, coordinates, sigmas, root.file.name, self._lines)
