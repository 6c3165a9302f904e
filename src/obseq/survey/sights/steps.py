"""How points were placed and stations oriented: recorded by numbers of sights, in words when asked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, overload

if TYPE_CHECKING:
    from obseq.survey.sights.sights import Sights


class Step(NamedTuple):
    """How a point was placed or a station oriented: the method and the rows of its observations."""

    method: str
    observations: tuple[int, ...] = ()


GIVEN = Step("given")
FREE_STATION = "free station"

Sighted = tuple[int, ...]
"""Sights at whose end something is: one or two that meet there; more are those of a free station."""

Cause = Step | Sighted


class Steps(Sequence[Step | None]):
    """The steps of points or of stations, None where there is none.

    Args:
        causes: of each.
        sights: all of them.
    """

    def __init__(self, causes: Sequence[Cause | None], sights: Sights) -> None:
        self._causes, self._sights = causes, sights

    def __len__(self) -> int:
        return len(self._causes)

    @overload
    def __getitem__(self, which: int) -> Step | None: ...
    @overload
    def __getitem__(self, which: slice) -> tuple[Step | None, ...]: ...
    def __getitem__(self, which: int | slice) -> Step | tuple[Step | None, ...] | None:
        """One of them, or several."""
        if isinstance(which, slice):
            return tuple(self[k] for k in range(len(self))[which])
        cause = self._causes[which]
        return None if cause is None else step_of(cause, self._sights)


def step_of(cause: Cause, sights: Sights) -> Step:
    """A cause in words, with its observations."""
    if isinstance(cause, Step):
        return cause
    rows = (row for number in cause for row in sights.rows_of(number))
    return Step(FREE_STATION if len(cause) > 2 else "azimuth and distance", tuple(dict.fromkeys(rows)))
