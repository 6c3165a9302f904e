"""Networks of SNAP: a command file (`.snp`) with the coordinate and data files that it names."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from obseq.errors import InputError
from obseq.formats.dynadjust.measurements import field_book
from obseq.formats.dynadjust.records import Header, MeasurementRecord, StationRecord
from obseq.formats.dynadjust.stations import DEGREES, Stations
from obseq.formats.includes import Folder
from obseq.formats.project import Project, Reading, only_one
from obseq.formats.snap.commands import Hold, Job, read_commands
from obseq.formats.snap.records import Found, read_observations
from obseq.formats.snap.stations import Geoid, Mark
from obseq.records.shown_units import ShownUnits

EARTH = 6.378e6
"""Radius (m) that turns standard errors of floated stations into angles."""


def read_snap(paths: tuple[Path, ...], reading: Reading) -> Project:
    """Reads the network of a command file.

    Raises:
        InputError: Naming file and line, what is wrong, or what nothing here does.
    """
    path = only_one(paths)
    folder = Folder(path.parent, reading.encoding, reading.outside)
    job = read_commands(path, folder)
    assert job.system is not None
    found = Found()
    for data, factor in job.files:
        read_observations(data, job, factor, found)
    if not found.records:
        raise InputError(f"{path}: its data files hold no observation")
    header = Header(job.system.datum)
    records = [*found.records, *_floated(job, header)]
    marks = _used(job, records)
    stations = Stations(
        [_station(job, mark) for mark in marks.values()],
        header,
        Geoid(marks),
        (str(path),),
        "deflections" in reading.ignore,
    )
    book = field_book(stations, records, False, found.ratios)
    return Project(
        stations.points(),
        book.warned(*job.told, *folder.warnings()),
        points_crs=job.system.definition,
        refraction=2.0 * job.refractions["default"],
        inner=((), ()) if job.is_free else None,
        has_geoid=True,
        shown=ShownUnits(angle="dms"),
    )


def refuse_part(paths: tuple[Path, ...], reading: Reading) -> Project:
    """Says what coordinate and data files belong to.

    Raises:
        InputError: In any case.
    """
    raise InputError(f"{paths[0]}: a part of a network of SNAP: adjust the command file (.snp) that names it")


def _used(job: Job, records: list[MeasurementRecord]) -> dict[str, Mark]:
    """The stations that observations name."""
    names = {name for record in records for name in record.names}
    names |= {name for record in records for member in record.members for name in member.names}
    return {name: mark for name, mark in job.marks.items() if name in names}


def _station(job: Job, mark: Mark) -> StationRecord:
    hold = job.held.get(mark.name, Hold())
    plan, height = (is_held or every for is_held, every in zip(hold.fixed, job.everything, strict=True))
    letters = ("C" if plan else "F") * 2 + ("C" if height else "F")
    return StationRecord(mark.name, letters, DEGREES, mark.geodetic, "", mark.description, mark.place)


def _floated(job: Job, header: Header) -> Iterator[MeasurementRecord]:
    """Coordinates that are observations with a standard error."""
    for name, hold in job.held.items():
        mark = job.marks[name]
        longitude, latitude, height = mark.geodetic
        plan, up = hold.floated
        across = EARTH * math.cos(math.radians(latitude))
        parts = [("P", math.radians(latitude), plan / EARTH), ("Q", math.radians(longitude), plan / across)]
        chosen = parts if plan and not job.everything[0] else []
        chosen = [*chosen, *([("R", height, up)] if up and not job.everything[1] else [])]
        for code, value, sigma in chosen:
            yield MeasurementRecord(code, True, (name,), value, sigma, header=header, place=mark.place)
