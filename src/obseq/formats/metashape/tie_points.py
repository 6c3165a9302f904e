"""Tie points of projects of Metashape and PhotoScan: points, tracks and projections as PLY in an archive.

A projection belongs to a track, a point to the track of its number. The accuracy of the project is that of
projections found at the full scale of an image; others are as much larger as their scale (`size`) is.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from obseq.arrays import FloatArray
from obseq.errors import InputError
from obseq.formats.blocks.reading import note_count
from obseq.formats.metashape.document import items, member
from obseq.images.bundle import BundleAdjustment
from obseq.images.measures import ImagePoints
from obseq.reading.xml import Element

TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "<i2"),
    **dict.fromkeys(("ushort", "uint16"), "<u2"),
    **dict.fromkeys(("int", "int32"), "<i4"),
    **dict.fromkeys(("uint", "uint32"), "<u4"),
    **dict.fromkeys(("float", "float32"), "<f4"),
    **dict.fromkeys(("double", "float64"), "<f8"),
}
"""Types of NumPy, by those of PLY."""
HEADER = (b"ply", b"format binary_little_endian 1.0")
LEAST = 2
"""Images in which a tie point is seen at least: others add nothing."""


def add_tie_points(
    block: BundleAdjustment,
    root: Element,
    images: Mapping[str, str],
    placed: tuple[float, FloatArray, FloatArray],
    accuracy: float | None,
) -> None:
    """Adds the tie points of a chunk to its block, where its archive has some.

    Args:
        block: With its images.
        root: The chunk.
        images: Their names by number.
        placed: Scale, rotation and shift from the chunk to the frame.
        accuracy: Of a projection at full scale, pixels; a pixel where the project says none.

    Raises:
        InputError: A file in the archive is no PLY of this form.
    """
    clouds = [cloud for frame in items(root, "frames", "frame") for cloud in frame.named("point_cloud")]
    for cloud in clouds[:1]:  # other frames are other moments
        archive = cloud.attributes.get("archive", "")
        points = cloud.first("points")
        if not archive or points is None:
            continue
        found = _ply(Path(archive), points, "x", "y", "z", "id")
        tracks = np.asarray(found["id"], np.int64)
        scale, rotation, shift = placed
        places = np.column_stack([found[axis] for axis in "xyz"]).astype(np.float64)
        _add(block, cloud, images, tracks, scale * places @ rotation.T + shift, accuracy or 1.0)


def _add(
    block: BundleAdjustment,
    cloud: Element,
    images: Mapping[str, str],
    tracks: npt.NDArray[np.int64],
    places: FloatArray,
    accuracy: float,
) -> None:
    order = np.argsort(tracks)
    names: list[str] = []
    image, rows, xy, sigmas = [], [], [], []
    for projections in cloud.named("projections"):
        key = projections.attributes.get("camera_id", "")
        if key not in images:
            continue
        found = _ply(Path(cloud.attributes["archive"]), projections, "x", "y", "id")
        at = np.searchsorted(tracks[order], found["id"])
        point = order[np.minimum(at, len(order) - 1)]
        has = tracks[point] == found["id"]
        point, first = np.unique(point[has], return_index=True)  # one projection of a track in an image
        chosen = found[has][first]
        image.append(np.full(len(point), len(names)))
        names.append(images[key])
        rows.append(point)
        xy.append(np.column_stack([chosen["x"], chosen["y"]]).astype(np.float64))
        size = chosen["size"] if "size" in (found.dtype.names or ()) else np.ones(len(chosen))
        sigmas.append(accuracy * np.maximum(size.astype(np.float64), 1e-3))
    if not rows:
        return
    point, of_image = np.concatenate(rows), np.concatenate(image)
    seen = np.bincount(point, minlength=len(tracks)) >= LEAST
    kept = seen[point]
    used = np.flatnonzero(seen)
    number = np.cumsum(seen) - 1
    labels = [f"tie {track}" for track in tracks[used].tolist()]
    block.add_approximations(labels, places[used])
    block.add_measures(
        ImagePoints.packed(
            names,
            labels,
            of_image[kept],
            number[point[kept]],
            np.concatenate(xy)[kept],
            np.concatenate(sigmas)[kept],
        ),
        name="tie points",
    )
    alone = [f"tie {track}" for track in tracks[~seen].tolist()]
    note_count(block, alone, "tie points are seen in one image, or in none, and are left out")


def _ply(archive: Path, element: Element, *needed: str) -> npt.NDArray[np.void]:
    """The vertices of a PLY in an archive, with their columns by name."""
    name = element.attributes.get("path", "")
    data = member(archive, name)
    head, end, body = data.partition(b"end_header\n")
    lines = head.splitlines()
    if not end or tuple(lines[:2]) != HEADER:
        raise InputError(f"{archive}: {name} is no binary PLY, little endian")
    words = [line.decode("ascii", "replace").split() for line in lines[2:]]
    words = [word for word in words if word and word[0] not in ("comment", "obj_info")]
    counts = [word[2] for word in words[:1] if len(word) == 3 and word[:2] == ["element", "vertex"]]
    fields = [(word[2], TYPES[word[1]]) for word in words[1:] if len(word) == 3 and word[1] in TYPES]
    named = {column for column, _ in fields}
    whole = len(fields) == len(named) == len(words) - 1 and {*needed} <= named
    if not counts or not counts[0].isdecimal() or not whole:
        raise InputError(f"{archive}: {name} has not the columns {', '.join(needed)} of vertices alone")
    kind = np.dtype(fields)
    if len(body) != int(counts[0]) * kind.itemsize:
        raise InputError(f"{archive}: {name} is cut short, or longer than its {counts[0]} vertices")
    return np.frombuffer(body, kind)
