"""A block that can be adjusted, as those see it who try changes of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from obseq.images.block import Block

if TYPE_CHECKING:
    from obseq.images.adjustment.solution import BundleSolution


class AdjustableBlock(Block):
    """A block whose images can be placed, and which can be solved (see `BundleAdjustment`)."""

    def initialise(self, causes: bool = True) -> tuple[str, ...]:
        """Finds poses for the images that have measures and none; returns their names."""
        raise NotImplementedError

    def solve(self, *args: Any, **kwargs: Any) -> BundleSolution:
        """Adjusts the block."""
        raise NotImplementedError
