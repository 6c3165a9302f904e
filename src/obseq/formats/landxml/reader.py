"""Surveys in LandXML 1.0 to 1.2: set-ups with raw observations, and coordinate points.

Such files hold no standard deviations: these are asked for (`--sigmas`). Points that `pntSurv` calls control
are held, unless other files say what is known; the others start where the file puts them.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from obseq import crs
from obseq.formats.fieldbooks.book import Book, named
from obseq.formats.landxml.observations import SurveyReader
from obseq.formats.landxml.units import Units, units_of
from obseq.formats.project import Project, Reading, only_one
from obseq.reading.xml import Element, read_xml

ROOT = "LandXML"
CONTROL = "control"
NOWHERE = "an InstrumentSetup with its setupID"


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
    book = Book(reading, NOWHERE)
    book.open(root.file)
    table = PointTable(book, units)
    for element in root.children:
        if element.name in ("CgPoints", "Survey"):
            table.read_all(element)
    reader = SurveyReader(book, units, table, takes_reduced="reductions" in reading.ignore)
    for survey in root.named("Survey"):
        reader.read(survey)
    project = book.project()
    return replace(
        project,
        points_crs=_system(root),
        shown=units.shown,
        units=np.full(len(project.points), units.metres),
        is_from_grid_north=True,
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

    def __init__(self, book: Book, units: Units) -> None:
        self._book, self._units = book, units
        self._lines: dict[str, int] = {}

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
        self._lines[name] = element.line
        self.take(element, name, element.get("pntSurv") == CONTROL)

    def take(self, element: Element, name: str, is_known: bool = False) -> None:
        """Takes the coordinates in the text of an element: north, east and perhaps height."""
        texts = element.text.split()
        if not texts:
            return
        if len(texts) not in (2, 3):
            raise element.error(f"{len(texts)} numbers in <{element.name}>: north, east and perhaps height")
        north, east, *height = (element.parsed(text, "coordinates") * self._units.metres for text in texts)
        place = east, north, height[0] if height else math.nan
        self._book.place(element.line - 1, named(name), place, is_known)
