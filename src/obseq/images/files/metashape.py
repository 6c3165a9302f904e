"""Blocks of Agisoft Metashape: the XML of cameras and markers, or a project (`.psx`) that holds the same.

Cameras look along z, x right, y down; poses go from the camera to the chunk, whose transform goes to the
world. The world is geocentric where the chunk has a geographic or projected system; it becomes a local frame
(RTL) at the mean of the markers here. Only pinned projections were measured; the others are predictions.
"""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from obseq import crs
from obseq.errors import InputError
from obseq.geometry import closest_rotation
from obseq.images.bundle import BundleAdjustment
from obseq.images.camera import Camera
from obseq.images.control import ControlPoints
from obseq.images.files.fitted import fitted_camera
from obseq.images.files.xml import Element, child, content, problem, read_xml, text, xml_of
from obseq.images.measures import ImagePoints
from obseq.images.poses import Poses

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.arrays import FloatArray

LARGEST = 1 << 30
"""Bytes of the largest document that is taken out of a project."""
DEGREE = (3, 1, 1)
KNOWN = ("f", "cx", "cy", "k1", "k2", "k3", "p1", "p2", "b1", "b2", "resolution")
LOCAL = "LOCAL_CS"


@dataclass(frozen=True)
class _World:
    """From the chunk to the frame of the block: scale, rotation, shift; and from references to the frame.

    Attributes:
        definition: of the frame.
        reference: the system of reference coordinates; None for the frame itself.
    """

    scale: float
    rotation: FloatArray
    shift: FloatArray
    definition: str
    reference: crs.CoordinateSystem | None

    def placed(self, points: FloatArray) -> FloatArray:
        return np.asarray(self.scale * points @ self.rotation.T + self.shift)


def read_metashape(
    path: str | Path,
    chunk: str | None = None,
    image_sigma: float | None = None,
    control_sigma: float | None = None,
) -> tuple[BundleAdjustment, str]:
    """The block of a chunk, and the definition of the frame that it is in.

    Images, calibrations, markers that were measured, their reference coordinates (those that are not enabled
    are left as free points), and scale bars. Tie points are not in such files.

    Args:
        path: an XML of cameras and markers, or a project.
        chunk: label of the chunk; needed when there are several.
        image_sigma: of pinned projections, pixels; the chunk's own accuracy when None.
        control_sigma: of markers whose reference says none; the chunk's own accuracy when None.

    Raises:
        InputError: what is not read, with file and line: other camera types, models that ours does not reach,
            several chunks without choice.
    """
    root = _chunk(_document(Path(path)), chunk)
    markers = {item.attributes.get("id", ""): item for item in _items(root, "markers", "marker")}
    world = _world(root, list(markers.values()))
    block = BundleAdjustment()
    sensors = {
        sensor.attributes.get("id", ""): _camera(sensor) for sensor in _items(root, "sensors", "sensor")
    }
    block.add_cameras(*sensors.values())
    images = _add_images(block, root, sensors, world)
    names = {key: _label(marker) for key, marker in markers.items()}
    _add_control(block, root, list(markers.values()), world, control_sigma)
    _add_measures(block, root, images, names, image_sigma)
    _add_scale_bars(block, root, names)
    return block, world.definition


def _document(path: Path) -> Element:
    return _archived(path) if path.suffix.lower() == ".psx" else read_xml(path)


def _archived(path: Path) -> Element:
    """The document of a project whose chunks are in files beside it."""
    root = read_xml(path)
    inside = root.attributes.get("path", "").replace("{projectname}", path.stem)
    archive = path.parent / inside
    if not inside or not archive.is_file():
        raise problem(root, f"the files of the project ({inside or 'no path'}) are not beside it")
    document = xml_of(_member(archive), f"{archive}:doc.xml")
    places = [item.attributes.get("path", "") for item in _items(document, "chunks", "chunk")]
    chunks = [xml_of(_member(archive.parent / place), str(archive.parent / place)) for place in places]
    return Element(root.file, "document", {}, root.line, chunks)


def _member(archive: Path) -> bytes:
    try:
        with zipfile.ZipFile(archive) as opened:
            if opened.getinfo("doc.xml").file_size > LARGEST:
                raise InputError(f"{archive}: doc.xml is larger than {LARGEST >> 20} MiB")
            return opened.read("doc.xml")
    except (OSError, KeyError, zipfile.BadZipFile, NotImplementedError, RuntimeError) as error:
        raise InputError(f"{archive}: doc.xml cannot be taken out ({error})") from None


def _chunk(root: Element, wanted: str | None) -> Element:
    found = [root] if root.name == "chunk" else [item for item in root.children if item.name == "chunk"]
    labels = [item.attributes.get("label", "") for item in found]
    if not found:
        raise problem(root, "there is no chunk: export cameras (XML) or markers from Metashape")
    if wanted is None and len(found) > 1:
        raise problem(root, f"there are {len(found)} chunks: choose one of {', '.join(labels)}")
    if wanted is not None and wanted not in labels:
        raise problem(root, f"there is no chunk {wanted!r}, but {', '.join(labels)}")
    return found[labels.index(wanted)] if wanted is not None else found[0]


def _items(root: Element, folder: str, tag: str) -> Iterator[Element]:
    """The elements of a list, groups of it included."""
    for holder in (item for item in root.children if item.name == folder):
        for item in holder.children:
            if item.name == tag:
                yield item
            elif item.name == "group":
                yield from item.named(tag)


def _label(element: Element) -> str:
    label = element.attributes.get("label", "")
    if not label:
        raise problem(element, "it has no label")
    return label


def _floats(element: Element, text: str, count: int) -> list[float]:
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != count or not np.isfinite(values).all():
        raise problem(element, f"{count} finite numbers are expected, not {text[:60]!r}")
    return values


def _attribute(element: Element, name: str, default: float | None = None) -> float:
    if default is not None and name not in element.attributes:
        return default
    return _floats(element, element.attributes.get(name, ""), 1)[0]


def _camera(sensor: Element) -> Camera:
    name = f"{_label(sensor)} {sensor.attributes.get('id', '')}".strip()
    kind = sensor.attributes.get("type", "frame")
    if kind != "frame":
        raise problem(sensor, f"a camera of type {kind} is not read; only frame is")
    if any("rolling_shutter" in item.name for item in sensor.children):
        raise problem(sensor, "a camera with rolling shutter is not read")
    calibrations = [item for item in sensor.children if item.name == "calibration"]
    chosen = {item.attributes.get("class", "initial"): item for item in calibrations}
    calibration = chosen.get("adjusted", chosen.get("initial"))
    frame = child(sensor, "resolution")
    if frame is None:
        raise problem(sensor, "it has no resolution")
    size = (int(_attribute(frame, "width")), int(_attribute(frame, "height")))
    if calibration is None:
        return _nominal(sensor, name, size)
    given = {item.name: item for item in calibration.children if text(item)}
    other = [
        tag for tag, item in given.items() if tag not in KNOWN and _floats(item, text(item), 1)[0] != 0.0
    ]
    if other:
        raise problem(given[other[0]], f"the parameter {other[0]} has no place in our cameras")
    values = {tag: _floats(item, text(item), 1)[0] for tag, item in given.items() if tag in KNOWN}
    if "f" not in values:
        raise problem(calibration, "it has no focal length (f)")
    return _brown(name, size, values)


def _brown(name: str, size: tuple[int, int], values: dict[str, float]) -> Camera:
    """Metashape's camera: exactly ours without b1 and b2, which act there on what is distorted already."""
    f, cx, cy, k1, k2, k3, p1, p2, b1, b2 = (values.get(tag, 0.0) for tag in KNOWN[:-1])
    middle = np.array(size) / 2.0 + [cx, cy]
    exact = {"K1": k1, "K2": k2, "K3": k3, "p1": p1, "p2": p2}
    camera = Camera(name, *size, f, middle, DEGREE, exact)
    if b1 == b2 == 0.0:
        return camera

    def project(plane: FloatArray) -> FloatArray:
        distorted = camera.distorted(plane)
        shift = np.column_stack([distorted @ [b1, b2], np.zeros(len(plane))])
        return np.asarray(middle + f * distorted + shift)

    return fitted_camera(name, size, f, project)


def _nominal(sensor: Element, name: str, size: tuple[int, int]) -> Camera:
    """A camera that was never calibrated: its focal length and its pixels in millimetres."""
    properties = {item.attributes.get("name"): item for item in sensor.children if item.name == "property"}
    if not {"focal_length", "pixel_width"} <= properties.keys():
        raise problem(sensor, "it has neither a calibration, nor focal_length and pixel_width")
    focal, pixel = (_attribute(properties[key], "value") for key in ("focal_length", "pixel_width"))
    return Camera(name, *size, focal / pixel, degree=DEGREE)


def _world(root: Element, markers: list[Element]) -> _World:
    """The frame of the block: local where the chunk is, a tangent frame where its system is on the Earth."""
    transform = next((item for item in root.children if item.name == "transform"), None)
    scale, rotation, shift = _similarity(transform)
    definition = next((text(item) for item in root.children if item.name == "reference"), "")
    if not definition or definition.startswith(LOCAL):
        return _World(scale, rotation, shift, "LocalNONE", None)
    reference = crs.parse(definition)
    geocentric = crs.parse("GeoC")
    known = [_reference(marker) for marker in markers]
    middles = [place for place in known if place is not None]
    if middles:
        frame = crs.complete_rtl(np.array(middles), reference)
    else:
        frame = crs.complete_rtl(shift[None], geocentric)
    turn, origin = frame.geocentric_pose()
    return _World(scale, turn.T @ rotation, turn.T @ (shift - origin), frame.definition, reference)


def _similarity(transform: Element | None) -> tuple[float, FloatArray, FloatArray]:
    if transform is None:
        return 1.0, np.eye(3), np.zeros(3)
    scale = _floats(transform, content(transform, "scale", "1"), 1)[0]
    rotation = np.array(_floats(transform, content(transform, "rotation", "1 0 0 0 1 0 0 0 1"), 9)).reshape(
        3, 3
    )
    shift = np.array(_floats(transform, content(transform, "translation", "0 0 0"), 3))
    if not scale > 0.0 or np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-6:
        raise problem(transform, "the transform of the chunk is no similarity")
    return scale, rotation, shift


def _reference(element: Element) -> list[float] | None:
    """Enabled reference coordinates of a marker."""
    reference = child(element, "reference")
    if reference is None or not {"x", "y", "z"} <= reference.attributes.keys():
        return None
    if reference.attributes.get("enabled", "true").lower() not in ("true", "1"):
        return None
    return [_attribute(reference, axis) for axis in "xyz"]


def _add_images(
    block: BundleAdjustment, root: Element, sensors: dict[str, Camera], world: _World
) -> dict[str, str]:
    """Names of the images by their numbers; those that are not aligned have no pose."""
    images: dict[str, str] = {}
    names: list[str] = []
    centres, rotations, owners = [], [], []
    for camera in _items(root, "cameras", "camera"):
        name, sensor = _label(camera), camera.attributes.get("sensor_id", "")
        if sensor not in sensors:
            raise problem(camera, f"its sensor {sensor!r} is not there")
        images[camera.attributes.get("id", "")] = name
        transform = child(camera, "transform")
        if transform is None:
            block.add_images([name], sensors[sensor].name)
            continue
        matrix = np.array(_floats(transform, text(transform), 16)).reshape(4, 4)
        names.append(name)
        owners.append(sensors[sensor].name)
        centres.append(world.placed(matrix[:3, 3]))
        rotations.append(closest_rotation(world.rotation @ matrix[:3, :3]))
    block.add_poses(Poses.of(names, np.array(centres).reshape(-1, 3), rotations, cameras=owners))
    return images


def _setting(root: Element, name: str) -> float | None:
    settings = child(root, "settings")
    for item in settings.children if settings is not None else ():
        if item.attributes.get("name") == name:
            return _attribute(item, "value")
    return None


def _add_control(
    block: BundleAdjustment, root: Element, markers: list[Element], world: _World, sigma: float | None
) -> None:
    names, places, sigmas = [], [], []
    default = sigma if sigma is not None else _setting(root, "accuracy_markers")
    for marker in markers:
        place = _reference(marker)
        if place is None:
            continue
        reference = child(marker, "reference")
        assert reference is not None
        if default is None and "sx" not in reference.attributes:
            raise problem(reference, "the accuracy of the marker is not said; give a sigma of control points")
        names.append(_label(marker))
        places.append(place)
        sigmas.append([_attribute(reference, f"s{axis}", default) for axis in "xyz"])
    if names:
        block.add_control_points(_in_frame(names, np.array(places), np.array(sigmas), world))


def _in_frame(names: list[str], places: FloatArray, sigmas: FloatArray, world: _World) -> ControlPoints:
    """Markers in the frame of the block; their sigmas are along east, north and up where they are."""
    if world.reference is None:
        return ControlPoints.of(names, places, sigmas)
    frame = crs.parse(world.definition)
    moved = np.asarray(crs.Transformer(world.reference, frame).forward(places, names))
    axes = frame.vertical_rotation(moved)
    covariances = np.swapaxes(axes, 1, 2) @ (sigmas[:, :, None] ** 2 * axes)
    if (sigmas > 0.0).all():
        return ControlPoints.correlated(names, moved, (covariances + np.swapaxes(covariances, 1, 2)) / 2.0)
    return ControlPoints.of(names, moved, sigmas)


def _add_measures(
    block: BundleAdjustment, root: Element, images: dict[str, str], names: dict[str, str], sigma: float | None
) -> None:
    rows: list[tuple[str, str, float, float]] = []
    for frame in _items(root, "frames", "frame"):
        for marker in _items(frame, "markers", "marker"):
            key = marker.attributes.get("marker_id", "")
            if key not in names:
                raise problem(marker, f"the marker {key!r} is not in the list of markers")
            rows += [
                (images[_owner(place, images)], names[key], _attribute(place, "x"), _attribute(place, "y"))
                for place in marker.children
                if place.name == "location" and _is_measured(place)
            ]
    spread = sigma if sigma is not None else _setting(root, "accuracy_projections")
    if spread is None:
        raise problem(root, "the accuracy of image measures is not said; give an image sigma")
    if rows:
        xy = np.array([row[2:] for row in rows], dtype=np.float64)
        points = ImagePoints.of([row[0] for row in rows], [row[1] for row in rows], xy, spread)
        block.add_measures(points, name="markers")


def _owner(place: Element, images: dict[str, str]) -> str:
    key = place.attributes.get("camera_id", "")
    if key not in images:
        raise problem(place, f"the camera {key!r} is not in the list of cameras")
    return key


def _is_measured(place: Element) -> bool:
    """Pinned by a person or a detector, and not declared blunder; others are predictions."""
    pinned = place.attributes.get("pinned", "false").lower() in ("true", "1")
    return pinned and place.attributes.get("valid", "true").lower() in ("true", "1")


def _add_scale_bars(block: BundleAdjustment, root: Element, names: dict[str, str]) -> None:
    for bar in _items(root, "scalebars", "scalebar"):
        reference = child(bar, "reference")
        if reference is None or "distance" not in reference.attributes:
            continue
        if reference.attributes.get("enabled", "true").lower() not in ("true", "1"):
            continue
        ends = [bar.attributes.get(key, "") for key in ("marker_1_id", "marker_2_id")]
        ends = ends if all(ends) else [bar.attributes.get(f"{key}_id", "") for key in ("start", "end")]
        if not set(ends) <= names.keys():
            raise problem(bar, "its ends are not markers")
        accuracy = _attribute(reference, "accuracy", _setting(root, "accuracy_scalebars"))
        block.add_length(names[ends[0]], names[ends[1]], _attribute(reference, "distance"), accuracy)
