"""Survey observations of a project, folders `Topo/<Folder>`: OBS files, and MMVII's serialised `TopoData`.

Serialised files hold metres and radians; OBS files metres and gons.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.formats.columns import Columns, Measure
from obseq.project.tree import Reader, Tree, read_tree, tree_text
from obseq.survey import FieldBook, Observations, Orientation, read_obs
from obseq.survey.kinds.kind import ObservationKind
from obseq.survey.kinds.registry import BY_CODE, BY_NAME
from obseq.survey.model import group_by_station

DATA = "TopoData"
OUTPUT = "TopoOut"
OBS = ".obs"
SERIALISED = (".xml", ".json")
AZIMUTH, DIRECTION = "Azim", "Hz"
NAMES = ("Dist", "Hz", "Zen", "DX", "DY", "DZ", "DH")
"""The kinds of observations that a serialised file can hold."""
OF_STATIONS = (Orientation.FIX, Orientation.VERT, Orientation.BASC, Orientation.CAM)
KEYWORDS = {status.keyword: status for status in OF_STATIONS}
COLUMNS = tuple(field.name for field in fields(Observations))
LARGEST_ANGLE = 2.0 * np.pi + 1e-9


def read_topo(folder: str | Path) -> FieldBook:
    """The observations of a folder ``Topo/<Folder>``: all its OBS and serialised files, by name.

    Raises:
        InputError: the folder is not there, holds no observations or a file of another kind; what is wrong in
            a file, with its place.
    """
    place = Path(folder)
    if not place.is_dir():
        raise InputError(f"{folder}: there is no such folder of survey observations")
    files = sorted(path for path in place.iterdir() if path.is_file() and not path.name.startswith("."))
    texts = [path for path in files if path.suffix.lower() == OBS]
    trees = [path for path in files if path.suffix.lower() in SERIALISED]
    other = [path for path in files if path not in texts and path not in trees and path.suffix != ".cor"]
    if other:
        raise InputError(f"{other[0]}: survey observations are OBS files ({OBS}) or serialised (.xml, .json)")
    if not texts and not trees:
        raise InputError(f"{folder}: holds no survey observations (*{OBS}, or {DATA} as .xml or .json)")
    books = [*([read_obs(texts)] if texts else []), *map(_serialised, trees)]
    first = books[0]
    for book in books[1:]:
        first = _together(first, book)
    return first


@dataclass(frozen=True, eq=False)
class AdjustedTopo:
    """What an adjustment found of survey observations.

    Attributes:
        book: the observations.
        residuals: (n,) computed minus observed, metres and radians; NaN for what was not adjusted.
        orientations: (m,) values of `Orientation` of the stations.
        g0: (m,) azimuths of the zeros of their circles, radians.
    """

    book: FieldBook
    residuals: FloatArray
    orientations: NDArray[np.integer[Any]]
    g0: FloatArray


def topo_text(found: AdjustedTopo, *, as_json: bool = False) -> str:
    """The observations of an adjustment as `TopoData`, with residuals and the zero of each station.

    Residuals are those of the final solution (the original writes those of the last iteration's start). An
    azimuth is written as what it is: a direction of a station whose circle is fixed. What has no place in
    such a file is left out (`without_place`).
    """
    book = found.book
    rows = book.observations
    has_place = ~np.isin(np.arange(len(rows)), without_place(book))
    azimuths = rows.types == BY_NAME[AZIMUTH].code
    stations: list[Tree] = []
    for station in range(len(book.stations)):
        mine = book.stations.observations(station)
        data = _set("Station", mine[(has_place & ~azimuths)[mine]].tolist(), found)
        data["StationOriStatus"] = Orientation(int(found.orientations[station])).keyword
        data["__Opt__Out_G0"] = (float(found.g0[station]),)
        stations.append({"TopoObsSetData": data})
    for row in np.flatnonzero(azimuths & has_place & rows.active).tolist():
        data = _set("Station", [row], found)
        data["StationOriStatus"], data["__Opt__Out_G0"] = Orientation.FIX.keyword, (0.0,)
        stations.append({"TopoObsSetData": data})
    simple = np.flatnonzero((rows.stations < 0) & ~azimuths & has_place)
    content: Tree = {
        "AllObsSetStations": stations,
        "ObsSetSimple": {"TopoObsSetData": _set("Simple", simple.tolist(), found)},
    }
    return tree_text(DATA, content, as_json=as_json)


def _set(kind: str, rows: Sequence[int], found: AdjustedTopo) -> dict[str, Tree]:
    active = found.book.observations.active
    entries: list[Tree] = [{"TopoObsData": _observation(row, found)} for row in rows if active[row]]
    return {"Type": kind, "AllObs": entries}


def _observation(row: int, found: AdjustedTopo) -> dict[str, Tree]:
    book, observations = found.book, found.book.observations
    ends = (observations.from_points[row], observations.to_points[row])
    kind = BY_CODE[int(observations.types[row])].name
    entry: dict[str, Tree] = {
        "Type": DIRECTION if kind == AZIMUTH else kind,
        "Pts": [book.point_names[end] for end in ends],
        "Measures": _list(observations.values[row]),
        "Sigmas": _list(observations.sigmas[row]),
    }
    if np.isfinite(found.residuals[row]):
        entry["__Opt__LastResiduals"] = _list(found.residuals[row])
    return entry


def _list(value: float) -> Tree:
    return [(float(value),)]


def without_place(book: FieldBook) -> IntArray:
    """Rows of the observations that `TopoData` cannot hold.

    These are kinds that MMVII has not, heights of instrument or target, sigmas that depend on the distance.
    """
    rows = book.observations
    known = np.isin(rows.types, [BY_NAME[name].code for name in (*NAMES, AZIMUTH)])
    lengths = np.stack([rows.relative_sigmas, rows.from_heights, rows.to_heights])
    return np.flatnonzero(rows.active & (~known | (lengths != 0.0).any(axis=0)))


def said_of_those_without_place(book: FieldBook) -> str:
    """A sentence on what the written file lacks; empty where it lacks nothing."""
    lost = without_place(book)
    if not lost.size:
        return ""
    return (
        f"{lost.size} observations have no place in {OUTPUT}, which holds {', '.join(NAMES)} between points, "
        f"with one sigma: {book.label(int(lost[0]))} is the first; keep the OBS files"
    )


def _serialised(path: Path) -> FieldBook:
    """The observations of one serialised file; their line is their number in it."""
    data = Reader(read_tree(path), str(path)).fields(DATA)
    columns = Columns()
    columns.files.append(str(path))
    stations = data.list("AllObsSetStations") if data.has("AllObsSetStations") else []
    for number, tree in enumerate(stations):
        station = _inner(Reader(tree, f"{path}: station {number + 1}"), "TopoObsSetData")
        _add_set(columns, station, is_station=True)
    if data.has("ObsSetSimple") and data.mapping("ObsSetSimple"):
        _add_set(columns, _inner(data.fields("ObsSetSimple"), "TopoObsSetData"), is_station=False)
    if not len(columns):
        raise InputError(f"{path}: holds no observation")
    return columns.field_book()


def _inner(reader: Reader, name: str) -> Reader:
    """What stands under a name, where lists carry the name of what they hold."""
    return reader.fields(name) if reader.has(name) else reader


def _add_set(columns: Columns, data: Reader, *, is_station: bool) -> None:
    station = -1
    for number, tree in enumerate(data.list("AllObs")):
        one = _inner(Reader(tree, f"{data.where}: observation {number + 1}"), "TopoObsData")
        kind = _kind(one, is_station)
        origin, target = (columns.names.setdefault(name, len(columns.names)) for name in _ends(one))
        if is_station and station < 0:
            station = columns.open_station(origin, _status(data))
        value, sigma = _number(one, "Measures"), _number(one, "Sigmas")
        if kind.is_angle and abs(value) > LARGEST_ANGLE:
            raise InputError(f"{one.where}: an angle of {value:g} is not in radians")
        if not sigma > 0.0:
            raise InputError(f"{one.where}: a sigma must be above zero, not {sigma:g}")
        columns.append(Measure(kind, origin, target, value, sigma, station=station), 0, len(columns))


def _kind(one: Reader, is_station: bool) -> ObservationKind:
    name = one.text("Type")
    if name not in NAMES:
        raise InputError(f"{one.where}: unknown type {name!r}; types are {', '.join(NAMES)}")
    kind = BY_NAME[name]
    if kind.needs_station != is_station:
        where = "in a station" if kind.needs_station else "outside of stations"
        raise InputError(f"{one.where}: a measure {name} stands {where}")
    return kind


def _ends(one: Reader) -> tuple[str, str]:
    names = one.list("Pts")
    if len(names) != 2 or not all(isinstance(name, str) and name for name in names):
        raise InputError(f"{one.where}: Pts should be two names")
    return str(names[0]), str(names[1])


def _status(data: Reader) -> Orientation:
    word = data.text("StationOriStatus")
    if word not in KEYWORDS:
        raise InputError(f"{data.where}: unknown status {word!r}; it is {', '.join(KEYWORDS)}")
    return KEYWORDS[word]


def _number(one: Reader, name: str) -> float:
    """The only number of a list; JSON writes such a list as numbers."""
    found = one.value(name)
    value = found[0] if isinstance(found, (list, tuple)) and len(found) == 1 else None
    value = value[0] if isinstance(value, tuple) and len(value) == 1 else value
    if not isinstance(value, int | float):
        raise InputError(f"{one.where}: {name} should be one number")
    return float(value)


def _together(first: FieldBook, second: FieldBook) -> FieldBook:
    """The observations of two books in one numbering, those of the first before; the second has no groups."""
    number = {name: k for k, name in enumerate(first.point_names)}
    renumbered = np.array([number.setdefault(name, len(number)) for name in second.point_names], np.int32)
    a, b = first.observations, second.observations
    moved = replace(
        b,
        from_points=renumbered[b.from_points],
        to_points=renumbered[b.to_points],
        stations=np.where(b.stations < 0, -1, b.stations + len(first.stations)).astype(np.int32),
        file_indices=b.file_indices + np.int32(len(first.files)),
    )
    both = replace(a, **{name: np.concatenate([getattr(a, name), getattr(moved, name)]) for name in COLUMNS})
    starts, members = group_by_station(both.stations, len(first.stations) + len(second.stations))
    stations = replace(
        first.stations,
        origins=np.concatenate([first.stations.origins, renumbered[second.stations.origins]]),
        orientations=np.concatenate([first.stations.orientations, second.stations.orientations]),
        starts=starts,
        members=members,
    )
    return replace(
        first,
        point_names=tuple(number),
        observations=both,
        stations=stations,
        files=first.files + second.files,
        warnings=first.warnings + second.warnings,
    )
