"""GNSS vectors as GVX 1.0 (GNSS Vector Exchange, of the US National Geodetic Survey).

Vectors go from mark to mark along geocentric axes, with standard deviations and correlations; those of a
session may be correlated, and are adjusted together then. Points that have the same name are one: a file has
one for each occupation. No point is known: known ones come in a file of their own, in the reference system of
the points.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from obseq.arrays import FloatArray
from obseq.formats.dynadjust.reader import Content, network_of
from obseq.formats.dynadjust.records import Header, MeasurementRecord, Member, Place, StationRecord
from obseq.formats.dynadjust.stations import DEGREES
from obseq.formats.project import Project, Reading
from obseq.reading.text import quoted
from obseq.reading.xml import Element, read_xml

ROOT = "GVX"
METRES = ("metre", "metres", "meter", "meters", "m")
DELTAS, SIGMAS = ("DX", "DY", "DZ"), ("SDX", "SDY", "SDZ")
CORRELATIONS = (("PXY", 0, 1), ("PXZ", 0, 2), ("PYZ", 1, 2))
FREE = "FFF"


def read_gvx(paths: tuple[Path, ...], reading: Reading) -> Project:
    """Reads files of vectors that belong together.

    Raises:
        InputError: Naming file and line, what is wrong and what to do.
    """
    files = [_File(read_xml(path)) for path in paths]
    stations: dict[str, StationRecord] = {}
    for file in files:
        if file.frame != files[0].frame:
            raise file.root.error(f"its points are in {file.frame}, those of {paths[0]} in {files[0].frame}")
        for station in file.stations():
            stations.setdefault(station.name, station)
    measurements = [vector for file in files for vector in file.vectors()]
    header = Header(files[0].frame, files[0].epoch)
    content = Content(header, list(stations.values()), measurements, tuple(map(str, paths)))
    return network_of(content, reading)


class _File:
    """One file: the frame of its points, their names by identifier."""

    def __init__(self, root: Element) -> None:
        if root.name != ROOT:
            raise root.error(f"<{root.name}> is not a GVX file")
        self.root, self._points = root, {p.content("ID"): p for p in root.named("POINT")}
        systems = {system.content("ID"): system for system in root.named("REFERENCE_SYSTEM")}
        places = [point.inside("COORDINATES") for point in self._points.values()]
        used = {place.content("REFERENCE_SYSTEM_ID") for place in places}
        if len(used) != 1 or not used <= systems.keys():
            raise root.error(
                f"points are in {len(used)} reference systems ({', '.join(sorted(used))}); one is read"
            )
        system = systems[used.pop()]
        unit = system.first("LINEAR_UNIT")
        if unit is not None and unit.content("NAME", "metre").lower() not in METRES:
            raise unit.problem(f"{quoted(unit.content('NAME'))}: only metres are read")
        self.frame = system.content("NAME")
        epochs = {place.numeric("EPOCH", math.nan) for place in places}
        self.epoch = epochs.pop() if len(epochs) == 1 else math.nan

    def stations(self) -> Iterator[StationRecord]:
        """The points, free, at their geocentric coordinates, or those in degrees where these are missing."""
        for point in self._points.values():
            place = point.inside("COORDINATES")
            axes, system = place.first("GEOCENTRIC_COORDINATES"), "XYZ"
            names: tuple[str, ...] = ("X", "Y", "Z")
            if axes is None or not axes.content("X", ""):
                axes, system = place.inside("GEODETIC_COORDINATES"), DEGREES
                names = ("LONGITUDE", "LATITUDE", "ELLIPSOIDAL_HEIGHT")
            x, y, z = (axes.numeric(name) for name in names)
            yield StationRecord(_name(point), FREE, system, (x, y, z), "", "", Place.of(point))

    def vectors(self) -> Iterator[MeasurementRecord]:
        """The vectors: those of a session together, the others each with its covariance."""
        members = {e.content("ID"): self._member(e) for e in self.root.named("GNSS_VECTOR")}
        for session in self.root.named("SESSION"):
            yield self._record(_joined(session, members))
        for member in members.values():
            yield self._record((member,))

    def _record(self, members: tuple[Member, ...]) -> MeasurementRecord:
        code, names, place = "G" if len(members) == 1 else "X", members[0].names, members[0].place
        header = Header(self.frame, self.epoch)
        return MeasurementRecord(code, True, names, members=members, header=header, place=place)

    def _member(self, element: Element) -> Member:
        names = tuple(self._end(element, f"{end}_POINT_ID") for end in ("INITIAL", "TERMINAL"))
        outer = element if element.first("ECEF_DELTAS") is not None else element.inside("QUALITY_CONTROL")
        deltas = outer.inside("ECEF_DELTAS")  # the writer of the NGS has both within the quality
        values = tuple(deltas.numeric(axis) for axis in DELTAS)
        covariance = _covariance(outer.inside("CORRELATION_MATRIX"))
        return Member(names, values, math.nan, covariance, (), True, Place.of(element))

    def _end(self, element: Element, which: str) -> str:
        found = self._points.get(element.content(which))
        if found is None:
            raise element.problem(f"{which} {quoted(element.content(which))!r} is no POINT of the file")
        return _name(found)


def _joined(session: Element, members: dict[str, Member]) -> tuple[Member, ...]:
    """The vectors of a session, which are taken from the others, with their covariances."""
    matrix = session.inside("CROSS_CORRELATION_MATRIX")
    if (matrix.get("ORDER") or "XYZ").upper() != "XYZ":
        raise matrix.problem(f"ORDER {quoted(matrix.get('ORDER') or '')!r}: only XYZ is read")
    blocks: dict[tuple[str, str], FloatArray] = {}
    for block in matrix.named("CCM_BLOCK"):
        row, column = (block.wanted(f"VECTOR_ID_{which}") for which in ("ROW", "COL"))
        texts = block.content("CORRELATIONS").replace(",", " ").split()
        if len(texts) != 9 or row == column or not {row, column} <= members.keys():
            raise block.problem("nine correlations of two vectors, each of no other session, are expected")
        found = np.array([block.parsed(text, "CORRELATIONS") for text in texts]).reshape(3, 3)
        blocks[row, column], blocks[column, row] = found, found.T
    chosen = [key for key in members if any(key in pair for pair in blocks)]
    taken = [members.pop(key) for key in chosen]
    sigmas = [np.sqrt(np.diag(member.covariance)) for member in taken if member.covariance is not None]
    for k, key in enumerate(chosen):
        later = [(blocks.get((key, other)), n) for n, other in enumerate(chosen) if n > k]
        if any(found is None for found, _ in later):
            raise matrix.problem("a block is missing: each two of its vectors need one")
        crossed = (found * np.outer(sigmas[k], sigmas[n]) for found, n in later if found is not None)
        taken[k] = taken[k]._replace(crossed=tuple(crossed))
    if not taken:
        raise matrix.problem("no CCM_BLOCK is in it")
    return tuple(taken)


def _name(point: Element) -> str:
    """The name of a point, as files of networks can hold it."""
    return "_".join(point.content("NAME", point.content("ID")).split())


def _covariance(matrix: Element) -> FloatArray:
    """(3, 3) m^2."""
    sigmas = np.array([matrix.numeric(name) for name in SIGMAS])
    found = np.eye(3)
    for name, row, column in CORRELATIONS:
        found[row, column] = found[column, row] = matrix.numeric(name)
    found = found * np.outer(sigmas, sigmas)
    if not (sigmas > 0.0).all() or np.linalg.eigvalsh(found)[0] <= 0.0:
        raise matrix.problem("the covariance is not positive definite")
    return found
