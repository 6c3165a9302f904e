"""Control points in another unit than poses, lengths or observed centres."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from obseq.images.adjustment.adjustable import AdjustableBlock
from obseq.images.causes.shared import SharedCause, Subject, Told, Trial
from obseq.images.initial.units import unit_of_control


def _trials(subject: Subject) -> Iterator[Trial]:
    unit = unit_of_control(subject.block, subject.given)
    if unit is None:
        return
    factor, said = unit
    text = f"the control points are {factor:.6g} times as large as the rest of the block says ({said})"
    for sigmas in (1.0, factor):  # they may be in the unit of the coordinates, or in that of the block
        made = with_control_divided(subject.block.copied(), factor, sigmas)
        made.poses = subject.given
        yield Trial.saying(f"control points divided by {factor:.6g}", Told(text), made)


def with_control_divided(block: AdjustableBlock, factor: float, sigmas: float) -> AdjustableBlock:
    """The block, with its control points divided by a factor, and their sigmas by another."""
    control = block.control
    covariances = control.covariances / sigmas**2
    block.control = replace(control, coordinates=control.coordinates / factor, covariances=covariances)
    return block


UNIT_OF_CONTROL = SharedCause(
    "I150",
    "unit of control",
    "The control points are in another unit than the rest of the block.",
    "Coordinates in millimetres with poses in metres.",
    "Give the control points in the unit of the poses, lengths and observed centres.",
    6.0,
    _trials,
    lambda subject: True,
    is_sure=True,
)
