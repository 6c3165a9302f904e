"""Field books of Trimble as JobXML (.jxl): raw circle readings and distances of `PointRecord`.

Angles are decimal degrees, lengths metres, whatever the units of display. A distance is as the instrument
measured it: the prism constant of its target and the ppm of its atmosphere are added, as in Trimble's own
style sheets. Mean turned angles and reductions are results of the readings, and have no part.
"""

from __future__ import annotations

import math
from pathlib import Path

from obseq.formats.fieldbooks.book import Book, Sight, named
from obseq.formats.project import Project, Reading
from obseq.reading.xml import Element, read_xml

ROOT = "JOBFile"
NOWHERE = "a StationRecord with the StationID of the point"
PPM = 1e-6
CONTROL = ("Control", "CalibrationPoint")
LEFT_OUT = {
    "Check": "points classified as checks",
    "Deleted": "points that were deleted in the field",
}
DIRECT = "DirectReading"


def read_jobxml(paths: tuple[Path, ...], reading: Reading) -> Project:
    """Reads field books, one after the other.

    Args:
        paths: The files.
        reading: How to read them; `sigmas` are the standard deviations of their observations.

    Raises:
        InputError: Naming file and line, what is wrong and what to do.
    """
    book = Book(reading, NOWHERE)
    for path in paths:
        root = read_xml(path)
        pages = root.first("FieldBook")
        if root.name != ROOT or pages is None:
            raise root.error(f"<{root.name}> is no {ROOT} with a FieldBook")
        book.open(root.file)
        _Job(book, pages).read()
    return book.project()


class _Job:
    """The records of a field book, which refer to each other."""

    def __init__(self, book: Book, pages: Element) -> None:
        self._book, self._pages = book, pages
        kinds = ("StationRecord", "TargetRecord", "AtmosphereRecord")
        self._stations, self._targets, self._atmospheres = (
            {record.get("ID") or "": record for record in pages.named(kind)} for kind in kinds
        )

    def read(self) -> None:
        """Takes all records."""
        for record in self._pages.children:
            if record.name == "InstrumentRecord":
                model, serial = (record.content(name, "") for name in ("Model", "Serial"))
                self._book.use(f"{model} {serial}")
            elif record.name == "PointRecord":
                self._point(record)

    def _point(self, record: Element) -> None:
        index, name = record.line - 1, named(record.content("Name", ""))
        kind = record.content("Classification", "Normal")
        what = LEFT_OUT.get("Deleted" if record.content("Deleted", "false") == "true" else kind)
        if what is not None:
            self._book.leave_out(index, what)
            return
        circle, grid = record.first("Circle"), record.first("Grid")
        if not name:
            return
        if grid is not None:
            axes = [grid.numeric(axis, math.nan) for axis in ("East", "North", "Elevation")]
            self._book.place(index, name, (axes[0], axes[1], axes[2]), kind in CONTROL)
        if circle is None:
            return
        if record.content("Method", DIRECT) != DIRECT:
            self._book.leave_out(index, f"points by {record.content('Method')}")
            return
        self._sight(record, name, circle)

    def _sight(self, record: Element, name: str, circle: Element) -> None:
        index, key = record.line - 1, record.content("StationID", "")
        station = self._stations.get(key)
        if station is None:
            raise record.error(f"its StationID {key or '(none)'} is no StationRecord of the file")
        height = station.numeric("TheodoliteHeight", 0.0)
        self._book.set_up(index, named(station.content("StationName")), height, key)
        target = self._targets.get(record.content("TargetID", ""))
        self._book.target_height = target.numeric("TargetHeight", 0.0) if target is not None else 0.0
        self._book.sight(index, name, self._readings(circle, station, target))

    def _readings(self, circle: Element, station: Element, target: Element | None) -> Sight:
        direction, zenith = (
            math.radians(circle.numeric(axis)) if circle.content(axis, "") else None
            for axis in ("HorizontalCircle", "VerticalCircle")
        )
        if not circle.content("EDMDistance", ""):
            return Sight(direction, zenith)
        distance = circle.numeric("EDMDistance")
        prism = target.numeric("PrismConstant", 0.0) if target is not None else 0.0
        air = self._atmospheres.get(station.content("AtmosphereID", ""))
        ppm = air.numeric("PPM", 0.0) if air is not None else 0.0
        return Sight(direction, zenith, distance * (1.0 + ppm * PPM) + prism)
