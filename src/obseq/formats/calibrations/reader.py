"""Calibrations as YAML: OpenCV's, those of ROS (`camera_info`), camera chains of kalibr, sensors of EuRoC.

All have the middle of the first pixel at (0, 0); here it is at (0.5, 0.5). Their models are those of COLMAP.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from obseq.errors import InputError, naming
from obseq.formats.colmap.models import camera_of
from obseq.images.camera import Camera
from obseq.reading.text import quoted, read_text

SUFFIXES = (".yaml", ".yml")
LARGEST = 1_000_000
"""Characters of a file: calibrations have some hundreds."""
FISH_EYES = ("equidistant", "fisheye", "equi")
"""What the four terms of an angle are called."""
PLANE = ("", "plumb_bob", "rational_polynomial", "radtan")
"""What those of a plane are called."""
KALIBR = {
    "radtan": ("OPENCV", 4),
    "radial-tangential": ("OPENCV", 4),
    "equidistant": ("OPENCV_FISHEYE", 4),
    "equi": ("OPENCV_FISHEYE", 4),
    "fov": ("FOV", 1),
    "none": ("PINHOLE", 0),
}
"""Models of COLMAP, and numbers of terms, by kalibr's distortion."""
MATRICES = ("camera_matrix", "K", "k", "cameraMatrix")
TERMS = (
    "distortion_coefficients",
    "distortion_coefficents",
    "distortion_coeffs",
    "D",
    "d",
    "distCoeffs",
    "dist_coeffs",
)
"""What files call the matrix of a camera, and the terms of its distortion."""
HALF = 0.5


def read_calibrations(path: Path) -> list[Camera]:
    """The cameras of a file; one without a name is called like the file.

    Raises:
        InputError: The file is none of these, or has a model that ours does not reach.
    """
    content = _content(path)
    chain = {name: item for name, item in content.items() if isinstance(item, dict) and "intrinsics" in item}
    if "intrinsics" in content:
        chain = {str(content.get("sensor_name") or path.stem): content}
    if chain:
        return [_of_kalibr(f"{path}: {name}", str(name), item) for name, item in chain.items()]
    matrix = next((name for name in MATRICES if name in content), None)
    if matrix is None:
        raise InputError(
            f"{path}: no calibration of OpenCV or ROS (camera_matrix), nor of kalibr (intrinsics)"
        )
    return [_of_opencv(path, content, matrix)]


def _content(path: Path) -> dict[str, object]:
    try:
        import yaml
    except ImportError as error:
        raise InputError(f"{path}: YAML needs PyYAML; install it (pip install obseq[yaml])") from error
    lines = read_text(path).lines
    text = "\n".join(line.replace("!!opencv-matrix", "") for line in lines if not line.startswith("%YAML"))
    if len(text) > LARGEST:
        raise InputError(f"{path}: {len(text)} characters are no calibration")
    try:
        content = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        place = getattr(error, "problem_mark", None)
        where = f":{place.line + 1}" if place is not None else ""
        raise InputError(f"{path}{where}: no YAML: {getattr(error, 'problem', None) or error}") from None
    if not isinstance(content, dict):
        raise InputError(f"{path}: a calibration has names and values, as 'image_width: 640'")
    return content


def _of_kalibr(where: str, name: str, item: dict[str, object]) -> Camera:
    model, distortion = item.get("camera_model", "pinhole"), item.get("distortion_model", "none")
    terms = _terms(where, item)
    values = _numbers(where, "intrinsics", item["intrinsics"])
    size = _numbers(where, "resolution", item.get("resolution", []))
    if model == "eucm" and distortion == "none" and len(values) == 6:
        kind, terms, values = "EUCM", values[:2], values[2:]
    elif model == "pinhole" and distortion in KALIBR and len(values) == 4:
        kind, count = KALIBR[distortion]
        if len(terms) != count:
            raise InputError(f"{where}: {distortion} has {count} terms, not {len(terms)}")
    else:
        raise InputError(
            f"{where}: {quoted(f'{model}-{distortion}')} is no model that is read (pinhole with "
            f"{', '.join(KALIBR)}; eucm)"
        )
    return _camera(where, name, kind, size, values, terms)


def _of_opencv(path: Path, content: dict[str, object], matrix: str) -> Camera:
    where = str(path)
    k = _numbers(where, matrix, _data(content[matrix]))
    if len(k) != 9:
        raise InputError(f"{where}: {matrix} has {len(k)} numbers, not 9")
    if k[1] or k[3] or list(k[6:]) != [0.0, 0.0, 1.0]:
        raise InputError(f"{where}: {matrix} has a skew or a last row that is not 0 0 1")
    terms = _terms(where, content)
    words = content.get("distortion_model") or content.get("camera_model") or ""
    model = str(words).lower()
    size = [content.get(f"image_{side}", content.get(side, math.nan)) for side in ("width", "height")]
    name = str(content.get("camera_name") or path.stem)
    values = [k[0], k[4], k[2], k[5]]
    if model in FISH_EYES or content.get("fisheye_model") in (1, True):
        if len(terms) != 4:
            raise InputError(f"{where}: a fish-eye has 4 terms, not {len(terms)}")
        return _camera(where, name, "OPENCV_FISHEYE", size, values, terms)
    if model not in PLANE and model != "pinhole":
        raise InputError(
            f"{where}: {quoted(model)!r} is no distortion that is read ({', '.join(PLANE[1:])}, "
            f"{', '.join(FISH_EYES)})"
        )
    if any(terms[8:]):
        raise InputError(f"{where}: terms of a thin prism, or of a tilted sensor, are not read")
    terms = [*terms[:8], *[0.0] * (8 - len(terms))]
    if not any(terms[4:]):
        return _camera(where, name, "OPENCV", size, values, terms[:4])
    return _camera(where, name, "FULL_OPENCV", size, values, terms)


def _camera(
    where: str, name: str, model: str, size: Sequence[object], values: Sequence[float], terms: Sequence[float]
) -> Camera:
    if math.nan in size or not size:
        raise InputError(f"{where}: the size of the image is missing; add image_width and image_height")
    sides = _numbers(where, "the size of the image", list(size))
    if len(sides) != 2 or not all(1.0 <= side < 1e6 and side == int(side) for side in sides):
        raise InputError(f"{where}: the size of the image (width, height) is wrong")
    middle = [value + HALF for value in values[2:]]
    given = [*values[:2], *middle, *terms]
    with naming(where):
        return camera_of(name, model, (int(sides[0]), int(sides[1])), given)


def _terms(where: str, content: dict[str, object]) -> list[float]:
    """The terms of the distortion, as a file calls them."""
    found = next((name for name in TERMS if name in content), None)
    return _numbers(where, found, _data(content[found])) if found else []


def _data(item: object) -> object:
    """Numbers of a matrix: its `data`, rows, or themselves."""
    found = item.get("data", []) if isinstance(item, dict) else item
    return list(_flat(found)) if isinstance(found, list) else found


def _flat(items: list[object]) -> Iterator[object]:
    for item in items:
        if isinstance(item, list):
            yield from item
        else:
            yield item


def _numbers(where: str, what: str | None, given: object) -> list[float]:
    """A list of finite numbers; YAML reads 1e-3 without a point as a text."""
    try:
        found = [float(str(value)) for value in given] if isinstance(given, list) else [math.nan]
    except ValueError:
        found = [math.nan]
    if not np.isfinite(found).all():
        raise InputError(f"{where}: {what} is no list of numbers")
    return found
