"""Rigs and frames of COLMAP, since version 3.12: `rigs` and `frames`, as text or binary."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.formats.colmap.model import Bytes, floats, lines, whole
from obseq.geometry import RigidMotion, rotations_from

CAMERA = "CAMERA"
IDENTITY = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class ColmapRig:
    """A rig.

    Attributes:
        number: of the rig.
        reference: number of the camera whose frame is that of the rig.
        places: from the cameras, by number, to the rig; None where the file says none.
        exposures: (camera, frame, image) by number.
    """

    number: int
    reference: int
    places: dict[int, RigidMotion | None]
    exposures: list[tuple[int, int, int]]


def read_rigs(folder: Path) -> list[ColmapRig]:
    """The rigs of a model, none where it has no such files.

    Raises:
        InputError: a file is broken.
    """
    for ending, rigs_of, frames_of in (
        ("bin", _binary_rigs, _binary_frames),
        ("txt", _text_rigs, _text_frames),
    ):
        paths = folder / f"rigs.{ending}", folder / f"frames.{ending}"
        if all(path.is_file() for path in paths):
            rigs = {rig.number: rig for rig in rigs_of(paths[0])}
            for rig, frame, camera, image in frames_of(paths[1]):
                if rig not in rigs:
                    raise InputError(f"{paths[1]}: frame {frame} is of rig {rig}, which is not in rigs")
                rigs[rig].exposures.append((camera, frame, image))
            return list(rigs.values())
    return []


def lone_files(folder: Path) -> list[str]:
    """Files of rigs or frames that have not the other beside them in their form."""
    names = {
        ending: [f"{stem}.{ending}" for stem in ("rigs", "frames") if (folder / f"{stem}.{ending}").is_file()]
        for ending in ("bin", "txt")
    }
    both = any(len(found) == 2 for found in names.values())
    return [] if both else [name for found in names.values() for name in found]


def _place(values: tuple[float, ...], where: str) -> RigidMotion:
    """From a camera to its rig: the file has the way back, a quaternion and a shift."""
    if not 1e-100 < max(map(abs, values[:4])) < 1e100:
        raise InputError(f"{where}: {list(values[:4])} is no rotation")
    rotation = rotations_from(np.array([values[:4]]), "quaternion")[0]
    return RigidMotion(np.array(values[4:7]), rotation).inverse()


def _text_rigs(path: Path) -> list[ColmapRig]:
    found = []
    for line, words in lines(path):
        where, rest = f"{path}:{line}", words[4:]
        if len(words) < 2 or (words[1] != "0" and len(words) < 4):
            raise InputError(f"{where}: a rig is: number, sensors, type and number of the reference, sensors")
        if words[1] == "0" or words[2] != CAMERA:
            continue
        reference = whole(path, line, words[3])
        places: dict[int, RigidMotion | None] = {reference: _place(IDENTITY, where)}
        while rest:
            has_pose = len(rest) > 2 and rest[2] == "1"
            taken, rest = rest[: 10 if has_pose else 3], rest[10 if has_pose else 3 :]
            if len(taken) < (10 if has_pose else 3):
                raise InputError(f"{where}: a sensor is: type, number, 1 and its pose, or 0")
            if taken[0] == CAMERA:
                pose = _place(tuple(floats(path, line, taken[3:], 7)), where) if has_pose else None
                places[whole(path, line, taken[1])] = pose
        found.append(ColmapRig(whole(path, line, words[0]), reference, places, []))
    return found


def _text_frames(path: Path) -> list[tuple[int, int, int, int]]:
    found = []
    for line, words in lines(path):
        if len(words) < 10 or (len(words) - 10) % 3:
            raise InputError(f"{path}:{line}: a frame is: number, rig, pose, number of data, data")
        frame, rig = whole(path, line, words[0]), whole(path, line, words[1])
        for k in range(10, len(words), 3):
            if words[k] == CAMERA:
                camera, image = whole(path, line, words[k + 1]), whole(path, line, words[k + 2])
                found.append((rig, frame, camera, image))
    return found


def _binary_rigs(path: Path) -> list[ColmapRig]:
    file, found = Bytes(path), []
    for _ in range(file.whole("Q")):
        number, sensors = file.whole("I"), file.whole("I")
        if not sensors:
            continue
        kind, reference = file.whole("i"), file.whole("I")
        places: dict[int, RigidMotion | None] = {reference: _place(IDENTITY, str(path))}
        for _ in range(sensors - 1):
            other, sensor, has_pose = file.whole("i"), file.whole("I"), file.whole("B")
            pose = _place(tuple(map(float, file.take("7d"))), str(path)) if has_pose else None
            if not other:
                places[sensor] = pose
        if not kind:
            found.append(ColmapRig(number, reference, places, []))
    file.finish()
    return found


def _binary_frames(path: Path) -> list[tuple[int, int, int, int]]:
    file, found = Bytes(path), []
    for _ in range(file.whole("Q")):
        frame, rig = file.whole("I"), file.whole("I")
        file.take("7d")
        for _ in range(file.whole("I")):
            kind, camera, image = file.whole("i"), file.whole("I"), file.whole("Q")
            if not kind:
                found.append((rig, frame, camera, image))
    file.finish()
    return found
