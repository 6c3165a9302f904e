"""Camera bodies by name: they turn a focal length in millimetres into pixels (MMVII's delivered list)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.images import Camera

if TYPE_CHECKING:
    from obseq.project.metadata import Rules


@dataclass(frozen=True)
class Body:
    """A camera body.

    Attributes:
        pixel_microns: size of a pixel.
        size: (width, height) of its full images.
    """

    pixel_microns: float
    size: tuple[int, int]


BODIES = {
    "UltraCam Eagle Mark 3": Body(4.0, (26460, 17004)),
    "NIKON D5600": Body(3.90, (6000, 4000)),
    "NIKON D3X": Body(5.95, (6048, 4032)),
    "SONY A6400": Body(3.9, (6000, 4000)),
    "ILCE-6400": Body(3.9, (6000, 4000)),
    "DIAG-ILCE-6400": Body(5.5, (5023, 5023)),
}


def initial_camera(
    rules: Rules,
    image: str,
    *,
    size: tuple[int, int] | None = None,
    degree: tuple[int, int, int] = (3, 1, 1),
    projection: str = "Stenope",
    fraser: bool = True,
) -> Camera:
    """The calibration that metadata give of an image, without distortion.

    The focal length is that of ``FocalPix``, or of ``Focalmm`` and the body, whose ratio of diagonals to
    `size` allows for reduced images. A focal length in pixels needs no body (the original asks for one all
    the same).

    Args:
        rules: of the project.
        image: name of the image.
        size: (width, height) of the image; that of the body when None.
        degree: of the distortion.
        projection: of the camera.
        fraser: choice of the terms of degree 1.

    Raises:
        InputError: a rule is missing, or the body is unknown and needed.
    """
    body = BODIES.get(rules.value("ModelCam", image) or "")
    if size is None:
        size = _body(body, rules, image).size
    pixels = rules.value("FocalPix", image)
    if pixels is not None:
        focal = float(pixels)
    else:
        known = _body(body, rules, image)
        millimetres = float(rules.value("Focalmm", image) or np.nan)
        reduction = float(np.hypot(*known.size) / np.hypot(*size))
        focal = 1000.0 * millimetres / (reduction * known.pixel_microns)
    principal = rules.value("PPPix", image)
    middle = np.array(size) / 2.0 if principal is None else np.array([float(v) for v in principal.split()])
    name = rules.calibration_name(image)
    return Camera(name, *size, focal, middle, degree, {}, projection, fraser)


def _body(body: Body | None, rules: Rules, image: str) -> Body:
    if body is None:
        model = rules.value("ModelCam", image)
        raise InputError(
            f"image {image}: the camera {model!r} is unknown; give the focal in pixels (rule FocalPix) and "
            f"the size of the image. Known are {', '.join(BODIES)}"
        )
    return body
