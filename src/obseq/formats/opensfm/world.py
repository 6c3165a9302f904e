"""What OpenSfM and ODM know of the world: positions in the images or in `geo.txt`, points in `gcp_list.txt`.

Their first line is a system (`WGS84`, `WGS84 UTM 32N`, `EPSG:...`, or PROJ's text); heights are above its
ellipsoid.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from obseq import crs
from obseq.arrays import FloatArray
from obseq.errors import CrsError, InputError
from obseq.formats.blocks.ground import control_in_frame, frame_for, heights_said
from obseq.formats.blocks.json_nodes import Node
from obseq.formats.blocks.reading import note_count
from obseq.images.bundle import BundleAdjustment
from obseq.images.control import ControlPoints
from obseq.images.measures import ImagePoints
from obseq.reading.tables import text_of

UTM = re.compile(r"WGS84\s+UTM\s+(\d{1,2})([NS])", re.IGNORECASE)
DOP = 15.0
"""Metres: the accuracy that OpenSfM takes for images that say none."""
GROUND = 0.01
"""Metres: the accuracy of ground points, of which the list says none (OpenSfM's in plan)."""


def system_of(line: str, where: str) -> str:
    """The definition of a system as the first line of a list names it.

    Raises:
        InputError: nobody knows it.
    """
    word = line.strip().lstrip("#").strip()
    match = UTM.fullmatch(word)
    if match:
        return f"EPSG:{32600 + int(match[1]) if match[2].upper() == 'N' else 32700 + int(match[1])}"
    if word.upper() in ("WGS84", "EPSG:4326"):
        return "Geog"
    try:
        crs.parse(word)
    except CrsError:
        raise InputError(
            f"{where}: the first line names a system (WGS84, WGS84 UTM 32N, EPSG:2154, +proj=...), "
            f"not {word[:60]!r}"
        ) from None
    return word


def _rows(path: Path) -> tuple[str, list[tuple[int, list[str]]]]:
    """The system of a list, and its rows with their lines."""
    lines = [(n, line) for n, line in enumerate(text_of(path).split("\n"), 1) if line.strip()]
    if not lines:
        raise InputError(f"{path}: the list is empty")
    system = system_of(lines[0][1], f"{path}:{lines[0][0]}")
    return system, [(n, line.split()) for n, line in lines[1:] if not line.lstrip().startswith("#")]


def _numbers(path: Path, line: int, words: list[str], said: str) -> list[float]:
    try:
        values = [float(word) for word in words]
    except ValueError:
        values = [np.nan]
    if not np.isfinite(values).all():
        raise InputError(f"{path}:{line}: {said}")
    return values


def add_positions(block: BundleAdjustment, folder: Path, scene: Node) -> None:
    """Observed positions: those of `geo.txt`, else those that the reconstruction has."""
    geo = _beside(folder, "geo.txt")
    if geo is not None:
        _add_geo(block, geo)
        return
    images, places, sigmas = [], [], []
    for name, shot in scene["shots"].items():
        position = shot.get("gps_position", None)
        if position.value is None:
            continue
        images.append(name)
        places.append(position.numbers(3))
        sigmas.append(shot.get("gps_dop", DOP).number() or DOP)
    if len(images) and np.ptp(np.array(places), axis=0).any():
        block.observe_antenna(images, places, sigmas)


def _add_geo(block: BundleAdjustment, path: Path) -> None:
    system, rows = _rows(path)
    images, places, sigmas = [], [], []
    said = "a position is: image, x, y, z [, omega, phi, kappa] [, accuracy in plan, accuracy in height]"
    for line, words in rows:
        if len(words) < 4:
            raise InputError(f"{path}:{line}: {said}")
        if words[0] not in block.camera_of:
            continue
        values = _numbers(path, line, words[1:9], said)
        plan = values[6] if len(values) > 6 and values[6] > 0.0 else DOP
        height = values[7] if len(values) > 7 and values[7] > 0.0 else plan
        images.append(words[0])
        places.append(values[:3])
        sigmas.append((plan, plan, height))
    if not images:
        return
    array = np.array(places)
    block.frame = frame_for(block, system, array, None)
    moved = np.asarray(crs.Transformer(crs.parse(system), crs.parse(block.frame)).forward(array, images))
    block.observe_antenna(images, moved, sigmas)


def _beside(folder: Path, name: str) -> Path | None:
    """A file in a folder, or in the one above it, as ODM has them."""
    return next((path for path in (folder / name, folder.parent / name) if path.is_file()), None)


def add_ground_points(block: BundleAdjustment, folder: Path) -> None:
    """Ground points and their marks: rows of one place, or of one name, are of one point."""
    path = _beside(folder, "gcp_list.txt")
    if path is None:
        return
    system, rows = _rows(path)
    said = "a ground point is: x, y, z, column, line, image [, name]"
    names: dict[tuple[object, ...], str] = {}
    places: dict[str, list[float]] = {}
    marks: dict[tuple[str, str], list[float]] = {}
    lost: list[str] = []
    for line, words in rows:
        if len(words) < 6:
            raise InputError(f"{path}:{line}: {said}")
        values = _numbers(path, line, words[:5], said)
        key = (words[6],) if len(words) > 6 else tuple(values[:3])
        name = names.setdefault(key, words[6] if len(words) > 6 else f"gcp-{len(names) + 1}")
        if places.setdefault(name, values[:3]) != values[:3]:
            raise InputError(f"{path}:{line}: point {name!r} has two places")
        if words[5] not in block.camera_of:
            lost.append(words[5])
        else:
            marks.setdefault((words[5], name), values[3:5])
    note_count(block, lost, "marks of ground points are in images that are not placed")
    if not marks:
        return
    array = np.array(list(places.values()))
    block.system, block.frame = system, frame_for(block, system, array, None)
    control = control_in_frame(ControlPoints.of(list(places), array, GROUND), system, block.frame)
    block.add_control_points(control)
    xy: FloatArray = np.array(list(marks.values())) + 0.5  # their first pixel has its centre at (0, 0)
    block.add_measures(
        ImagePoints.of([key[0] for key in marks], [key[1] for key in marks], xy, 1.0), name="ground points"
    )
    block.notes.append(
        f"{path}: {len(places)} ground points have no accuracy: {GROUND:g} m is taken; {heights_said(system)}"
    )
