"""Blocks of Agisoft Metashape and PhotoScan: the XML of cameras and markers, or a project that holds it.

Cameras look along z, x right, y down; poses go from the camera to the chunk, or to their component of it,
whose transform goes to the world. The world is geocentric where the chunk has a geographic or projected
system; it becomes a local frame (RTL) at the mean of the markers here. Only pinned projections were measured;
the others are predictions.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np

from obseq import crs
from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.formats.blocks.reading import hold_all_but, new_block, note_count
from obseq.formats.metashape.cameras import Sensor, read_sensor
from obseq.formats.metashape.document import (
    chunk_of,
    floats,
    is_enabled,
    items,
    label_of,
    number_of,
    read_document,
)
from obseq.formats.metashape.tie_points import add_tie_points
from obseq.geometry import closest_rotation
from obseq.images.bundle import BundleAdjustment
from obseq.images.camera import Camera
from obseq.images.control import ControlPoints
from obseq.images.measures import ImagePoints
from obseq.images.poses import Poses
from obseq.reading.origin import Origin
from obseq.reading.xml import Element

LOCAL = "LOCAL_CS"
ACCURACY = 10.0
"""Metres: the accuracy of reference positions where nobody has said one (Metashape's)."""


Similarity = tuple[float, "FloatArray", "FloatArray"]
"""Scale, rotation (3, 3) and shift (3,)."""


@dataclass(frozen=True)
class _World:
    """From the chunk to the frame of the block, and from references to the frame.

    Attributes:
        places: of the components of the chunk, by number; that without number is of the chunk.
        definition: of the frame.
        reference: the system of reference coordinates; None for the frame itself.
    """

    places: dict[str, Similarity]
    definition: str
    reference: crs.CoordinateSystem | None

    def placed(self, camera: Element, matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Centre and rotation in the frame of a camera, whose pose (4, 4) is in its component."""
        component = camera.attributes.get("component_id", "")
        scale, rotation, shift = self.places.get(component, self.places[""])
        return scale * rotation @ matrix[:3, 3] + shift, closest_rotation(rotation @ matrix[:3, :3])


def read_metashape(
    path: str | Path,
    chunk: str | None = None,
    image_sigma: float | None = None,
    control_sigma: float | None = None,
) -> tuple[BundleAdjustment, str]:
    """The block of a chunk, and the definition of the frame that it is in.

    Images, calibrations, markers that were measured, their reference coordinates (those that are not enabled
    are left as free points), reference positions of cameras, scale bars, and tie points of a project.

    Args:
        path: an XML of cameras and markers, or a project.
        chunk: label of the chunk; needed when there are several.
        image_sigma: of pinned projections, pixels; the chunk's own accuracy when None.
        control_sigma: of markers whose reference says none; the chunk's own accuracy when None.

    Raises:
        InputError: what is not read, with file and line: other camera types, models that ours does not reach,
            several chunks without choice.
    """
    root = chunk_of(read_document(Path(path)), chunk)
    markers = {item.attributes.get("id", ""): item for item in items(root, "markers", "marker")}
    world = _world(root, list(markers.values()))
    with new_block(path) as block:
        sensors = [read_sensor(sensor) for sensor in items(root, "sensors", "sensor")]
        block.add_cameras(*(sensor.camera for sensor in sensors))
        hold_all_but(block, {sensor.camera.name: sensor.unknowns for sensor in sensors})
        images = _add_images(block, root, {sensor.number: sensor.camera for sensor in sensors}, world)
        names = {key: label_of(marker) for key, marker in markers.items()}
        _add_control(block, root, list(markers.values()), world, control_sigma)
        _add_positions(block, root, images, world)
        _add_measures(block, root, images, names, image_sigma)
        _add_scale_bars(block, root, names)
        add_tie_points(block, root, images, world.places[""], _setting(root, "accuracy_tiepoints"))
        _note_unknowns(block, sensors)
    return block, world.definition


def _note_unknowns(block: BundleAdjustment, sensors: list[Sensor]) -> None:
    """Says which cameras are fixed, and what is unknown of those of which the file does not say it."""
    fixed = [sensor.camera.name for sensor in sensors if not sensor.unknowns]
    note_count(block, fixed, "cameras are fixed in the file")
    block.notes += [
        f"camera {sensor.camera.name}: the file does not say what was estimated of it: unknown here are "
        f"{', '.join(sensor.unknowns)}"
        for sensor in sensors
        if sensor.is_guessed
    ]


def _world(root: Element, markers: list[Element]) -> _World:
    """The frame of the block: local where the chunk is, a tangent frame where its system is on the Earth."""
    places = _places(root)
    definition = next((item.plain for item in root.children if item.name == "reference"), "")
    if not definition or definition.startswith(LOCAL):
        return _World(places, "LocalNONE", None)
    reference = crs.parse(definition)
    known = [_reference(item) for item in markers]
    if not any(known):
        known = [_reference(item) for item in items(root, "cameras", "camera")]
    middles = [place for place in known if place is not None]
    if middles:
        frame = crs.complete_rtl(np.array(middles), reference)
    else:
        frame = crs.complete_rtl(next(iter(places.values()))[2][None], crs.parse("GeoC"))
    turn, origin = frame.geocentric_pose()
    moved = {
        key: (scale, turn.T @ rotation, turn.T @ (shift - origin))
        for key, (scale, rotation, shift) in places.items()
    }
    return _World(moved, frame.definition, reference)


def _places(root: Element) -> dict[str, Similarity]:
    """Where the chunk and its components are; what has no transform is where the chunk is."""
    components = list(items(root, "components", "component"))
    own = [(item, _transform(item)) for item in components]
    lost = [item for item, transform in own if transform is None]
    whole = _transform(root)
    if len(lost) > 1 or (whole is None and lost and len(components) > 1):
        raise lost[0].problem("the chunk has components that are not placed to one another")
    found = {
        item.attributes.get("id", ""): _similarity(transform)
        for item, transform in own
        if transform is not None
    }
    return {"": _similarity(whole) if whole is not None or not found else next(iter(found.values())), **found}


def _transform(holder: Element) -> Element | None:
    return next((item for item in holder.children if item.name == "transform"), None)


def _similarity(transform: Element | None) -> tuple[float, FloatArray, FloatArray]:
    if transform is None:
        return 1.0, np.eye(3), np.zeros(3)
    scale = floats(transform, transform.content("scale", "1"), 1)[0]
    rotation = np.array(floats(transform, transform.content("rotation", "1 0 0 0 1 0 0 0 1"), 9)).reshape(
        3, 3
    )
    shift = np.array(floats(transform, transform.content("translation", "0 0 0"), 3))
    if not scale > 0.0 or np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-6:
        raise transform.problem("the transform of the chunk is no similarity")
    return scale, rotation, shift


def _reference(element: Element) -> list[float] | None:
    """Enabled reference coordinates of a marker."""
    reference = element.first("reference")
    if reference is None or not _has_reference(element) or not is_enabled(reference):
        return None
    return [number_of(reference, axis) for axis in "xyz"]


def _has_reference(element: Element) -> bool:
    """Whether a marker has reference coordinates, enabled or not."""
    reference = element.first("reference")
    return reference is not None and {"x", "y", "z"} <= reference.attributes.keys()


def _add_images(
    block: BundleAdjustment, root: Element, sensors: dict[str, Camera], world: _World
) -> dict[str, str]:
    """Names of the images by their numbers; those that are not aligned have no pose."""
    cameras = {item.attributes.get("id", ""): item for item in items(root, "cameras", "camera")}
    used = {key: camera for key, camera in cameras.items() if is_enabled(camera)}
    images = _names(block, used)
    names: list[str] = []
    centres, rotations, owners = [], [], []
    for key, camera in used.items():
        sensor = camera.attributes.get("sensor_id", "")
        if sensor not in sensors:
            raise camera.problem(f"its sensor {sensor!r} is not there")
        transform = camera.first("transform")
        if transform is None:
            block.add_images([images[key]], sensors[sensor].name)
            continue
        matrix = np.array(floats(transform, transform.plain, 16)).reshape(4, 4)
        centre, rotation = world.placed(camera, matrix)
        names.append(images[key])
        owners.append(sensors[sensor].name)
        centres.append(centre)
        rotations.append(rotation)
    block.add_poses(Poses.of(names, np.array(centres).reshape(-1, 3), rotations, cameras=owners))
    _note_others(block, cameras)
    return images


def _names(block: BundleAdjustment, cameras: dict[str, Element]) -> dict[str, str]:
    """What images are called: their labels, with their numbers where several have one."""
    labels = {key: label_of(camera) for key, camera in cameras.items()}
    counts = Counter(labels.values())
    twice = sorted(label for label, count in counts.items() if count > 1)
    note_count(block, twice, "labels are of several images, which have their numbers too")
    return {key: label if counts[label] == 1 else f"{label} [{key}]" for key, label in labels.items()}


def _note_others(block: BundleAdjustment, cameras: dict[str, Element]) -> None:
    """Says which images take no part, and which are placed by another one."""
    disabled = [label_of(camera) for camera in cameras.values() if not is_enabled(camera)]
    note_count(block, disabled, "images are not enabled")
    led = [
        label_of(camera)
        for camera in cameras.values()
        if "master_id" in camera.attributes and camera.first("transform") is None
    ]
    note_count(block, led, "images of rigid cameras are placed by their masters, which is not read")


def _setting(root: Element, name: str) -> float | None:
    settings = root.first("settings")
    for item in settings.children if settings is not None else ():
        if item.attributes.get("name") == name:
            return number_of(item, "value")
    return None


def _add_control(
    block: BundleAdjustment, root: Element, markers: list[Element], world: _World, sigma: float | None
) -> None:
    names, places, sigmas, lines = [], [], [], []
    default = sigma if sigma is not None else _setting(root, "accuracy_markers")
    off = [label_of(item) for item in markers if _has_reference(item) and _reference(item) is None]
    note_count(block, off, "markers are free points: their reference coordinates are not enabled")
    for marker in markers:
        place = _reference(marker)
        if place is None:
            continue
        reference = marker.first("reference")
        assert reference is not None
        own = _accuracy(reference, default)
        if own is None:
            raise reference.problem("the accuracy of the marker is not said; give a sigma of control points")
        names.append(label_of(marker))
        lines.append(reference.line)
        places.append(place)
        sigmas.append(own)
    if names:
        control = _in_frame(names, np.array(places), np.array(sigmas), world)
        block.add_control_points(control, Origin(str(root.file.name), lines))


def _accuracy(reference: Element, default: float | None) -> list[float] | None:
    """Sigmas of x, y and z: each its own, one of both (`sxy`), one of all (`sxyz`), or the default."""
    shared = {"x": ("sx", "sxy", "sxyz"), "y": ("sy", "sxy", "sxyz"), "z": ("sz", "sxyz")}
    found = []
    for names in shared.values():
        name = next((name for name in names if name in reference.attributes), None)
        if name is None and default is None:
            return None
        found.append(number_of(reference, name or names[0], default))
    return found


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


def _add_positions(block: BundleAdjustment, root: Element, images: dict[str, str], world: _World) -> None:
    """Reference positions of cameras, as those of a receiver; their angles are told, and not taken."""
    names, places, sigmas, turned = [], [], [], []
    default = _setting(root, "accuracy_cameras")
    for camera in items(root, "cameras", "camera"):
        place, key = _reference(camera), camera.attributes.get("id", "")
        if place is None or key not in images:
            continue
        reference = camera.first("reference")
        assert reference is not None
        own = _accuracy(reference, default if default is not None else ACCURACY)
        assert own is not None
        names.append(images[key])
        places.append(place)
        sigmas.append(own)
        if "yaw" in reference.attributes:
            turned.append(images[key])
    if names:
        control = _in_frame(names, np.array(places), np.array(sigmas), world)
        block.observe_antenna(names, control.coordinates, control.sigmas)
    note_count(block, turned, "reference angles of images are not taken, only their positions")


def _add_measures(
    block: BundleAdjustment, root: Element, images: dict[str, str], names: dict[str, str], sigma: float | None
) -> None:
    rows: list[tuple[str, str, float, float, int]] = []
    cameras = {item.attributes.get("id", ""): label_of(item) for item in items(root, "cameras", "camera")}
    predicted: list[str] = []
    for frame in items(root, "frames", "frame"):
        for marker in items(frame, "markers", "marker"):
            key = marker.attributes.get("marker_id", "")
            if key not in names:
                raise marker.problem(f"the marker {key!r} is not in the list of markers")
            for place in marker.named("location"):
                number = place.attributes.get("camera_id", "")
                if number not in cameras:
                    raise place.problem(f"the camera {number!r} is not in the list of cameras")
                if not _is_measured(place):
                    predicted.append(f"{names[key]} in {cameras[number]}")
                elif number in images:
                    xy_of = number_of(place, "x"), number_of(place, "y")
                    rows.append((images[number], names[key], *xy_of, place.line))
    note_count(block, predicted, "projections were not measured (not pinned, or not valid) and are left out")
    spread = sigma if sigma is not None else _setting(root, "accuracy_projections")
    if spread is None:
        raise root.problem("the accuracy of image measures is not said; give an image sigma")
    if rows:
        xy = np.array([row[2:4] for row in rows], dtype=np.float64)
        points = ImagePoints.of([row[0] for row in rows], [row[1] for row in rows], xy, spread)
        origin = Origin(str(root.file.name), [row[4] for row in rows])
        block.add_measures(points, name="markers", origin=origin)


def _is_measured(place: Element) -> bool:
    """Pinned by a person or a detector, and not declared blunder; others are predictions."""
    pinned = place.attributes.get("pinned", "false").lower() in ("true", "1")
    return pinned and place.attributes.get("valid", "true").lower() in ("true", "1")


def _add_scale_bars(block: BundleAdjustment, root: Element, names: dict[str, str]) -> None:
    off: list[str] = []
    for bar in items(root, "scalebars", "scalebar"):
        reference = bar.first("reference")
        if reference is None or "distance" not in reference.attributes:
            continue
        if not is_enabled(reference):
            off.append(bar.attributes.get("label", bar.attributes.get("id", "")))
            continue
        ends = [bar.attributes.get(key, "") for key in ("marker_1_id", "marker_2_id")]
        ends = ends if all(ends) else [bar.attributes.get(f"{key}_id", "") for key in ("start", "end")]
        if not set(ends) <= names.keys():
            raise bar.problem("its ends are not markers")
        accuracy = number_of(reference, "accuracy", _setting(root, "accuracy_scalebars"))
        block.add_length(names[ends[0]], names[ends[1]], number_of(reference, "distance"), accuracy)
    note_count(block, off, "scale bars are not enabled")
