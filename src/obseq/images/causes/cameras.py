"""Cameras that are given wrong, or that the measures do not determine."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from obseq.images.adjustment.solution import BundleSolution
from obseq.images.causes.cause import Cause, Members
from obseq.images.causes.numbering import Numbering
from obseq.images.causes.shared import SharedCause, Subject, Told, Trial


def _where_of_parameter(numbering: Numbering) -> Members:
    rows = np.arange(len(numbering.parameters))
    return Members.alike(numbering.n + rows[:, None], rows)


def _words_of_parameter(numbering: Numbering, label: tuple[int, ...]) -> str:
    parameter = numbering.parameters[label[0]]
    return f"{parameter.name} of camera {parameter.camera}"


HELD_PARAMETER = Cause(
    "I130",
    "held parameter",
    "A parameter of a camera is held at a value that the images contradict.",
    "The calibration is of another camera, of another focus, or a term of the distortion is missing.",
    "Let the parameter be estimated (--freeze without it), or give its right value.",
    "",
    4.0,
    _where_of_parameter,
    _words_of_parameter,
    is_bent=True,
)

OFF = 0.03
"""Share of itself by which a focal length is off, at least, that keeps images from being placed."""
FACTORS = (2.0, 0.5, 1.4, 0.7)
"""Times as long as it was given a focal length may be: each covers those about it."""


def _trials_of_focal_length(subject: Subject) -> Iterator[Trial]:
    for factor in FACTORS:
        made = subject.block.copied()
        made.poses = subject.given
        made.cameras = {name: replace(c, focal=factor * c.focal) for name, c in made.cameras.items()}
        made.free_parameters("F")
        yield Trial(
            f"focal lengths times {factor:.3g}",
            made,
            lambda found: Told(_words_of_focal_length(subject, found)),
        )


def _words_of_focal_length(subject: Subject, found: BundleSolution) -> str:
    """The focal length that is farthest from what was given, where it is far."""
    given = subject.block.cameras
    off = {name: abs(float(np.log(c.focal / given[name].focal))) for name, c in found.cameras.items()}
    name = max(off, key=lambda name: off[name])
    if off[name] < OFF:
        return ""
    return (
        f"a focal length is wrong, or its unit (camera {name}: {given[name].focal:g} px given, "
        f"{found.cameras[name].focal:.6g} px as an unknown)"
    )


FOCAL_LENGTH = SharedCause(
    "I131",
    "focal length",
    "Focal lengths are far from those of the cameras.",
    "Millimetres for pixels, the length of another zoom.",
    "Give the focal length in pixels.",
    4.0,
    _trials_of_focal_length,
)


def _trials_held(subject: Subject) -> Iterator[Trial]:
    """The block with cameras that keep their parameters, where it has no solution with free ones."""
    if subject.solution is not None:
        return
    made = subject.block.copied()
    made.poses = subject.given
    made.freeze_parameters()
    said = "the measures do not determine the cameras; hold their parameters"
    yield Trial.saying("cameras held", Told(said), made)


UNDETERMINED_CAMERAS = SharedCause(
    "I132",
    "undetermined cameras",
    "The measures do not determine the parameters of the cameras.",
    "Few images, all from the same height, of flat ground.",
    "Hold the parameters (--freeze '.*'), or measure more images and control points.",
    0.0,
    _trials_held,
)
