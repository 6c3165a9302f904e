"""MicMac v1: orientations and calibrations, measures of points in images, and coordinates of points."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from obseq.arrays import FloatArray
from obseq.errors import InputError, naming
from obseq.formats.blocks.reading import hold_all_but, new_block
from obseq.geometry import RigidMotion
from obseq.images import BundleAdjustment, Camera, ControlPoints, ImagePoints, Poses
from obseq.reading.origin import Origin
from obseq.reading.xml import Element, read_xml

PREFIX = "Orientation-"
MEASURES, POINTS = "SetOfMesureAppuisFlottants", "DicoAppuisFlottant"
CONVENTIONS = ("eConvApero_DistM2C",)
PROJECTIONS = ("eProjStenope",)
ORTHONORMAL = 1e-6
_COEFFICIENTS = ("K1", "K2", "K3", "K4", "K5")
USUAL = (3, 1, 1)
"""Degree of a camera, and its radial terms where it has no more."""


def read_v1_orientation(path: str | Path) -> tuple[RigidMotion, Camera]:
    """The pose (camera to world) and the camera of an image; see `read_v1_image`."""
    return read_v1_image(path)[:2]


def read_v1_image(path: str | Path) -> tuple[RigidMotion, Camera, tuple[str, ...]]:
    """The pose (camera to world) of an image, its camera, and the parameters that the camera has in v1.

    The distortion models `ModPhgrStd`, `ModRad` and `ModNoDist` are read, with their centre at the principal
    point; coefficients in pixels become those of obseq by powers of the focal length.

    Raises:
        InputError: another convention, projection or model, which the message names; a missing field.
    """
    place = Path(path)
    root = read_xml(place)
    outer = _one(root, "Externe")
    convention = _text(root, "KnownConv")
    if convention not in CONVENTIONS:
        raise InputError(f"{path}: convention {convention}: only {', '.join(CONVENTIONS)} is read")
    rows = [_numbers(outer, f"ParamRotation/CodageMatr/L{k}", 3) for k in (1, 2, 3)]
    rotation = np.array(rows)
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > ORTHONORMAL or np.linalg.det(rotation) < 0.0:
        raise InputError(f"{path}: CodageMatr is no rotation")
    centre = np.array(_numbers(outer, "Centre", 3))
    named = _text(root, "FileInterne")
    inner = read_xml(_calibration(place, named)) if named else root
    return RigidMotion(centre, rotation), *_camera(
        inner, place if named is None else _calibration(place, named)
    )


def _calibration(place: Path, named: str) -> Path:
    """The calibration is named from the folder of the chantier, or lies beside the orientation."""
    for folder in (place.parent.parent, place.parent):
        if (path := folder / named.strip()).is_file():
            return path
    beside = place.parent / Path(named.strip()).name
    if beside.is_file():
        return beside
    raise InputError(f"{place}: its calibration {named.strip()} is not there")


def _camera(root: Element, place: Path) -> tuple[Camera, tuple[str, ...]]:
    projection = _text(root, "TypeProj") or "eProjStenope"
    if projection not in PROJECTIONS:
        raise InputError(f"{place}: projection {projection}: only {', '.join(PROJECTIONS)} is read")
    interior = root if root.first("PP") is not None else _holder(root, place)
    principal = np.array(_numbers(interior, "PP", 2))
    focal = _numbers(interior, "F", 1)[0]
    width, height = (int(value) for value in _numbers(interior, "SzIm", 2))
    model = interior.first("CalibDistortion")
    coefficients = {} if model is None else _distortion(model, focal, principal, place)
    given = {name: value for name, value in coefficients.items() if value}
    degree = (5, *USUAL[1:]) if given.keys() & set(_COEFFICIENTS[USUAL[0] :]) else USUAL
    camera = Camera(place.stem, width, height, focal, principal, degree, given)
    return camera, ("F", "PPx", "PPy", *coefficients)


def _holder(root: Element, place: Path) -> Element:
    for node in _within(root):
        if node.first("PP") is not None and node.first("F") is not None:
            return node
    raise InputError(f"{place}: holds no calibration (PP and F)")


def _distortion(model: Element, focal: float, principal: FloatArray, place: Path) -> dict[str, float]:
    if model.first("ModNoDist") is not None:
        return {}
    standard = model.first("ModPhgrStd")
    radial = standard.first("RadialePart") if standard is not None else model.first("ModRad")
    if radial is None:
        names = ", ".join(node.name for node in model.children) or "nothing"
        raise InputError(f"{place}: distortion {names}: only ModNoDist, ModRad and ModPhgrStd are read")
    centre = np.array(_numbers(radial, "CDist", 2))
    if np.abs(centre - principal).max() > 1e-6 * focal:
        raise InputError(
            f"{place}: the centre of distortion {centre} is not the principal point {principal}; "
            "such a calibration has no exact form here"
        )
    values = [_parsed(node, "CoeffDist", 1)[0] for node in radial.named("CoeffDist")]
    if any(values[len(_COEFFICIENTS) :]):
        raise InputError(f"{place}: more than {len(_COEFFICIENTS)} radial coefficients are not read")
    found = {
        name: value * focal ** (2 * (k + 1))
        for k, (name, value) in enumerate(zip(_COEFFICIENTS, values, strict=False))
    }
    if standard is not None:
        powers = {"P1": ("p1", 1), "P2": ("p2", 1), "b1": ("b1", 0), "b2": ("b2", 0)}
        for tag, (name, power) in powers.items():
            value = 0.0 if standard.first(tag) is None else _numbers(standard, tag, 1)[0]
            found[name] = value * focal**power
    return found


def read_v1_block(
    orientation: str | Path,
    measures: str | Path | None = None,
    points: str | Path | None = None,
    image_sigma: float = 1.0,
) -> BundleAdjustment:
    """A block of MicMac v1.

    Args:
        orientation: a folder ``Ori-X`` with files ``Orientation-<image>.xml``.
        measures: file of points measured in images (`SetOfMesureAppuisFlottants`).
        points: file of coordinates (`DicoAppuisFlottant`); a negative uncertainty leaves a point free.
        image_sigma: of the measures, pixels: their file has none.

    Raises:
        InputError: a file is missing, or holds what is not read; measures of an image without orientation.
    """
    with new_block(orientation) as block:
        poses = _add_poses(block, Path(orientation))
        if points is not None:
            block.add_control_points(read_v1_points(points), Origin(str(points)))
        if measures is not None:
            found = read_v1_measures(measures, image_sigma)
            lost = [name for name in found.image_names if name not in poses]
            if lost:
                raise InputError(f"{measures}: the image {lost[0]} has no orientation in {orientation}")
            block.add_measures(found, name=Path(measures).name, origin=Origin(str(measures)))
    return block


def _add_poses(block: BundleAdjustment, folder: Path) -> Poses:
    files = sorted(folder.glob(f"{PREFIX}*.xml"))
    if not files:
        raise InputError(f"{folder}: holds no orientation ({PREFIX}<image>.xml)")
    cameras: dict[str, Camera] = {}
    terms: dict[str, tuple[str, ...]] = {}
    centres, rotations, owners = [], [], []
    for path in files:
        pose, camera, own = read_v1_image(path)
        cameras.setdefault(camera.name, camera)
        terms.setdefault(camera.name, own)
        centres.append(pose.centre)
        rotations.append(pose.rotation)
        owners.append(camera.name)
    block.add_cameras(*cameras.values())
    hold_all_but(block, terms)
    names = [path.name[len(PREFIX) : -len(path.suffix)] for path in files]
    poses = Poses.of(names, centres, rotations, cameras=owners)
    block.add_poses(poses)
    return poses


def read_v1_points(path: str | Path) -> ControlPoints:
    """The points of a `DicoAppuisFlottant`; negative uncertainties leave them free, zeros hold them."""
    names, places, sigmas = [], [], []
    for one in _all(_root(path, POINTS), "OneAppuisDAF"):
        names.append(one.content("NamePt"))
        places.append(_numbers(one, "Pt", 3))
        given = np.array(_numbers(one, "Incertitude", 3))
        sigmas.append(np.where(given < 0.0, np.inf, given))
    with naming(path):
        return ControlPoints.of(names, np.array(places).reshape(-1, 3), np.array(sigmas).reshape(-1, 3))


def read_v1_measures(path: str | Path, sigma: float = 1.0) -> ImagePoints:
    """The measures of a `SetOfMesureAppuisFlottants`."""
    images, points, xy = [], [], []
    for image in _all(_root(path, MEASURES), "MesureAppuiFlottant1Im"):
        for one in image.named("OneMesureAF1I"):
            images.append(image.content("NameIm"))
            points.append(one.content("NamePt"))
            xy.append(_numbers(one, "PtIm", 2))
    with naming(path):
        return ImagePoints.of(images, points, np.array(xy).reshape(-1, 2), sigma)


def _root(path: str | Path, tag: str) -> Element:
    """The element of a name: v1 wraps some files in `Global`."""
    root = read_xml(Path(path))
    found = root if root.name == tag else root.first(tag)
    if found is None:
        raise root.problem(f"{tag} is expected")
    return found


def _all(root: Element, tag: str) -> Iterator[Element]:
    found = list(root.named(tag))
    if not found:
        raise root.problem(f"it holds no {tag}")
    yield from found


def _within(element: Element) -> Iterator[Element]:
    """All elements in one, itself first, as they stand in the file."""
    yield element
    for child in element.children:
        yield from _within(child)


def _one(element: Element, path: str) -> Element:
    """The first element of a path, each step to a child, or to one farther in."""
    for name in path.split("/"):
        inner = (one for one in _within(element) if one.name == name and one is not element)
        found = element.first(name) or next(inner, None)
        if found is None:
            raise element.problem(f"{name} is missing")
        element = found
    return element


def _text(root: Element, name: str) -> str | None:
    """What stands in the first element of a name; None where there is none."""
    return next((one.plain for one in _within(root) if one.name == name), None)


def _numbers(element: Element, path: str, count: int) -> list[float]:
    """Finite numbers of the element at a path."""
    return _parsed(_one(element, path), path, count, element)


def _parsed(element: Element, name: str, count: int, blamed: Element | None = None) -> list[float]:
    try:
        values = [float(word) for word in element.plain.split()]
    except ValueError:
        values = []
    if len(values) != count or not np.isfinite(values).all():
        raise (blamed or element).problem(f"{name} should be {count} finite numbers")
    return values
