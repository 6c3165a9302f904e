"""Cameras whose parameters the measures do not determine."""

from __future__ import annotations

from typing import TYPE_CHECKING

from obseq.images.causes.shared import SharedCause, Trial

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.images.causes.shared import Subject


def _trials(subject: Subject) -> Iterator[Trial]:
    """The block with cameras that keep their parameters, where it has no solution with free ones."""
    if subject.solution is not None:
        return
    made = subject.block.copied()
    made.poses = subject.given
    made.freeze_parameters()
    yield Trial.saying(
        "cameras held", "the measures do not determine the cameras; hold their parameters", made
    )


UNDETERMINED_CAMERAS = SharedCause(
    "I132",
    "undetermined cameras",
    "The measures do not determine the parameters of the cameras.",
    "Few images, all from the same height, of flat ground.",
    "Hold the parameters (--freeze '.*'), or measure more images and control points.",
    0.0,
    _trials,
)
