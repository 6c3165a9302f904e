"""Other observations of a block in tables: lengths between points, and positions of images.

| table | columns |
|---|---|
| lengths | `from to length sigma` |
| positions | `image x y z`, and `sigma` or `sx sy sz`; an empty sigma is not observed |
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.images.poses import Poses
from obseq.reading.tables import Table

if TYPE_CHECKING:
    from pathlib import Path

    from obseq.images.block import Block


def add_lengths(block: Block, path: str | Path) -> None:
    """Adds the lengths of a table to a block, scale bars for instance.

    Raises:
        InputError: a column is missing, a length or a sigma is not above zero; file and line are named.
    """
    table = Table.read(path)
    table.allow(("from", "to", "length", "sigma"))
    table.require("from", "to", "length", "sigma")
    values = np.column_stack([table.numbers("length"), table.numbers("sigma")]).tolist()
    ends = zip(table.texts("from"), table.texts("to"), strict=True)
    for row, ((first, second), (length, sigma)) in enumerate(zip(ends, values, strict=True)):
        try:
            block.add_length(first, second, length, sigma)
        except InputError as error:
            raise InputError(f"{table.place(row)}: {error}") from None


def observe_positions(block: Block, path: str | Path) -> None:
    """Adds observed projection centres, of a satellite receiver for instance.

    Raises:
        InputError: a column is missing, an image is not known, a sigma is not above zero.
    """
    table = Table.read(path)
    table.allow(("image", "x", "y", "z", "sigma", "sx", "sy", "sz"))
    table.require("image", "x", "y", "z")
    columns = ("sigma",) * 3 if "sigma" in table else ("sx", "sy", "sz")
    table.require(*columns)
    centres = np.column_stack([table.numbers(name) for name in "xyz"])
    sigmas = np.column_stack([table.numbers(name, np.inf) for name in columns])
    with table.located():
        turns = np.broadcast_to(np.eye(3), (len(table), 3, 3))
        block.observe_poses(Poses.of(table.texts("image"), centres, turns), sigmas)
