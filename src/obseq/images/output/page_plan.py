"""The plan of a block, and its view from the side: cameras, rays, points with their ellipses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from obseq.arrays import BoolArray, FloatArray
    from obseq.images.output.arrays import BlockArrays
    from obseq.images.output.block_record import BundleRecord
    from obseq.report.tables.units import Plain

CONTROL, CAMERA = 1, 8
"""Marks of points; the script of the page has the same."""
DIGITS = 6


def plan(record: BundleRecord, block: BlockArrays) -> Plain:
    """The views, the one from above first."""
    views = _views(record, block)
    return {
        **views[0],
        "views": views,
        "marks": [*(CONTROL * block.is_control).tolist(), *[CAMERA] * len(record.images)],
        "scheme": False,
        "unplaced": [],
        "rays": [],
        "loose": [],
        "known": "control point",
        "other": "tie point",
        "sights": "rays",
        "ellipses": f"standard ellipse, {record.precision}",
        "displaced": "control residuals",
        "displacements": "control point, adjusted minus given",
    }


def _views(record: BundleRecord, block: BlockArrays) -> list[Plain]:
    everything = np.concatenate([block.coordinates, block.centres])
    flat = everything[:, :2] - everything[:, :2].mean(axis=0)
    along = np.linalg.svd(flat, full_matrices=False)[2][0] if len(flat) > 1 else np.array([1.0, 0.0])
    along = along if along[np.argmax(np.abs(along))] > 0.0 else -along
    plan_axes = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    side_axes = np.array([[along[0], along[1], 0.0], [0.0, 0.0, 1.0]])
    front = {"name": "side", "axes": ["along", "z"]}
    return [
        {"name": "plan", "axes": ["x", "y"], **_projected(record, block, plan_axes, everything)},
        {**front, **_projected(record, block, side_axes, everything)},
    ]


def _projected(record: BundleRecord, block: BlockArrays, axes: FloatArray, everything: FloatArray) -> Plain:
    places = np.round(everything @ axes.T, DIGITS)
    padding = [None] * len(record.images)
    shifts = [
        None if point.residual is None else (axes @ np.array(point.residual)).tolist()
        for point in record.points
    ]
    ellipses: list[list[float | None]] = [[None] * len(record.points)] * 3
    if block.covariances is not None:
        ellipses = _ellipses(axes @ block.covariances @ axes.T)
    return {
        "x": places[:, 0].tolist(),
        "y": places[:, 1].tolist(),
        **{
            key: [*values, *padding]
            for key, values in zip(("major", "minor", "bearing"), ellipses, strict=True)
        },
        "moved": [*shifts, *padding] if any(shifts) else None,
    }


def _ellipses(covariances: FloatArray) -> list[list[float | None]]:
    """Semi-axes and bearings of the major ones of (n, 2, 2) covariances."""
    known: BoolArray = np.asarray(np.isfinite(covariances).all(axis=(1, 2)))
    values, vectors = np.linalg.eigh(np.where(known[:, None, None], covariances, np.eye(2)))
    axes = np.sqrt(np.clip(values, 0.0, None))
    bearing = np.arctan2(vectors[:, 0, 1], vectors[:, 1, 1]) % np.pi
    columns = (axes[:, 1], axes[:, 0], bearing)
    return [
        [float(f"{value:.5g}") if is_known else None for value, is_known in zip(column, known, strict=True)]
        for column in columns
    ]
