"""What readers of blocks of other programs share: what is left out, and what a camera has as unknowns."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from obseq.errors import noting
from obseq.images.block import Block
from obseq.images.bundle import BundleAdjustment
from obseq.printable import listed
from obseq.reading.origin import Origin

SHOWN = 5
"""Names of many that a note gives."""


@contextmanager
def new_block(path: str | Path) -> Iterator[BundleAdjustment]:
    """A block to fill from a file or folder; its notes go with an error that ends the reading."""
    block = BundleAdjustment()
    block.origin = Origin(str(path))
    with noting(block.notes):
        yield block


def note_count(block: Block, names: Sequence[str], words: str) -> None:
    """Notes how many things a file holds that are not used as it says, and the names of the first ones.

    Args:
        block: that is read.
        names: of these things; nothing is noted where there are none.
        words: what they are and what becomes of them: the end of a sentence that begins with their number.
    """
    if names:
        block.notes.append(f"{len(names)} {words}: {listed(names, SHOWN)}")


def hold_all_but(block: BundleAdjustment, terms: Mapping[str, Collection[str]]) -> None:
    """Holds what the cameras of another program do not have.

    Args:
        block: with its cameras.
        terms: of each camera, by name, its parameters that are unknown.
    """
    groups: dict[str, list[str]] = defaultdict(list)
    for name, free in terms.items():
        held = [term for term in block.cameras[name].parameter_names if term not in free]
        groups["|".join(held)].append(name)
    for pattern, names in groups.items():
        if pattern:
            block.freeze_parameters(pattern, ".*" if len(groups) == 1 else "|".join(map(re.escape, names)))
