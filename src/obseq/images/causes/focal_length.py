"""Focal lengths that are far from those given: images cannot be placed with them, or fit as mirror images."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.images.causes.shared import SharedCause, Told, Trial

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.images.adjustment.solution import BundleSolution
    from obseq.images.causes.shared import Subject

OFF = 0.03
"""Share of itself by which a focal length is off, at least, that keeps images from being placed."""
FACTORS = (2.0, 0.5, 1.4, 0.7)
"""Times as long as it was given a focal length may be: each covers those about it."""


def _trials(subject: Subject) -> Iterator[Trial]:
    for factor in FACTORS:
        made = subject.block.copied()
        made.poses = subject.given
        made.cameras = {name: replace(c, focal=factor * c.focal) for name, c in made.cameras.items()}
        made.free_parameters("F")
        yield Trial(f"focal lengths times {factor:.3g}", made, lambda found: Told(_words(subject, found)))


def _words(subject: Subject, found: BundleSolution) -> str:
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
    _trials,
)
