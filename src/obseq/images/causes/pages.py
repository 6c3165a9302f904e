"""What a person can read of all causes of blocks, and of slips of images alone: a page for each code."""

from __future__ import annotations

from obseq.diagnosis.page import Page, price
from obseq.images.causes.cause import Cause
from obseq.images.causes.registry import CAUSES, SHARED
from obseq.images.causes.shared import SharedCause

_ONE_IMAGE = ("Nearly all measures of the image must fit so, from a pose of its own.",)

SLIPS = (
    Page(
        "W140",
        "lines upwards",
        "The lines of an image are counted upwards.",
        _ONE_IMAGE,
        "Measures of a program with the origin in the lower left corner.",
        "Convert the measures: y down from the upper edge.",
    ),
    Page(
        "W141",
        "columns from the right",
        "The columns of an image are counted from the right.",
        _ONE_IMAGE,
        "A negative that was scanned from its back.",
        "Convert the measures: x to the right from the left edge.",
    ),
    Page(
        "W142",
        "x and y exchanged",
        "Line and column of the measures of an image are exchanged.",
        _ONE_IMAGE,
        "A list in the order line, column.",
        "Exchange the columns.",
    ),
    Page(
        "W143",
        "image of another size",
        "An image was measured in a copy of another size.",
        _ONE_IMAGE,
        "Points measured in a copy of half the size.",
        "Convert the measures to pixels of the camera.",
    ),
    Page(
        "W144",
        "image of another camera",
        "An image is of another camera than the one that is given.",
        ("Nearly all measures of the image must fit with the other camera.",),
        "The name of the camera was copied from the line above.",
        "Correct the camera of the image.",
    ),
    Page(
        "W146",
        "pose far off",
        "The pose of an image is given far from where it is.",
        _ONE_IMAGE,
        "The pose of another image, or angles in another convention.",
        "Correct the pose, or leave it out.",
    ),
)
"""Slips of images; those that surveys have too are with them."""


def pages() -> tuple[Page, ...]:
    """All causes of blocks, by code."""
    found = [*map(_of_cause, CAUSES), *map(_of_shared, SHARED)]
    return tuple(sorted(found, key=lambda page: page.code))


def _of_cause(cause: Cause) -> Page:
    many = (
        "All that it concerns must be off, each by its own size"
        if cause.is_block
        else "Its size is estimated"
    )
    return Page.of(cause, f"{many}{f' ({cause.unit})' if cause.unit else ''}.", *price(cause.rarity))


def _of_shared(cause: SharedCause) -> Page:
    tested = "The block is changed so, and adjusted anew: it must fit then."
    return Page.of(cause, tested, *price(cause.rarity))
