"""Slips behind a whole image, or all images of a camera: how its measures were given, or whose they are.

The images are resected on the points as the others place them, in each way their measures may have been
given; the way in which nearly all of them fit is told.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from obseq.diagnosis.policy import POLICY
from obseq.diagnosis.protocol import Change, Slip
from obseq.errors import ObseqError
from obseq.images.camera import Camera
from obseq.images.causes.evidence import Evidence
from obseq.images.control import ControlPoints
from obseq.images.initial.conventions import OF_ONE_IMAGE
from obseq.images.initial.resection import ResectionOptions, resect
from obseq.images.measures import ImagePoints
from obseq.images.names import are_among

NEARLY_ALL = 0.9
"""Share of the measures that must fit."""
PIXELS = 3.0
"""Pixels that it may be off in any case: the others determine points no better."""
LOOSE = ResectionOptions(triplets=200, max_error=np.inf, covariance=False)
CODES = ("W140", "W141", "W142", "W143", "W143", "W143", "W143")
"""Of the conventions in turn: lines upwards, columns from the right, x and y exchanged, another size."""


def slips_of_images(evidence: Evidence, label: tuple[int, ...], change: Change) -> Iterator[Slip]:
    """What is wrong with one image."""
    yield from _slips(evidence, [label[0]], evidence.cameras)


def slips_of_a_camera(evidence: Evidence, label: tuple[int, ...], change: Change) -> Iterator[Slip]:
    """What is wrong with the images of one camera."""
    images = np.flatnonzero(evidence.numbering.camera == label[0]).tolist()
    yield from _slips(evidence, images, evidence.numbering.equations.start.cameras)


def _slips(evidence: Evidence, images: list[int], of_image: Sequence[Camera]) -> Iterator[Slip]:
    names = [evidence.poses.images[image] for image in images]
    cameras = {name: of_image[image] for name, image in zip(names, images, strict=True)}
    measures, known = _measures(evidence, names), _others(evidence, images)
    yield from convention_of(measures, known, cameras, evidence.cameras)


def convention_of(
    measures: ImagePoints, known: ControlPoints, cameras: dict[str, Camera], others: Sequence[Camera]
) -> Iterator[Slip]:
    """How the measures in some images were given, where nearly all of them fit then.

    Args:
        measures: in the images.
        known: points as the other images place them.
        cameras: of the images, by name.
        others: all cameras: the images may be of another.
    """
    if _fit(measures, known, cameras):
        yield Slip("W146", "its pose is given far from where it is", 0.0, is_strong=True)
        return
    for code, convention in zip(CODES, OF_ONE_IMAGE, strict=True):
        changed = convention.of(measures, cameras)
        if changed is not None and _fit(changed, known, cameras):
            yield Slip(code, convention.said, 0.0, is_strong=True)
            return
    own = {camera.name for camera in cameras.values()}
    for camera in {camera.name: camera for camera in others}.values():
        if camera.name not in own and _fit(measures, known, dict.fromkeys(cameras, camera)):
            yield Slip("W144", f"it is of camera {camera.name}", 0.0, is_strong=True)


def _measures(evidence: Evidence, images: list[str]) -> ImagePoints:
    sets = evidence.numbering.equations.start.sets
    parts = [part.given.measures for part in sets]
    own = (part.rows(are_among(part.image_names, images)[part.image]) for part in parts)
    return functools.reduce(ImagePoints.joined, own)


def _others(evidence: Evidence, images: list[int]) -> ControlPoints:
    """The points that are known without some images: control points, and those that two others see."""
    numbering, start = evidence.numbering, evidence.numbering.equations.start
    others = numbering.kept & ~np.isin(numbering.image, images)
    rays = np.bincount(numbering.point[others], minlength=len(start.points))
    rows = np.flatnonzero((rays >= 2) | start.is_control)
    return ControlPoints.of([start.points[row] for row in rows], evidence.coordinates[rows])


def _fit(measures: ImagePoints, known: ControlPoints, cameras: dict[str, Camera]) -> bool:
    """Whether nearly all measures fit, each image from a pose of its own."""
    try:
        found = resect(replace(measures).of_points(known.names), known, cameras, LOOSE)
    except ObseqError:
        return False
    limit = np.maximum(POLICY.suspect * found.measures.sigmas, PIXELS)
    good = (np.abs(np.nan_to_num(found.residuals, nan=np.inf)) < limit).all(axis=1)
    return bool(good.mean() >= NEARLY_ALL)
