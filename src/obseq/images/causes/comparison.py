"""How an adjusted block compares with what was given: its poses, its principal points."""

from __future__ import annotations

import itertools

import numpy as np

from obseq.arrays import FloatArray
from obseq.images.adjustment.solution import BundleSolution
from obseq.images.camera import Camera
from obseq.images.names import are_among
from obseq.images.poses import Poses


def principal_shift(found: BundleSolution) -> float:
    """Pixels by which a principal point moved, at most."""
    given = found.block.cameras
    shifts = [c.principal_point - given[name].principal_point for name, c in found.cameras.items()]
    return float(np.abs(shifts).max(initial=0.0))


def moved(found: Poses, given: Poses) -> float:
    """By how much poses moved, in the median: radians, and shares of the extent of their centres."""
    new, old = common(found, given)
    if not len(new):
        return 0.0
    extent = max(float(np.linalg.norm(np.ptp(found.centres, axis=0))), 1e-12)
    shares = np.linalg.norm(new.centres - old.centres, axis=1) / extent
    return float(np.median(turns(old, new)) + np.median(shares))


def common(first: Poses, second: Poses) -> tuple[Poses, Poses]:
    """The poses of the images that both have."""
    known = list(itertools.compress(first.images, are_among(first.images, second.images)))
    return first.select(known), second.select(known)


def turns(first: Poses, second: Poses) -> FloatArray:
    """(n,) radians between the rotations of the same images."""
    return angles_of(np.swapaxes(first.rotations, 1, 2) @ second.rotations)


def angles_of(rotations: FloatArray) -> FloatArray:
    """(n,) radians by which rotations (n, 3, 3) turn."""
    traces = np.trace(rotations, axis1=1, axis2=2)
    return np.asarray(np.arccos(np.clip(0.5 * (traces - 1.0), -1.0, 1.0)))


def is_mirrored(solution: BundleSolution) -> bool:
    """Whether mirrored images fit: with points behind the cameras, or distortions that change sides."""
    behind = 2 * int(np.count_nonzero(solution.is_behind)) > len(solution.is_behind)
    return behind or any(_changes_sides(camera) for camera in solution.cameras.values())


def _changes_sides(camera: Camera) -> bool:
    """Whether x or y go the wrong way about the axis of a camera: an affine term below -1, usually."""
    _, jacobian = camera.project_with_jacobian([[0.0, 0.0, 1.0]])
    return bool(np.linalg.det(jacobian[0, :, :2]) < 0.0)


def has_robust_weights(solution: BundleSolution) -> bool:
    """Whether a robust weight other than 1 took part."""
    weights = solution.residuals.weights
    return bool((np.abs(weights[np.isfinite(weights)] - 1.0) > 1e-12).any())
