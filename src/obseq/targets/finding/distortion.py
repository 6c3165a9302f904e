"""One distortion for all targets of an image: what bends each of them is known better from all.

A radial distortion `k (r / f)^2` about the middle of the image bends a drawing at d from there by `K d`, with
`K = k / f^2`. Each fit knows its own bend poorly; together they know K, and the bend in the middle, which is
not zero where the distortion has another centre.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from obseq.arrays import FloatArray, FloatRows
from obseq.targets.finding.fits import Fit
from obseq.targets.finding.measuring import BEND_PRIOR

RADIAL_PRIOR = 0.1
"""Sigma of k, before anything is measured."""
MIDDLE_PRIOR = 0.03
"""Sigma of the bend in the middle of the image, over the focal length: of other distortions, and of parts cut
out of an image."""


def with_one_distortion(fits: Sequence[Fit], shape: tuple[int, ...], focal: float) -> list[Fit]:
    """The fits of an image, as if each had known the bend that all of them say.

    Args:
        fits: of targets, each with a bend of its own.
        shape: height and width of the image.
        focal: in pixels, as the fits were given it.
    """
    middle = 0.5 * np.array([shape[1] - 1.0, shape[0] - 1.0])
    rows = [np.column_stack((np.eye(2), fit.placed.centre - middle)) for fit in fits]
    normal = np.diag([(focal / MIDDLE_PRIOR) ** 2] * 2 + [(focal**2 / RADIAL_PRIOR) ** 2])
    right = np.zeros(3)
    for fit, row in zip(fits, rows, strict=True):
        inverse = np.linalg.inv(fit.joint[:2, :2])
        normal += row.T @ (inverse - np.eye(2) * (focal / BEND_PRIOR) ** 2) @ row
        right += row.T @ inverse @ fit.placed.bend
    covariance = np.linalg.inv(normal)
    field = covariance @ right
    return [_bent(fit, row @ field, row @ covariance @ row.T) for fit, row in zip(fits, rows, strict=True)]


def _bent(fit: Fit, bend: FloatArray, covariance: FloatRows) -> Fit:
    """A fit in which the bend is known: the centre moves with it, as they were correlated."""
    own, cross = fit.joint[:2, :2], fit.joint[2:, :2]
    share = cross @ np.linalg.inv(own)
    moved = fit.placed.centre + share @ (bend - fit.placed.bend)
    joint = np.zeros((4, 4))
    joint[:2, :2] = covariance
    joint[2:, :2] = share @ covariance
    joint[:2, 2:] = joint[2:, :2].T
    joint[2:, 2:] = fit.joint[2:, 2:] - share @ cross.T + share @ covariance @ share.T
    return replace(fit, placed=replace(fit.placed, centre=moved, bend=bend), joint=joint)
