"""What a block holds beside cameras and poses; the block checks it when it is added."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import field, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from obseq.arguments import NUMBER, require
from obseq.arrays import BoolArray, FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.images.measures import ImagePoints
from obseq.images.poses import Poses
from obseq.leastsquares.problem.losses import Attenuated, Loss
from obseq.reading.origin import Origin

if TYPE_CHECKING:
    import re


class Approximations(Mapping[str, FloatArray]):
    """Where points are about, by name: kept as the arrays given; of a name, the last one counts."""

    def __init__(self) -> None:
        self._given: list[tuple[tuple[str, ...], FloatArray]] = []
        self._rows: dict[str, FloatArray] = {}

    def __copy__(self) -> Approximations:
        made = Approximations()
        made._given = list(self._given)
        return made

    def add(self, names: Sequence[str], coordinates: FloatArray) -> None:
        """Adds (n, 3) coordinates of n names."""
        self._given.append((tuple(names), coordinates))
        self._rows = {}

    def of(self, names: Sequence[str]) -> FloatArray:
        """(n, 3) coordinates of different names, NaN where there are none; a copy."""
        if len(self._given) == 1 and self._given[0][0] == tuple(names):
            return self._given[0][1].copy()
        unknown = np.full(3, np.nan)
        return np.array([self._by_name.get(name, unknown) for name in names]).reshape(-1, 3)

    @property
    def _by_name(self) -> dict[str, FloatArray]:
        """Rows of the arrays, looked for when a name is asked for."""
        if not self._rows:
            for names, coordinates in self._given:
                self._rows.update(zip(names, coordinates, strict=True))
        return self._rows

    def __getitem__(self, name: str) -> FloatArray:
        return self._by_name[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._by_name)

    def __len__(self) -> int:
        return len(self._by_name)


@dataclass(frozen=True, eq=False)
class MeasureSet:
    """Image points that are weighted alike.

    Attributes:
        measures: the points.
        weighting: robust weights; the sigmas are in the measures.
        name: of the set, for messages and sums of squares.
        origin: where they were read; None where nobody said.
        robust: robust weights of residuals over sigmas, in place of those of the weighting.
    """

    measures: ImagePoints
    weighting: Weighting | None
    name: str
    origin: Origin | None = None
    robust: Loss | None = None

    @property
    def loss(self) -> Loss | None:
        """Of residuals over sigmas; None where no measure is weakened."""
        return self.robust or (None if self.weighting is None else self.weighting.loss)

    def of_rows(self, kept: BoolArray) -> MeasureSet:
        """The set with some of its rows (n,)."""
        if kept.all():
            return self
        origin = self.origin
        if origin is not None and origin.lines:
            origin = replace(origin, lines=tuple(itertools.compress(origin.lines, kept)))
        return replace(self, measures=self.measures.rows(kept), origin=origin)


@dataclass(frozen=True)
class Lengths:
    """Distances between points, scale bars among them.

    Attributes:
        first: (n,) names of points.
        second: (n,) names of points.
        values: (n,) in the unit of the world.
        sigmas: (n,).
    """

    first: tuple[str, ...] = ()
    second: tuple[str, ...] = ()
    values: tuple[float, ...] = ()
    sigmas: tuple[float, ...] = ()


@dataclass(frozen=True)
class PoseObservations:
    """Poses that are observed: satellite positions, another orientation.

    Attributes:
        poses: observed values.
        centre_sigmas: (n, 3); infinite where nothing is observed.
        rotation_sigma: radians per axis; None when rotations are not observed.
    """

    poses: Poses
    centre_sigmas: FloatArray
    rotation_sigma: float | None

    def without(self, images: Collection[str]) -> PoseObservations:
        """Those of the other images."""
        rows = [row for row, image in enumerate(self.poses.images) if image not in images]
        kept = self.poses.select([self.poses.images[row] for row in rows])
        return PoseObservations(kept, self.centre_sigmas[rows], self.rotation_sigma)


@dataclass(eq=False)
class Instruments:
    """Clinometers and what they read.

    Attributes:
        clinometers: that cameras carry.
        inclinations: their readings.
        pendulums: that cameras carry.
        needles: their readings.
        right_angles: names of two clinometers whose axes are at right angles, and a sigma (radians).
        vertical: (3,) upwards, in the world.
        vertical_is_free: whether it is an unknown.
    """

    clinometers: list[Clinometer] = field(default_factory=list)
    inclinations: list[Inclinations] = field(default_factory=list)
    pendulums: list[Pendulum] = field(default_factory=list)
    needles: list[Needles] = field(default_factory=list)
    right_angles: list[tuple[str, str, float]] = field(default_factory=list)
    vertical: tuple[float, float, float] = (0.0, 0.0, 1.0)
    vertical_is_free: bool = False

    def carry(self, carried: list[Carried], new: Carried) -> None:
        """Puts a clinometer, or a pendulum, to those that cameras carry; their names differ.

        Raises:
            InputError: there is one of this name.
        """
        if new.name in [item.name for item in self.clinometers] + [item.name for item in self.pendulums]:
            raise InputError(f"clinometer {new.name!r} is given twice")
        carried.append(new)

    @property
    def are_read(self) -> bool:
        """Whether anything refers to the vertical."""
        return bool(self.inclinations or self.needles)


@dataclass(frozen=True)
class Rule:
    """What keeps its value, or is freed again, by patterns of names that match as a whole."""

    cameras: re.Pattern[str]
    parameters: re.Pattern[str]
    frozen: bool


@dataclass(frozen=True)
class Weighting:
    """The weight of a measure with a residual of v pixels (both coordinates together).

        w = 0                                             where v > threshold
        w = 1 / sigma^2                                   without attenuation
        w = (1 / sigma^2) / (1 + (v / attenuation)^p)     with it; p is the exponent

    Attributes:
        sigma: pixels.
        attenuation: pixels, where the weight is one half; None for none.
        threshold: pixels; None for none.
        exponent: 1 tends to least absolute residuals, 2 is Cauchy's.

    Example:
        >>> Weighting(0.5, attenuation=1.0, exponent=2.0).weights([[2.0, 0.0]])
        array([0.8])
    """

    sigma: float
    attenuation: float | None = None
    threshold: float | None = None
    exponent: float = 1.0

    def __post_init__(self) -> None:
        require("weighting", "sigma", self.sigma, NUMBER)
        if not self.sigma > 0.0:
            raise InputError(f"weighting: sigma must be positive, not {self.sigma}")
        Attenuated(self.attenuation, self.threshold, self.exponent)  # which checks them

    @property
    def loss(self) -> Attenuated | None:
        """The same for residuals divided by sigma; None when no measure is weakened."""
        if self.attenuation is None and self.threshold is None:
            return None
        return Attenuated(self.attenuation, self.threshold, self.exponent).widened(1.0 / self.sigma)

    def weights(self, residuals: FloatArray) -> FloatArray:
        """(n,) weights of residuals (n, 2) pixels."""
        norms = np.linalg.norm(np.asarray(residuals, dtype=np.float64), axis=1) / self.sigma
        loss = self.loss
        shares = np.ones(len(norms)) if loss is None else loss.weights(norms)
        return np.asarray(shares / self.sigma**2)


DEGREES = (0, 1, 2, 3)
STEEPEST = np.radians(85.0)
"""Inclination beyond which the sine of an angle says too little of it."""


@dataclass(frozen=True, eq=False)
class Clinometer:
    """An axis fixed to a camera, whose inclination above the horizon is read.

    The sine of the inclination of the axis is `sum_k correction[k] sin(reading)^k` (MMVII's `Clino_0_3`): a
    perfect instrument has the correction (0, 1, 0, 0).

    Attributes:
        name: of the clinometer.
        axis: (3,) direction in the frame of the camera, of any length.
        correction: (4,) coefficients of degrees 0 to 3.
        free_degrees: of the correction, that are unknowns.
        is_fixed: True when the axis is known exactly.
    """

    name: str
    axis: FloatArray
    correction: tuple[float, ...] = (0.0, 1.0, 0.0, 0.0)
    free_degrees: tuple[int, ...] = ()
    is_fixed: bool = False

    def __post_init__(self) -> None:
        axis = np.array(self.axis, dtype=np.float64)
        if axis.shape != (3,) or not np.isfinite(axis).all() or not axis.any():
            raise InputError(f"clinometer {self.name}: its axis is a direction of three numbers, not {axis}")
        if len(self.correction) != len(DEGREES) or not np.isfinite(self.correction).all():
            raise InputError(f"clinometer {self.name}: the correction has four coefficients, degrees 0 to 3")
        if not set(self.free_degrees) <= set(DEGREES):
            raise InputError(
                f"clinometer {self.name}: free degrees are among 0 to 3, not {self.free_degrees}"
            )
        object.__setattr__(self, "axis", axis / np.linalg.norm(axis))


Carried = TypeVar("Carried", "Clinometer", "Pendulum")


@dataclass(frozen=True, eq=False)
class Pendulum:
    """A needle fixed to a camera, which the vertical turns in a plane.

    Attributes:
        name: of it.
        boresight: (3, 3) from the frame of the camera to its own: x and y are the plane of the needle.
        is_fixed: True when the boresight is known exactly.
        turns_with: another pendulum, on whose body it is: what one turns by, the other does; empty for none.
    """

    name: str
    boresight: FloatArray
    is_fixed: bool = False
    turns_with: str = ""

    def __post_init__(self) -> None:
        boresight = np.array(self.boresight, dtype=np.float64)
        is_rotation = boresight.shape == (3, 3) and np.allclose(boresight @ boresight.T, np.eye(3), atol=1e-6)
        if not is_rotation or np.linalg.det(boresight) < 0.0:
            raise InputError(f"pendulum {self.name}: its boresight is a rotation matrix, not {boresight}")
        object.__setattr__(self, "boresight", boresight)


@dataclass(frozen=True, eq=False)
class Needles:
    """Readings of a pendulum.

    Attributes:
        pendulum: its name.
        images: (n,) images that were taken at the same time by the camera that carries it.
        angles: (n,) radians, from x towards y of the pendulum to the downward vertical in its plane.
        sigmas: (n,) radians.
    """

    pendulum: str
    images: tuple[str, ...]
    angles: FloatArray
    sigmas: FloatArray

    def __post_init__(self) -> None:
        angles, sigmas = _readings(f"pendulum {self.pendulum}", len(self.images), self.angles, self.sigmas)
        object.__setattr__(self, "angles", angles)
        object.__setattr__(self, "sigmas", sigmas)


def _readings(what: str, n: int, angles: ArrayLike, sigmas: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """(n,) angles and their sigmas.

    Raises:
        InputError: an angle is not finite, or a sigma not positive.
    """
    found, spread = (
        np.array(np.broadcast_to(np.asarray(given, np.float64), (n,))) for given in (angles, sigmas)
    )
    if not np.isfinite(found).all() or not ((spread > 0.0) & np.isfinite(spread)).all():
        raise InputError(f"{what}: readings must be finite, and sigmas positive")
    return found, spread


@dataclass(frozen=True, eq=False)
class Inclinations:
    """Readings of a clinometer.

    Attributes:
        clinometer: its name.
        images: (n,) images that were taken at the same time by the camera that carries it.
        angles: (n,) radians, positive where the axis points above the horizon.
        sigmas: (n,) radians.
    """

    clinometer: str
    images: tuple[str, ...]
    angles: FloatArray
    sigmas: FloatArray

    def __post_init__(self) -> None:
        what = f"clinometer {self.clinometer}"
        angles, sigmas = _readings(what, len(self.images), self.angles, self.sigmas)
        object.__setattr__(self, "angles", angles)
        object.__setattr__(self, "sigmas", sigmas)
        steep = np.flatnonzero(np.abs(self.angles) > STEEPEST)
        if steep.size:
            raise InputError(
                f"clinometer {self.clinometer}, image {self.images[steep[0]]}: an inclination of "
                f"{np.degrees(self.angles[steep[0]]):g} degrees; its equation is one of sines, and says "
                "nothing near the vertical (angles are in radians here)"
            )
