"""Control points, check points and observed positions in a system on the Earth, and what replaces what.

A block is computed in a frame with straight axes: coordinates on a map, or longitudes and latitudes, become a
local tangent frame (RTL) at their mean. Sigmas stay along east, north and up.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from obseq import crs
from obseq.arrays import FloatArray
from obseq.errors import InputError
from obseq.formats.blocks.reading import note_count
from obseq.images.block import Block
from obseq.images.control import ControlPoints
from obseq.reading.origin import Origin

STEP, STEP_OF_ANGLE = 1.0, 1e-5
"""Metres, and units of angle, to the east by which a map shows where its east is."""


def covariances_in_frame(
    names: tuple[str, ...], places: FloatArray, covariances: FloatArray, system: str, frame: str
) -> tuple[FloatArray, FloatArray]:
    """Points (n, 3) and covariances (n, 3, 3) along east, north and up, of a system, in a frame.

    Raises:
        InputError: a covariance is infinite or zero in some components only, which other axes cannot keep.
    """
    source, target = crs.parse(system), crs.parse(frame)
    moved = np.asarray(crs.Transformer(source, target).forward(places, names))
    if source == target:
        return moved, covariances
    variances = np.diagonal(covariances, axis1=1, axis2=2)
    for special in (variances == 0.0, np.isinf(variances)):
        mixed = np.flatnonzero(special.any(axis=1) & ~special.all(axis=1))
        if mixed.size:
            raise InputError(
                f"point {names[mixed[0]]}: in {system} its three coordinates are all held, all free, or all "
                "have sigmas: axes of the frame are not those of the map; give a small or a large sigma"
            )
    turned = covariances.copy()
    rows = np.flatnonzero((variances > 0.0).all(axis=1) & np.isfinite(variances).all(axis=1))
    if rows.size:
        axes = target.vertical_rotation(moved[rows])
        turned[rows] = np.swapaxes(axes, 1, 2) @ covariances[rows] @ axes
        turned[rows] = (turned[rows] + np.swapaxes(turned[rows], 1, 2)) / 2.0
    return moved, turned


def control_in_frame(control: ControlPoints, system: str, frame: str) -> ControlPoints:
    """Control points of a system in a frame."""
    if not len(control):
        return control
    return ControlPoints(
        control.names,
        *covariances_in_frame(control.names, control.coordinates, control.covariances, system, frame),
    )


def frame_for(block: Block, system: str, places: FloatArray, wanted: str | None) -> str:
    """The frame in which a block is computed: its own, the one that is wanted, or one at the mean of places.

    Raises:
        InputError: the block has another one than the one that is wanted.
    """
    if wanted and block.frame and crs.parse(wanted) != crs.parse(block.frame):
        raise InputError(f"--frame {wanted}: the block is in {block.frame}, as its files say; leave it out")
    if block.frame or wanted:
        return block.frame or str(wanted)
    source = crs.parse(system)
    return source.definition if source.is_euclidean else crs.complete_rtl(places, source).definition


def heights_said(system: str) -> str:
    """What heights of a system are above, in words."""
    words = f"{system}: heights as this system says (above the geoid, where it has a vertical part)"
    if "+" not in system and not system.startswith(("RTL", "LEuc", "GeoC", "Local")):
        words = (
            f"{system}: heights are taken above the ellipsoid of the system; for those above the geoid name "
            "both parts (EPSG:2154+5720), which takes their grid"
        )
    return words


def put_control(block: Block, control: ControlPoints, origin: Origin, replaced: Collection[str]) -> None:
    """Adds control points; those among `replaced` of the same names give way, with a note."""
    twice = [name for name in control.names if name in replaced and name in block.control.names]
    note_count(block, twice, "control points of the block are replaced by those of the table")
    block.control = block.control.without(twice)
    block.add_control_points(control, origin)


def put_check_points(block: Block, control: ControlPoints, origin: Origin, replaced: Collection[str]) -> None:
    """Adds check points; they are control no more, and replace those of their names, with notes."""
    taken = [name for name in control.names if name in set(block.control.names)]
    note_count(block, taken, "control points are check points: they take no part as control")
    block.control = block.control.without(taken)
    again = [name for name in control.names if name in replaced and name in block.check_points.names]
    note_count(block, again, f"check points of the block are replaced by those of {origin.path}")
    block.check_points = block.check_points.without(again)
    block.add_check_points(control)


def turned_to_frame(rotations: FloatArray, places: FloatArray, system: str, frame: str) -> FloatArray:
    """Rotations (n, 3, 3) from a camera to east, north and up of a map, as rotations to a frame.

    East is that of the map at each place (n, 3): the convergence of meridians is in it.
    """
    source, target = crs.parse(system), crs.parse(frame)
    if source == target:
        return rotations
    unit = source.plan_unit
    step = np.array([STEP_OF_ANGLE if unit.is_angle else STEP / unit.factor, 0.0, 0.0])
    mover = crs.Transformer(source, target)
    here, there = (np.asarray(mover.forward(points)) for points in (places, places + step))
    up = target.vertical_rotation(here)[:, 2]
    east = there - here
    east -= np.sum(east * up, axis=1, keepdims=True) * up
    east /= np.linalg.norm(east, axis=1, keepdims=True)
    axes = np.stack([east, np.cross(up, east), up], axis=2)
    return np.asarray(axes @ rotations)
