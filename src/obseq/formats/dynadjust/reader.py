"""Networks of DynAdjust: DNA and DynaML files of stations and measurements, as one network."""

from __future__ import annotations

from pathlib import Path

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.formats.dynadjust.dna import DnaFile
from obseq.formats.dynadjust.dynaml import read_records
from obseq.formats.dynadjust.geoid import read_geoid
from obseq.formats.dynadjust.measurements import field_book
from obseq.formats.dynadjust.records import Header, MeasurementRecord, StationRecord
from obseq.formats.dynadjust.stations import Stations
from obseq.formats.project import Project, Reading
from obseq.records.shown_units import ShownUnits

STN, MSR = ".stn", ".msr"


@dataclass(frozen=True, eq=False)
class Content:
    """What files hold together.

    Attributes:
        header: Frame and epoch of the stations.
        stations: The stations.
        measurements: The measurements.
        files: Names of the files.
    """

    header: Header
    stations: list[StationRecord]
    measurements: list[MeasurementRecord]
    files: tuple[str, ...]


SHOWN = ShownUnits(angle="dms")
"""DynAdjust's files hold metres and degrees, minutes and seconds."""


def read_dna(paths: tuple[Path, ...], reading: Reading) -> Project:
    """Reads DNA files: stations (.stn) and measurements (.msr); one alone brings the other of its name along.

    Raises:
        InputError: Naming file and line, what is wrong and what to do.
    """
    if len(paths) == 1:
        paths = (paths[0].with_suffix(STN), paths[0].with_suffix(MSR))
    stations: list[StationRecord] = []
    measurements: list[MeasurementRecord] = []
    headers = []
    for path in paths:
        if path.suffix.lower() not in (STN, MSR):
            raise InputError(f"{path}: DNA files end in {STN} (stations) or {MSR} (measurements)")
        is_stations = path.suffix.lower() == STN
        file = DnaFile(path, reading.encoding, STN[1:].upper() if is_stations else MSR[1:].upper())
        headers.append((not is_stations, file.header))
        if is_stations:
            stations += file.stations()
        else:
            measurements += file.measurements()
    header = min(headers, key=lambda item: item[0])[1]
    return network_of(Content(header, stations, measurements, tuple(map(str, paths))), reading)


def read_dynaml(paths: tuple[Path, ...], reading: Reading) -> Project:
    """Reads DynaML files (.xml): stations, measurements, or both in each.

    Raises:
        InputError: Naming file and line, what is wrong and what to do.
    """
    files = [read_records(path) for path in paths]
    header = next((header for header, stations, _ in files if stations), Header())
    stations = [record for _, found, _ in files for record in found]
    measurements = [record for _, _, found in files for record in found]
    return network_of(Content(header, stations, measurements, tuple(map(str, paths))), reading)


def network_of(content: Content, reading: Reading) -> Project:
    """The network of stations and measurements.

    Raises:
        InputError: Some are missing, or cannot be understood.
    """
    for what, found in (("station", content.stations), ("measurement", content.measurements)):
        if not found:
            raise InputError(
                f"{', '.join(content.files)}: no {what} is in it; give the files of stations and of "
                "measurements together"
            )
    header = content.header
    if not header.frame:
        raise InputError(f"{content.files[0]}: the file names no reference frame; add it to its header")
    geoid = None if reading.geoid is None else read_geoid(reading.geoid, reading.encoding)
    stations = Stations(content.stations, header, geoid, content.files, "deflections" in reading.ignore)
    book = field_book(stations, content.measurements, "frames" in reading.ignore)
    definition = stations.definition
    points = stations.points()
    return Project(points, book, points_crs=definition, refraction=0.0, has_geoid=True, shown=SHOWN)
