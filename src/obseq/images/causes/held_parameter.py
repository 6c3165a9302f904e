"""A parameter of a camera that is held at a wrong value."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.images.causes.cause import Cause, Members

if TYPE_CHECKING:
    from obseq.images.causes.numbering import Numbering


def _where(numbering: Numbering) -> Members:
    rows = np.arange(len(numbering.parameters))
    return Members.alike(numbering.n + rows[:, None], rows)


def _words(numbering: Numbering, label: tuple[int, ...]) -> str:
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
    _where,
    _words,
    is_bent=True,
)
