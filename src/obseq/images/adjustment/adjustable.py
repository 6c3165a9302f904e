"""A block that can be adjusted, as those see it who try changes of it."""

from __future__ import annotations

import copy
from dataclasses import fields
from typing import Any, Self

from obseq.images.adjustment.solution import BundleSolution
from obseq.images.block import Block
from obseq.images.parts import Approximations


class AdjustableBlock(Block):
    """A block whose images can be placed, and which can be solved (see `BundleAdjustment`)."""

    def copied(self) -> Self:
        """The block, to be changed: what is added to the copy is not added here."""
        made = copy.copy(self)
        for entry in fields(self):
            value = getattr(self, entry.name)
            if isinstance(value, list | dict | Approximations):
                setattr(made, entry.name, copy.copy(value))
        made.instruments = copy.deepcopy(self.instruments)
        return made

    def initialise(self, causes: bool = True) -> tuple[str, ...]:
        """Finds poses for the images that have measures and none; returns their names."""
        raise NotImplementedError

    def solve(self, *args: Any, **kwargs: Any) -> BundleSolution:
        """Adjusts the block."""
        raise NotImplementedError
