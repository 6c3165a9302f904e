"""Calibrations of Agisoft Metashape and PhotoScan as cameras of ours."""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.formats.fitted import fitted_camera
from obseq.formats.metashape.document import floats, label_of, number_of
from obseq.images.camera import Camera
from obseq.reading.xml import Element

DEGREE = (3, 1, 1)
KNOWN = ("f", "cx", "cy", "k1", "k2", "k3", "k4", "p1", "p2", "b1", "b2")
OURS = {
    "f": "F", "fx": "F", "fy": "F", "cx": "PPx", "cy": "PPy", "k1": "K1", "k2": "K2", "k3": "K3", "k4": "K4",
    "p1": "p1", "p2": "p2", "b1": "b1", "b2": "b2", "skew": "b2",
}  # fmt: skip
"""Our names of their parameters."""
USUAL = ("F", "PPx", "PPy", "K1", "K2", "K3", "p1", "p2")
"""What Metashape estimates unless it is told otherwise."""
OLD = ("fx", "fy", "cx", "cy", "skew", "k1", "k2", "k3", "k4", "p1", "p2")
"""Parameters of PhotoScan before 1.3."""


@dataclass(frozen=True, eq=False)
class Sensor:
    """A sensor as a camera.

    Attributes:
        number: of the sensor.
        camera: its camera.
        unknowns: parameters that were estimated.
        is_guessed: whether the file says nothing of them.
    """

    number: str
    camera: Camera
    unknowns: tuple[str, ...]
    is_guessed: bool = False


def read_sensor(sensor: Element) -> Sensor:
    """The camera of a sensor, and what is unknown of it: nothing where it is fixed."""
    camera, number = _camera(sensor), sensor.attributes.get("id", "")
    if _property(sensor, "fixed").lower() in ("true", "1"):
        return Sensor(number, camera, ())
    holders = [sensor, *sensor.named("calibration")]
    found = [item.content("params", "") for holder in holders for item in holder.named("covariance")]
    if found and found[-1]:
        names = dict.fromkeys(OURS[word] for word in found[-1].lower().split() if word in OURS)
        return Sensor(number, camera, tuple(names))
    calibration = _calibration(sensor)
    given = {} if calibration is None else _values(calibration)
    extra = [OURS[word] for word, value in given.items() if value and OURS[word] not in USUAL]
    return Sensor(number, camera, (*USUAL, *extra), True)


def _property(sensor: Element, name: str) -> str:
    """The value of a property; "" where there is none."""
    values = {
        item.attributes.get("name"): item.attributes.get("value", "") for item in sensor.named("property")
    }
    return values.get(name, "")


def _camera(sensor: Element) -> Camera:
    label, number = label_of(sensor), sensor.attributes.get("id", "")
    name = label if label.endswith(f" {number}") else f"{label} {number}".strip()
    kind = sensor.attributes.get("type", "frame")
    if kind != "frame":
        raise sensor.problem(f"a camera of type {kind} is not read; only frame is")
    if any("rolling_shutter" in item.name for item in sensor.children):
        raise sensor.problem("a camera with rolling shutter is not read")
    frame = sensor.first("resolution")
    if frame is None:
        raise sensor.problem("it has no resolution")
    size = (int(number_of(frame, "width")), int(number_of(frame, "height")))
    calibration = _calibration(sensor)
    if calibration is None:
        return _nominal(sensor, name, size)
    values = _values(calibration)
    return _of_photoscan(calibration, name, size, values) if "fx" in values else _brown(name, size, values)


def _calibration(sensor: Element) -> Element | None:
    """The calibration that was adjusted, else the initial one."""
    chosen = {item.attributes.get("class", "initial"): item for item in sensor.named("calibration")}
    return chosen.get("adjusted", chosen.get("initial"))


def _values(calibration: Element) -> dict[str, float]:
    """The parameters of a calibration, by name; those that are zero may have any."""
    given = {item.name: item for item in calibration.children if item.plain and item.name != "resolution"}
    values = {name: floats(item, item.plain, 1)[0] for name, item in given.items()}
    known = OLD if "fx" in values else KNOWN
    for name, value in values.items():
        if name not in known and value != 0.0:
            raise given[name].problem(f"the parameter {name} has no place in our cameras")
    if "f" not in values and not {"fx", "fy", "cx", "cy"} <= values.keys():
        raise calibration.problem("it has no focal length (f)")
    return values


def _of_photoscan(calibration: Element, name: str, size: tuple[int, int], values: dict[str, float]) -> Camera:
    """A camera of PhotoScan before 1.3: two focal lengths, the principal point from the corner of the image.

    What p1 and p2 stood for then differs between its versions, so that only cameras without them are read.
    """
    if values.get("p1", 0.0) or values.get("p2", 0.0):
        raise calibration.problem("p1 and p2 beside fx and fy are ambiguous; export it anew")
    shift = np.array([values["cx"], values["cy"]]) - np.array(size) / 2.0
    same = {"f": values["fy"], "cx": shift[0], "cy": shift[1]}
    affine = {"b1": values["fx"] - values["fy"], "b2": values.get("skew", 0.0)}
    return _brown(name, size, {**values, **same, **affine})


def _brown(name: str, size: tuple[int, int], values: dict[str, float]) -> Camera:
    """Metashape's camera: exactly ours without b1 and b2, which act there on what is distorted already."""
    f, cx, cy, k1, k2, k3, k4, p1, p2, b1, b2 = (values.get(tag, 0.0) for tag in KNOWN)
    middle = np.array(size) / 2.0 + [cx, cy]
    radial = {"K1": k1, "K2": k2, "K3": k3} | ({"K4": k4} if k4 else {})
    degree = (len(radial), *DEGREE[1:])
    camera = Camera(name, *size, f, middle, degree, {**radial, "p1": p1, "p2": p2})
    if b1 == b2 == 0.0:
        return camera

    def project(plane: FloatArray) -> FloatArray:
        distorted = camera.distorted(plane)
        shift = np.column_stack([distorted @ [b1, b2], np.zeros(len(plane))])
        return np.asarray(middle + f * distorted + shift)

    return fitted_camera(name, size, f, project, [degree, (len(radial), 1, 5)])


def _nominal(sensor: Element, name: str, size: tuple[int, int]) -> Camera:
    """A camera that was never calibrated: its focal length and its pixels in millimetres."""
    properties = {item.attributes.get("name"): item for item in sensor.children if item.name == "property"}
    if not {"focal_length", "pixel_width"} <= properties.keys():
        raise sensor.problem("it has neither a calibration, nor focal_length and pixel_width")
    focal, pixel = (number_of(properties[key], "value") for key in ("focal_length", "pixel_width"))
    return Camera(name, *size, focal / pixel, degree=DEGREE)
