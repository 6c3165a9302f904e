"""Aerial shots: where each image was taken from, on the map, and how it looked."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from obseq.arrays import FloatArray, IntArray
from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.geometry.attitudes import TURNS
from obseq.images.aerial.heights import HeightType


@dataclass(frozen=True)
class FrameCamera:
    """A frame camera without distortion; everything in pixels, columns to the right, lines downwards.

    Attributes:
        name: how shots call it.
        principal_point: (column, line).
        focal: principal distance.
        size: (width, height) of the images, or None.
    """

    name: str
    principal_point: tuple[float, float]
    focal: float
    size: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        numbers = (*self.principal_point, self.focal)
        if not np.isfinite(numbers).all() or self.focal <= 0.0:
            raise InputError(
                f"camera {self.name}: focal and principal point must be finite, the focal positive: {numbers}"
            )


@dataclass(frozen=True)
class Shots:
    """Shots of a flight, in columns.

    Attributes:
        names: name of each.
        positions: (n, 3) map coordinates and z of the projection centres, metres.
        matrices: (n, 3, 3) rotations from the map at the shot to image axes (column, line, forward).
        cameras: name of the camera of each.
        height_type: what z is counted from, or None.
        has_alteration: whether z carries the linear alteration of the map.
        nadir: (n,) z of the ground in front of the shot, in the type of the shots; nan where unknown.
    """

    names: tuple[str, ...]
    positions: FloatArray
    matrices: FloatArray
    cameras: tuple[str, ...]
    height_type: HeightType | None = None
    has_alteration: bool = False
    nadir: FloatArray | None = None

    def __post_init__(self) -> None:
        if len(set(self.names)) != len(self.names):
            seen: set[str] = set()
            twice = next(name for name in self.names if name in seen or seen.add(name))  # type: ignore[func-returns-value]
            raise InputError(f"shot {twice}: given twice; names of shots must be unique.")

    def __len__(self) -> int:
        return len(self.names)

    @classmethod
    def from_angles(
        cls,
        names: Sequence[str],
        positions: npt.ArrayLike,
        angles: npt.ArrayLike,
        cameras: Sequence[str],
        *,
        order: str = "opk",
        height_type: HeightType | None = None,
        has_alteration: bool = False,
        nadir: FloatArray | None = None,
    ) -> Shots:
        """Shots from stored angles (n, 3), radians, in an order of axes (`obseq.images.aerial.shots`)."""
        matrices = matrices_from_angles(np.asarray(angles, dtype=np.float64).reshape(-1, 3), order)
        places = np.asarray(positions, dtype=np.float64).reshape(-1, 3)
        return cls(tuple(names), places, matrices, tuple(cameras), height_type, has_alteration, nadir)

    @cached_property
    def _index(self) -> dict[str, int]:
        return {name: index for index, name in enumerate(self.names)}

    def index(self, names: Iterable[str]) -> IntArray:
        """Rows of shots.

        Raises:
            InputError: for a name that is not there.
        """
        try:
            return np.array([self._index[name] for name in names], dtype=np.int64)
        except KeyError as error:
            raise InputError(
                f"shot {error.args[0]}: unknown; it is not among the {len(self)} shots."
            ) from None

    def __contains__(self, name: object) -> bool:
        return name in self._index

    def angles(self, order: str = "opk") -> FloatArray:
        """Stored angles (n, 3), radians, in an order of axes."""
        return angles_from_matrices(self.matrices, order)

    def with_nadir(self, nadir: FloatArray) -> Shots:
        """The same shots with the z of the ground in front of them (n,)."""
        return replace(self, nadir=nadir)


UNITS = {"degree": np.pi / 180.0, "gon": np.pi / 200.0, "radian": 1.0}
"""Radians in each unit of angle."""
_AXES = {"o": 0, "p": 1, "k": 2}
_FLIP = np.array([1.0, -1.0, -1.0])


def axes_of(order: str) -> tuple[int, int, int]:
    """The axes (0, 1, 2 for x, y, z) of an order such as ``opk``.

    Raises:
        InputError: if the order is not a permutation of o, p, k.
    """
    if sorted(order) != ["k", "o", "p"]:
        raise InputError(f"order of rotations {order!r}: must be a permutation of the letters o, p, k.")
    first, second, third = (_AXES[letter] for letter in order)
    return first, second, third


def unit_of(name: str) -> float:
    """Radians in a unit of angle called degree, gon or radian.

    Raises:
        InputError: for another name.
    """
    if name not in UNITS:
        raise InputError(f"unit of angles {name!r}: must be one of {', '.join(UNITS)}.")
    return UNITS[name]


def matrices_from_angles(angles: FloatArray, order: str = "opk") -> FloatArray:
    """Rotations (n, 3, 3) from the map to image axes, of stored angles (n, 3), radians."""
    turned = np.eye(3)
    for axis, angle in zip(axes_of(order), angles.T, strict=True):
        turned = turned @ TURNS[axis](angle)
    return _FLIP[:, None] * np.swapaxes(turned, -1, -2)


def angles_from_matrices(matrices: FloatArray, order: str = "opk") -> FloatArray:
    """Stored angles (n, 3), radians, of rotations (n, 3, 3) from the map to image axes."""
    a, b, c = axes_of(order)
    turned = np.swapaxes(_FLIP[:, None] * matrices, -1, -2)
    sign = 1.0 if (a, b, c) in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else -1.0
    first = np.arctan2(-sign * turned[..., b, c], turned[..., c, c])
    second = np.arcsin(np.clip(sign * turned[..., a, c], -1.0, 1.0))
    third = np.arctan2(-sign * turned[..., a, b], turned[..., a, a])
    return np.stack([first, second, third], axis=-1)
