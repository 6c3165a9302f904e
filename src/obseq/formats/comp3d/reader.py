"""Comp3D projects (`.comp`): settings, and the files that they name."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from obseq import crs
from obseq.arrays import FloatArray
from obseq.errors import InputError
from obseq.formats.comp3d.dimensions import DIMENSIONS, check_dimensions
from obseq.formats.comp3d.observations import read_observations
from obseq.formats.includes import Folder
from obseq.formats.levelled_points import levelled_points
from obseq.formats.obs.cor import PointColumns
from obseq.formats.project import Project, Reading, only_one
from obseq.reading.json_text import parsed_json
from obseq.records.shown_units import ShownUnits
from obseq.survey.model import CoordinateCovariance, Points, merge_points

Configuration: TypeAlias = dict[str, Any]
"""A project file as it is parsed."""


UNITS = (1.0, math.pi / 200.0, math.pi / 180.0, math.pi / 648_000.0)
"""Radians in one unit of angles, by `files_unit`: radian, gon, degree, arc second."""
SHOWN = {2: "degree", 3: "dms"}
"""Units of angles in reports, by `files_unit`; gon for the others."""
_SAME_HEIGHT = 1e-3
"""Height (m) above the ellipsoid of WGS 84 below which a point of height 0 is of its datum."""
REMOTE = ("8", KNOWN_REMOTE := "9")
"""Codes of points that have no part in inner constraints; the latter stay known."""
PLANNED = ("", "propagation", "simulation")
"""Projects that are no adjustments, by `compute_type`."""
SIMULATION = 2
DEFAULTS = {
    "root_COR_file": "",
    "root_OBS_file": "",
    "coord_cov_file": "",
    "use_proj": False,
    "proj_def": "",
    "center_latitude": 48.8,
    "local_center": [0.0, 0.0, 0.0],
    "refraction": 0.12,
    "files_unit": 1,
    "use_ellips_height": True,
    "compute_type": 0,
    "internal_constraints": False,
    "max_iterations": 100,
}
"""Values of a new project, for keys that are missing; each one that is used is told."""
SILENT = frozenset(
    ("name", "description", "lang", "invert_matrix", "convergence_criterion", "force_iterations", "nb_digits")
) | frozenset(("clean_outputs", "display_map", "misc_metadata", "coord_cov_file", "proj_def"))
"""Keys that change nothing here, or nothing when they are missing."""


def read_comp3d(paths: tuple[Path, ...], reading: Reading) -> Project:
    """Reads a Comp3D project; nothing is written.

    Args:
        paths: The `.comp` file.
        reading: How to read it.

    Raises:
        InputError: Naming file and line, what is wrong and what to do.
    """
    path = only_one(paths)
    config, told = _settings(path)
    folder = Folder(path.parent, reading.encoding, reading.outside)
    points, ignored, chosen = _points(folder, config)
    unit = UNITS[config["files_unit"]]
    book = read_observations(folder, config["root_OBS_file"], unit, ignored, has_place=config["use_proj"])
    book = check_dimensions(book, {name: DIMENSIONS[code] for name, code in chosen.items()})
    if config["coord_cov_file"]:
        points = replace(points, covariance=_covariance(folder, config["coord_cov_file"], points))
    points = merge_points([points, levelled_points(points, book, config["local_center"])])
    if not config["use_ellips_height"] and not points.is_held[:, :2].all():
        raise InputError(
            f"{path}: config.use_ellips_height is false: heights are altitudes, which is for networks of "
            "points "
            "known in height only (codes 4 and 5)"
        )
    points_crs, frame = _systems(config)
    return Project(
        points,
        replace(book, warnings=(*told, *folder.warnings(), *book.warnings)),
        frame,
        points_crs,
        float(config["refraction"]),
        int(config["max_iterations"]),
        shown=ShownUnits(angle=SHOWN.get(config["files_unit"], "gon")),
        inner=_inner(chosen) if config["internal_constraints"] else None,
    )


def _settings(path: Path) -> tuple[Configuration, tuple[str, ...]]:
    """The settings with defaults for what is missing, and sentences about these."""
    file = Folder(path.parent, "latin-1", True).open(path.name)
    _, found, text = "\n".join(file.lines).partition("=")
    try:
        content = parsed_json(text if found else "")
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is not a Comp3D project (data= and a JSON object): {error}") from error
    config = content.get("config") if isinstance(content, dict) else None
    if not isinstance(config, dict):
        raise InputError(f"{path}: holds no object `config`, which a Comp3D project has")
    missing = [key for key in DEFAULTS if key not in config and key not in SILENT]
    told = tuple(
        f"{path}: {key} is missing; {DEFAULTS[key]!r} is taken, as in a new project" for key in missing
    )
    complete = DEFAULTS | config
    _check(path, complete)
    return complete, (*told, *_planned(path, complete))


def _planned(path: Path, config: Configuration) -> tuple[str, ...]:
    """What is said of projects that are no adjustments: the values of their observations do not count."""
    kind = PLANNED[config["compute_type"]]
    if not kind:
        return ()
    draws = f" --draws {config['max_iterations']}" if config["compute_type"] == SIMULATION else ""
    return (
        f"{path}: it is a {kind}, to be planned: obseq plan {path.name}{draws}. An adjustment takes the "
        "values of its observations as they stand",
    )


def _check(path: Path, config: Configuration) -> None:
    for key, default in DEFAULTS.items():
        if not _is_like(config[key], default):
            raise InputError(f"{path}: config.{key} is {config[key]!r}; something like {default!r} is needed")
    for key in ("root_COR_file", "root_OBS_file"):
        if not config[key]:
            raise InputError(f"{path}: config.{key} is empty; name the file")
    if config["files_unit"] not in range(len(UNITS)) or not isinstance(config["files_unit"], int):
        raise InputError(f"{path}: config.files_unit is {config['files_unit']!r}; it goes from 0 to 3")
    if config["compute_type"] not in range(len(PLANNED)):
        raise InputError(f"{path}: config.compute_type is {config['compute_type']!r}; it is 0, 1 or 2")
    centre = config["local_center"]
    if len(centre) < 2 or not all(isinstance(value, int | float) for value in centre):
        raise InputError(f"{path}: config.local_center is {centre!r}; [east, north, 0] is needed")
    if config["max_iterations"] < 1:
        raise InputError(f"{path}: config.max_iterations is {config['max_iterations']!r}; it is at least 1")


def _is_like(value: Any, default: object) -> bool:
    """Whether a value is of the kind of its default: a truth, a finite number, a text, a list."""
    if isinstance(default, bool) or not isinstance(default, int | float):
        return isinstance(value, type(default))
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _moves_heights(definition: str, east: float, north: float) -> bool:
    """Whether the datum of a system is another one, to which heights would be changed: Comp3D keeps them."""
    system = crs.parse(definition)
    return abs(float(system.geodetic(np.array([east, north, 0.0]))[2])) > _SAME_HEIGHT


def _systems(config: Configuration) -> tuple[str, str]:
    """Definitions of the system of the points and of the computation frame."""
    east, north = (float(value) for value in config["local_center"][:2])
    definition = config["proj_def"]
    if not config["use_proj"]:
        definition = (
            f"+proj=sterea +lat_0={config['center_latitude']!r} +lon_0=0 +k_0=1 +x_0={east!r} +y_0={north!r} "
            "+datum=WGS84"
        )
    elif _moves_heights(definition, east, north):
        definition += crs.KEPT_HEIGHTS
    return definition, f"RTL*{east!r}*{north!r}*0*{definition}"


def _inner(codes: Mapping[str, str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The points that do not carry inner constraints, and those of them that stay known."""
    remote = {name: code for name, code in codes.items() if code in REMOTE}
    return tuple(remote), tuple(name for name, code in remote.items() if code == KNOWN_REMOTE)


def _points(folder: Folder, config: Configuration) -> tuple[Points, frozenset[str], Mapping[str, str]]:
    """The points, the names to be ignored with their observations, and the codes of partial points."""
    columns, ignored = PointColumns(), set()
    chosen: dict[str, str] = {}
    for file, index, fields in folder.lines(config["root_COR_file"], columns.open_file):
        if fields[0] == "-1" and len(fields) > 1:
            ignored.add(fields[1])
        else:
            columns.append(file, index, fields)
            if fields[0] in DIMENSIONS:
                chosen[fields[1]] = fields[0]
    points = columns.points()
    kept = np.array([row for row, name in enumerate(points.names) if name not in ignored], np.intp)
    if not kept.size:
        raise InputError(f"{folder.path(config['root_COR_file'])}: holds no point")
    return points.subset(kept), frozenset(ignored), chosen


def _covariance(folder: Folder, name: str, points: Points) -> CoordinateCovariance | None:
    """The covariance of known coordinates that have a sigma; other parameters of the file have no part."""
    file = folder.open(name)
    rows = [(index, line.replace(",", " ").split()) for index, line in enumerate(file.lines) if line.strip()]
    if not rows or rows[0][1][:1] != ["param"]:
        raise file.error(0, "the first line of a covariance file is `param` and the names of the parameters")
    names = rows[0][1][1:]
    matrix = np.zeros((len(names), len(names)))
    if len(rows) != len(names) + 1:
        raise file.error(rows[-1][0], f"{len(rows) - 1} rows for {len(names)} parameters")
    for k, (index, fields) in enumerate(rows[1:]):
        if fields[:1] != [names[k]] or len(fields) != len(names) + 1:
            raise file.error(index, f"the row of {names[k]} with {len(names)} numbers is expected here")
        matrix[k] = [file.number(index, text) for text in fields[1:]]
    return _restricted(file.name, names, matrix, points)


def _restricted(
    file: str, names: list[str], matrix: FloatArray, points: Points
) -> CoordinateCovariance | None:
    coordinates, kept = [], []
    for k, name in enumerate(names):
        point, _, axis = name.rpartition("_")
        row, component = points.index.get(point), "xyz".find(axis)
        if row is not None and component >= 0 and points.sigmas[row, component] > 0.0:
            coordinates.append((point, component))
            kept.append(k)
    if not kept:
        return None
    chosen = matrix[np.ix_(kept, kept)]
    symmetric = (chosen + chosen.T) / 2.0
    try:
        np.linalg.cholesky(symmetric)
    except np.linalg.LinAlgError as error:
        raise InputError(
            f"{file}: the covariance of the known coordinates is not positive definite"
        ) from error
    return CoordinateCovariance(tuple(coordinates), symmetric)
