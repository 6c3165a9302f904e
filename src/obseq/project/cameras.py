"""Calibrations and poses of a project: `cPerspCamIntrCalib` and `cSensorCamPC` files, read and written."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from obseq.arrays import FloatArray
from obseq.errors import InputError
from obseq.geometry import RigidMotion, attitudes
from obseq.images import Camera, Poses
from obseq.images.names import unique_names
from obseq.project.instruments.rigid_blocks import is_rotation
from obseq.project.tree import Number, Reader, Tree, file_in, files_in, merged, read_tree, tree_text
from obseq.writing import write_all

CALIBRATION, POSE = "InternalCalibration", "CameraPose"
POSE_PREFIX = "Ori-PerspCentral-"
IMAGE_CALIBRATION = "Calib-PerspCentral-"
"""What the names of calibrations begin with that belong to one image."""
NO_CALIBRATION = "NONE"
_NUMERICAL = ("SzBuffer", "DegreeApproxInv")
"""Settings of the original's numerical inverse."""
_KINDS = {"K": "Radial", "p": "Decentric"}


def read_calibration(path: str | Path) -> Camera:
    """The camera of a calibration file, any projection and degree.

    Raises:
        InputError: with file and field; the name inside is not that of the file.
    """
    place = Path(path)
    fields = Reader(read_tree(place), str(path)).fields(CALIBRATION)
    name = fields.text("Name")
    if name != place.stem:
        raise InputError(f"{path}: the calibration inside is called {name!r}; it must be called as its file")
    width, height = fields.fields("PixelFrame").numbers("NbPix", 2)
    auxiliary, perfect = fields.fields("Auxiliary"), fields.fields("PerfectProj")
    radial, decentric, general = (int(part) for part in auxiliary.numbers("Degree", 3))
    coefficients: dict[str, float] = {}
    distortion = fields.fields("Distorsion")
    for kind in ("Radial", "Decentric", "Polynomial"):
        if distortion.has(kind):
            part = Reader(distortion.mapping(kind), f"{path}: Distorsion: {kind}")
            coefficients |= {key: float(part.number(key)) for key in distortion.mapping(kind)}
    return Camera(
        name,
        int(width),
        int(height),
        focal=float(perfect.number("F")),
        principal_point=np.array(perfect.numbers("PP", 2), dtype=np.float64),
        degree=(radial, decentric, general),
        distortion=coefficients,
        projection=fields.text("Projection"),
        fraser=bool(auxiliary.integer("IsFraserMode", 1)),
    )


def calibration_text(camera: Camera, *, source: Tree | None = None, as_json: bool = False) -> str:
    """The file of a calibration.

    Args:
        camera: the camera.
        source: what stands under `InternalCalibration` in the file that it was read from; what it has besides
            the numbers of the camera is kept.
        as_json: True for JSON.

    Raises:
        InputError: the distortion is of a kind that these files do not have.
    """
    if not camera.is_mmvii:
        raise InputError(
            f"camera {camera.name}: no calibration file of MMVII says the distortion of {camera.formula}; "
            "adjust with one of the catalogue (a degree, backward=False) to write one"
        )
    values = dict(zip(camera.coefficient_names, map(float, camera.coefficients), strict=True))
    parts: dict[str, dict[str, Tree]] = {"Radial": {}, "Decentric": {}, "Polynomial": {}}
    for key, value in values.items():
        parts[_KINDS.get(key[0], "Polynomial")][key] = (value,)
    degree: Tree = tuple(camera.degree)
    content: dict[str, Tree] = {
        "Name": camera.name,
        "PixelFrame": {"NbPix": (int(camera.width), int(camera.height))},
        "Projection": camera.projection,
        "Auxiliary": {
            "SzBuffer": (-1,),
            "Degree": degree,
            "DegreeApproxInv": degree,
            "IsFraserMode": (int(camera.fraser),),
        },
        "PerfectProj": {"F": (float(camera.focal),), "PP": _tuple(camera.principal_point)},
        "Distorsion": {kind: part for kind, part in parts.items() if part},
        "Informations": [],
    }
    return tree_text(CALIBRATION, _kept(source, content), as_json=as_json)


def _kept(source: Tree | None, content: dict[str, Tree]) -> Tree:
    """The content with what its source says of things that a camera does not have."""
    if not isinstance(source, dict):
        return content
    old = source.get("Auxiliary", {})
    auxiliary = content["Auxiliary"]
    assert isinstance(auxiliary, dict)
    same = isinstance(old, dict) and old.get("Degree") == auxiliary["Degree"]
    own = {key: old[key] for key in _NUMERICAL if same and isinstance(old, dict) and key in old}
    information = {"Informations": source["Informations"]} if "Informations" in source else {}
    return merged(source, {**content, "Auxiliary": {**auxiliary, **own}, **information})


def calibration_source(folder: str | Path, name: str) -> Tree | None:
    """What stands in the file of a calibration in a folder of orientations; None where there is none."""
    return _source(folder, name, CALIBRATION)


def _source(folder: str | Path, stem: str, tag: str) -> Tree | None:
    """What stands under a tag in a file of a folder, XML or JSON; None where there is none."""
    path = file_in(folder, stem)
    return None if path is None else read_tree(path).get(tag)


def read_pose(path: str | Path) -> tuple[str, str, RigidMotion]:
    """Name of the image, name of its calibration, and pose (camera to world) of a pose file.

    Raises:
        InputError: with file and field; axes that are not orthonormal.
    """
    fields = Reader(read_tree(path), str(path)).fields(POSE)
    axes = fields.fields("RotMatrix")
    rotation = np.array([axes.numbers(f"Axe{letter}", 3) for letter in "IJK"], dtype=np.float64).T
    if not is_rotation(rotation):
        raise InputError(f"{path}: RotMatrix is no rotation: its axes are not orthonormal and right-handed")
    centre = np.array(fields.numbers("Center", 3), dtype=np.float64)
    return fields.text("NameImage"), fields.text("NameInternalCalib"), RigidMotion(centre, rotation)


def pose_text(
    image: str, calibration: str, pose: RigidMotion, *, source: Tree | None = None, as_json: bool = False
) -> str:
    """The file of a pose; quaternion and angles are there for information, as in the original.

    Args:
        image: its name.
        calibration: name of its calibration.
        pose: camera to world.
        source: what stands under `CameraPose` in the file that it was read from; what it has besides is kept.
        as_json: True for JSON.
    """
    rotation = pose.rotation[None]
    content: Tree = {
        "NameImage": image,
        "NameInternalCalib": calibration or NO_CALIBRATION,
        "Center": _tuple(pose.centre),
        "RotMatrix": {f"Axe{letter}": _tuple(pose.rotation[:, k]) for k, letter in enumerate("IJK")},
        "EQ": _tuple(attitudes(rotation, "quaternion")[0]),
        "WPK": _tuple(np.rad2deg(attitudes(rotation, "wpk")[0])),
        "YPR": _tuple(np.rad2deg(attitudes(rotation, "ypr")[0])),
    }
    return tree_text(POSE, merged(source or {}, content), as_json=as_json)


def read_orientation(
    folder: str | Path, images: Iterable[str] | None = None
) -> tuple[Poses, dict[str, Camera]]:
    """The poses of a folder of orientations and the calibrations they refer to, by name.

    Args:
        folder: ``MMVII-PhgrProj/Ori/<Folder>``.
        images: names of images, or None for all that have a pose.

    Raises:
        InputError: a pose or its calibration is missing, or a file is wrong.
    """
    place = Path(folder)
    files = _pose_files(place) if images is None else [_pose_file(place, image) for image in images]
    read = [read_pose(path) for path in files]
    cameras = {
        name: read_calibration_of(place, name, image)
        for name, image in {calibration: image for image, calibration, _ in read}.items()
        if name != NO_CALIBRATION
    }
    poses = Poses(  # matrices as they stand in the files, not orthonormalised: the round trip is exact
        unique_names([image for image, _, _ in read], f"{folder}: image"),
        np.array([pose.centre for _, _, pose in read]).reshape(-1, 3),
        np.array([pose.rotation for _, _, pose in read]).reshape(-1, 3, 3),
        tuple("" if calibration == NO_CALIBRATION else calibration for _, calibration, _ in read),
    )
    return poses, cameras


def orientation_files(
    folder: str | Path,
    poses: Poses,
    cameras: dict[str, Camera],
    *,
    source: str | Path | None = None,
    as_json: bool = False,
) -> dict[Path, str]:
    """Poses and calibrations as the files of a folder of orientations.

    Args:
        folder: where they go.
        poses: of the images.
        cameras: by name.
        source: folder that poses and calibrations come from; what their files hold besides is kept.
        as_json: True for JSON.
    """
    place = Path(folder)
    ending = "json" if as_json else "xml"
    texts = {
        place / f"{POSE_PREFIX}{image}.{ending}": pose_text(
            image,
            camera,
            poses[image],
            source=None if source is None else _source(source, f"{POSE_PREFIX}{image}", POSE),
            as_json=as_json,
        )
        for image, camera in zip(poses.images, poses.cameras, strict=True)
    }
    texts |= {
        place / f"{camera.name}.{ending}": calibration_text(
            camera,
            source=None if source is None else calibration_source(source, camera.name),
            as_json=as_json,
        )
        for camera in cameras.values()
    }
    return texts


def write_orientation(
    folder: str | Path, poses: Poses, cameras: dict[str, Camera], *, as_json: bool = False
) -> None:
    """Write the files of `orientation_files`, all or none."""
    write_all(dict(orientation_files(folder, poses, cameras, as_json=as_json)))


def read_first_calibration(folder: Path, names: Sequence[str], image: str) -> Camera:
    """The calibration of the first of several names that is in a folder of orientations.

    Raises:
        InputError: if none is there; the image that needs it, and the first name, are named.
    """
    for name in names[1:]:
        if file_in(folder, name):
            return read_calibration_of(folder, name, image)
    return read_calibration_of(folder, names[0], image)


def read_calibration_of(folder: Path, name: str, image: str) -> Camera:
    """The calibration of a name in a folder of orientations.

    Raises:
        InputError: if it is not there; the image that needs it is named.
    """
    return read_calibration(_calibration_file(folder, name, image))


def _pose_files(folder: Path) -> list[Path]:
    if not folder.is_dir():
        raise InputError(f"{folder}: there is no such folder of orientations")
    found = files_in(folder, POSE_PREFIX)
    if not found:
        raise InputError(f"{folder}: holds no pose ({POSE_PREFIX}<image>.xml or .json)")
    return found


def _pose_file(folder: Path, image: str) -> Path:
    if path := file_in(folder, f"{POSE_PREFIX}{image}"):
        return path
    raise InputError(f"{folder}: there is no pose of the image {image} ({POSE_PREFIX}{image}.xml)")


def _calibration_file(folder: Path, name: str, image: str) -> Path:
    if path := file_in(folder, name):
        return path
    raise InputError(f"{folder}: the image {image} needs the calibration {name}.xml, which is not there")


def _tuple(values: FloatArray) -> tuple[Number, ...]:
    return tuple(float(value) for value in values)
