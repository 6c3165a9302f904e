"""Former names of the survey room, which still work, and say what to use now."""

from __future__ import annotations

import enum
import warnings
from functools import cache
from typing import TYPE_CHECKING, cast

from obseq.survey.kinds.registry import BY_CODE, KINDS

if TYPE_CHECKING:
    from collections.abc import Callable


class _Code(enum.IntEnum):
    """What was measured, by the code of OBS files."""

    @property
    def is_angle(self) -> bool:
        """Whether value and sigma are angles."""
        return BY_CODE[self].is_angle

    @property
    def needs_station(self) -> bool:
        """Whether it is read on an instrument."""
        return BY_CODE[self].needs_station


def find(name: str) -> type[enum.IntEnum]:
    """The `__getattr__` of the room.

    Raises:
        AttributeError: there was never such a name.
    """
    if name != "ObservationType":
        raise AttributeError(f"module 'obseq.survey' has no attribute {name!r}")
    message = "obseq.survey.ObservationType: kinds of observations are objects now, obseq.survey.KINDS"
    warnings.warn(message, DeprecationWarning, stacklevel=2)
    return _observation_type()


@cache
def _observation_type() -> type[enum.IntEnum]:
    make = cast("Callable[[str, dict[str, int]], type[enum.IntEnum]]", _Code)
    return make("ObservationType", {kind.name: kind.code for kind in KINDS})
