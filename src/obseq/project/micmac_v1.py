"""Orientations of MicMac v1: `Ori-<X>/Orientation-<image>.xml` and the calibrations they refer to."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.geometry import RigidMotion
from obseq.images import Camera
from obseq.project.xml_elements import root_of
from obseq.reading.text import read_bytes

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

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
    root = _parsed(place)
    outer = _one(root, "Externe", place)
    convention = root.findtext(".//KnownConv")
    if convention not in CONVENTIONS:
        raise InputError(f"{path}: convention {convention}: only {', '.join(CONVENTIONS)} is read")
    rows = [_numbers(_one(outer, f"ParamRotation/CodageMatr/L{k}", place), 3, place) for k in (1, 2, 3)]
    rotation = np.array(rows)
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > ORTHONORMAL or np.linalg.det(rotation) < 0.0:
        raise InputError(f"{path}: CodageMatr is no rotation")
    centre = np.array(_numbers(_one(outer, "Centre", place), 3, place))
    named = root.findtext(".//FileInterne")
    inner = _parsed(_calibration(place, named)) if named else root
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
    projection = root.findtext(".//TypeProj", "eProjStenope")
    if projection not in PROJECTIONS:
        raise InputError(f"{place}: projection {projection}: only {', '.join(PROJECTIONS)} is read")
    interior = root if root.find("PP") is not None else _holder(root, place)
    principal = np.array(_numbers(_one(interior, "PP", place), 2, place))
    focal = _numbers(_one(interior, "F", place), 1, place)[0]
    width, height = (int(value) for value in _numbers(_one(interior, "SzIm", place), 2, place))
    model = interior.find("CalibDistortion")
    coefficients = {} if model is None else _distortion(model, focal, principal, place)
    given = {name: value for name, value in coefficients.items() if value}
    degree = (5, *USUAL[1:]) if given.keys() & set(_COEFFICIENTS[USUAL[0] :]) else USUAL
    camera = Camera(place.stem, width, height, focal, principal, degree, given)
    return camera, ("F", "PPx", "PPy", *coefficients)


def _holder(root: Element, place: Path) -> Element:
    for node in root.iter():
        if node.find("PP") is not None and node.find("F") is not None:
            return node
    raise InputError(f"{place}: holds no calibration (PP and F)")


def _distortion(
    model: Element, focal: float, principal: np.ndarray[tuple[int], np.dtype[np.float64]], place: Path
) -> dict[str, float]:
    if model.find("ModNoDist") is not None:
        return {}
    standard = model.find("ModPhgrStd")
    radial = standard.find("RadialePart") if standard is not None else model.find("ModRad")
    if radial is None:
        names = ", ".join(node.tag for node in model) or "nothing"
        raise InputError(f"{place}: distortion {names}: only ModNoDist, ModRad and ModPhgrStd are read")
    centre = np.array(_numbers(_one(radial, "CDist", place), 2, place))
    if np.abs(centre - principal).max() > 1e-6 * focal:
        raise InputError(
            f"{place}: the centre of distortion {centre} is not the principal point {principal}; "
            "such a calibration has no exact form here"
        )
    values = [_numbers(node, 1, place)[0] for node in radial.findall("CoeffDist")]
    if any(values[len(_COEFFICIENTS) :]):
        raise InputError(f"{place}: more than {len(_COEFFICIENTS)} radial coefficients are not read")
    found = {
        name: value * focal ** (2 * (k + 1))
        for k, (name, value) in enumerate(zip(_COEFFICIENTS, values, strict=False))
    }
    if standard is not None:
        powers = {"P1": ("p1", 1), "P2": ("p2", 1), "b1": ("b1", 0), "b2": ("b2", 0)}
        for tag, (name, power) in powers.items():
            node = standard.find(tag)
            found[name] = (0.0 if node is None else _numbers(node, 1, place)[0]) * focal**power
    return found


def _parsed(path: Path) -> Element:
    return root_of(path, read_bytes(path))


def _one(node: Element, name: str, place: Path) -> Element:
    found = node.find(name) if node.find(name) is not None else node.find(f".//{name}")
    if found is None:
        raise InputError(f"{place}: {name} is missing")
    return found


def _numbers(node: Element, count: int, place: Path) -> list[float]:
    try:
        values = [float(word) for word in (node.text or "").split()]
    except ValueError:
        values = []
    if len(values) != count or not np.isfinite(values).all():
        raise InputError(f"{place}: {node.tag} should be {count} finite numbers, not {node.text!r}")
    return values
