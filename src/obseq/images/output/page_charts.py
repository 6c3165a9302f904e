"""What the page of a block draws: residuals on frames of cameras and images, correlations, distortions."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from obseq.arrays import BoolArray, IntArray
from obseq.images.output.arrays import BlockArrays, frame_of, grid_of, interior
from obseq.images.output.block_record import BundleRecord, CameraRecord
from obseq.report.tables.units import Plain

MOST_ARROWS = 400
"""Arrows of a frame that can be told apart; of more, the suspected and evenly spread ones."""
MOST_IMAGES = 12
BINS = 16
PARTS = (6, 8)
"""Rows and columns of the parts of a frame."""
HALF = 0.5
"""Weight below which a measure says nothing of the camera."""


def frames(record: BundleRecord, block: BlockArrays, marked: BoolArray) -> Iterator[Plain]:
    """The frames of the images with the largest residuals."""
    order = sorted(range(len(record.images)), key=lambda k: -record.images[k].rms)
    for k in order[:MOST_IMAGES]:
        image = record.images[k]
        rms = f"rms {image.rms:.3g} px per coordinate, largest {image.largest:.3g} px"
        note = f"{image.n_measures} image points, {rms}"
        yield _frame(
            record.cameras[block.camera[k]], block, np.flatnonzero(block.image == k), marked, image.name, note
        )


def cameras(record: BundleRecord, block: BlockArrays, marked: BoolArray) -> Iterator[Plain]:
    """Of each camera: all residuals on one frame, its correlations, the image without distortion."""
    for k, camera in enumerate(record.cameras):
        rows = np.flatnonzero(block.camera[block.image] == k)
        note = f"all images: {camera.n_measures} image points, rms {camera.rms:.3g} px per coordinate"
        yield _frame(camera, block, rows, marked, camera.name, note)
        yield _profile(camera, block, rows[block.weights[rows] >= HALF])
        yield _coverage(camera, block, rows)
        free = [j for j, parameter in enumerate(camera.parameters) if parameter.sigma]
        if camera.correlations and len(free) > 1:
            names = [camera.parameters[j].name for j in free]
            values = [[round(camera.correlations[i][j], 3) for j in free] for i in free]
            yield {
                "kind": "matrix",
                "title": f"Correlations of {camera.name}",
                "note": "per cent; blue positive, orange negative",
                "names": names,
                "values": values,
            }
        if camera.width and any(value is not None for value in camera.undistorted_x):
            yield {
                "kind": "grid", "title": f"{camera.name} without distortion",
                "width": camera.width, "height": camera.height,
                "x": _short(camera.undistorted_x), "y": _short(camera.undistorted_y),
                "note": f"the image (grey) and where its points would be, up to {_shift(camera):.3g} px away",
            }  # fmt: skip


def _frame(
    camera: CameraRecord, block: BlockArrays, rows: IntArray, marked: BoolArray, title: str, note: str
) -> Plain:
    if len(rows) > MOST_ARROWS:
        note += f"; {MOST_ARROWS} of them drawn"
        rows = np.union1d(
            rows[marked[rows]], rows[np.linspace(0, len(rows) - 1, MOST_ARROWS).astype(np.intp)]
        )
    xy, residuals = block.xy[rows], block.residuals[rows]
    corner, size = frame_of((camera.width, camera.height), xy)
    places = np.round(xy - corner, 1)
    return {
        "kind": "frame", "title": title, "note": note, "width": float(size[0]), "height": float(size[1]),
        "x": places[:, 0].tolist(), "y": places[:, 1].tolist(),
        "dx": np.round(residuals[:, 0], 4).tolist(), "dy": np.round(residuals[:, 1], 4).tolist(),
        "suspected": np.flatnonzero(marked[rows]).tolist(),
    }  # fmt: skip


def _coverage(camera: CameraRecord, block: BlockArrays, rows: IntArray) -> Plain:
    """How many image points each part of the frame of a camera has."""
    corner, size = frame_of((camera.width, camera.height), block.xy[rows])
    shares = (block.xy[rows] - corner) / size
    parts = np.histogram2d(shares[:, 1], shares[:, 0], PARTS, ((0.0, 1.0), (0.0, 1.0)))[0].astype(int)
    empty, whole = int(np.count_nonzero(parts == 0)), parts.size
    return {
        "kind": "coverage",
        "title": f"Coverage of {camera.name}",
        "note": f"{whole - empty} of {whole} parts of the frame have image points, at most {parts.max()}",
        "width": float(size[0]), "height": float(size[1]), "counts": parts.tolist(),
    }  # fmt: skip


def _shift(camera: CameraRecord) -> float:
    """How far the distortion moves a point of the grid, pixels."""
    places = np.array([camera.undistorted_x, camera.undistorted_y], np.float64).T  # None is NaN
    given = grid_of((camera.width, camera.height), interior(camera)[0])
    return float(np.nanmax(np.linalg.norm(places - given, axis=1)))


def _short(values: tuple[float | None, ...]) -> list[float | None]:
    return [None if value is None else round(value, 1) for value in values]


def _profile(camera: CameraRecord, block: BlockArrays, rows: IntArray) -> Plain:
    """Residuals by their distance from the principal point: their radial part, and how large they are."""
    arms, residuals = block.xy[rows] - interior(camera)[1], block.residuals[rows]
    radius = np.linalg.norm(arms, axis=1)
    outward = np.sum(arms * residuals, axis=1) / np.maximum(radius, 1e-12)
    edges = np.linspace(0.0, radius.max(initial=1.0) * (1.0 + 1e-9), BINS + 1)
    owner = np.clip(np.digitize(radius, edges) - 1, 0, BINS - 1)
    counts = np.bincount(owner, minlength=BINS)
    used, number = counts > 0, np.maximum(counts, 1)
    mean = np.bincount(owner, outward, BINS) / number
    rms = np.sqrt(np.bincount(owner, np.sum(residuals**2, axis=1), BINS) / (2.0 * number))
    columns = {"radius": (edges[1:] + edges[:-1]) / 2.0, "mean": mean, "rms": rms}
    rounded = {name: np.round(values[used], 5).tolist() for name, values in columns.items()}
    title = f"{camera.name} by distance from the principal point"
    return {
        "kind": "profile",
        "title": title,
        "note": "px: rms per coordinate (full), mean radial part (dashed)",
        **rounded,
    }
