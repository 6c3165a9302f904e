"""What else a block knows of its images and points: antennas, shutters that roll, check points."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import field

import numpy as np
from numpy.typing import ArrayLike

from obseq.arguments import expecting, instance
from obseq.arrays import BoolArray, FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError, RowError
from obseq.images.control import ControlPoints
from obseq.images.names import are_among, index_of, rows_of, sigmas_of, unique_names
from obseq.leastsquares.problem.arguments import finite, real


@dataclass(frozen=True, eq=False)
class Antenna:
    """Positions of the antenna of a satellite receiver that a camera carries.

    Attributes:
        name: of the receiver.
        images: (n,) names.
        positions: (n, 3) observed, in the frame of the block.
        sigmas: (n, 3); infinite where nothing is observed.
        lever_arm: (3,) from the projection centre to the antenna, in the frame of the camera (x right, y
            down, z forward); where it is unknown, a first value.
        lever_sigmas: (3,) 0: held; infinite: unknown; else observed with this sigma.
    """

    name: str
    images: tuple[str, ...]
    positions: FloatArray
    sigmas: FloatArray
    lever_arm: FloatArray
    lever_sigmas: FloatArray

    @property
    def is_central(self) -> bool:
        """Whether the antenna is the projection centre itself."""
        return not (self.lever_arm.any() or self.lever_sigmas.any())

    def of(self, images: Collection[str]) -> Antenna:
        """That of some images."""
        return self._rows(are_among(self.images, images))

    def _rows(self, kept: BoolArray) -> Antenna:
        names = tuple(name for name, keep in zip(self.images, kept.tolist(), strict=True) if keep)
        observed = self.positions[kept], self.sigmas[kept]
        return Antenna(self.name, names, *observed, self.lever_arm, self.lever_sigmas)

    def centres(self, rotations: FloatArray) -> FloatArray:
        """(n, 3) projection centres, of images turned so (n, 3, 3), where the lever arm is as given."""
        return np.asarray(self.positions - rotations @ self.lever_arm)


@dataclass(frozen=True, eq=False)
class Shutter:
    """A shutter that rolls: the lines of an image are exposed one after the other, while the camera moves.

    Attributes:
        name: of the camera.
        images: (n,) names.
        velocities: (n, 3) of the camera in the world, units of the world per second.
        readout: seconds from the first line to the last; where it is unknown, a first value.
        sigma: of it: 0 held; infinite: unknown; else observed with this sigma.
    """

    name: str
    images: tuple[str, ...]
    velocities: FloatArray
    readout: float
    sigma: float


@dataclass(eq=False)
class References:
    """What a block knows beside cameras, poses and measures.

    `check_points` are known points that take no part as such: their coordinates are compared with the result.
    `frame` is the definition of the frame of the block, and `system` that of the coordinates that the user
    gave, where these are on the Earth; else empty. `models` are what the program of a block calls the models
    of its cameras.
    """

    check_points: ControlPoints = field(default_factory=lambda: ControlPoints.of([], np.zeros((0, 3))))
    antennas: list[Antenna] = field(default_factory=list)
    shutters: list[Shutter] = field(default_factory=list)
    frame: str = ""
    system: str = ""
    models: dict[str, str] = field(default_factory=dict)

    @expecting(control=instance(ControlPoints))
    def add_check_points(self, control: ControlPoints) -> None:
        """Adds points that check the result.

        Raises:
            InputError: a name is there already.
        """
        twice = np.flatnonzero(are_among(control.names, self.check_points.names))
        if twice.size:
            raise RowError(f"check point {control.names[twice[0]]!r} is given twice", int(twice[0]))
        self.check_points = ControlPoints(
            self.check_points.names + control.names,
            np.concatenate([self.check_points.coordinates, control.coordinates]),
            np.concatenate([self.check_points.covariances, control.covariances]),
        )

    def observe_antenna(
        self,
        images: Sequence[str],
        positions: ArrayLike,
        sigmas: ArrayLike,
        lever_arm: ArrayLike = (0.0, 0.0, 0.0),
        lever_sigmas: ArrayLike = 0.0,
        name: str = "GNSS",
    ) -> None:
        """Adds observed positions of the antenna of a receiver; images without measures do without them.

        Args:
            images: (n,) names.
            positions: (n, 3).
            sigmas: one number, (n,) or (n, 3); infinite where a component is not observed.
            lever_arm: from the projection centre to the antenna, in the frame of the camera.
            lever_sigmas: a number or (3,): 0 holds it, infinity leaves it unknown.
            name: of the receiver.

        Raises:
            InputError: a number is missing; a lever arm goes with positions of less than three components.
        """
        names = unique_names(images, f"antenna {name}: image")
        if name in (antenna.name for antenna in self.antennas):
            raise InputError(f"antenna {name!r} is given twice")
        where = rows_of(positions, len(names), 3, f"antenna {name}: positions")
        spread = sigmas_of(sigmas, len(names), 3, f"antenna {name}: sigmas")
        wrong = np.flatnonzero(~(np.isfinite(where) & (spread > 0.0)).all(axis=1))
        if wrong.size:
            image = names[wrong[0]]
            raise RowError(
                f"antenna {name}: image {image}: positions are finite, with sigmas above zero", int(wrong[0])
            )
        lever = finite(lever_arm, (3,), f"antenna {name}: lever arm")
        given = real(lever_sigmas, f"antenna {name}: sigmas of the lever arm")
        own = sigmas_of(given if given.ndim == 0 else given[None], 1, 3, f"antenna {name}: lever arm")[0]
        if not (own >= 0.0).all():
            raise InputError(f"antenna {name}: sigmas of the lever arm are 0 or more, not {own.tolist()}")
        found = Antenna(name, names, where, spread, lever, own)
        if not (found.is_central or np.isfinite(spread).all()):
            raise InputError(
                f"antenna {name}: with a lever arm all three components of a position are observed; give "
                "large sigmas to those that are not"
            )
        self.antennas.append(found)

    def roll_shutter(
        self,
        camera: str,
        images: Sequence[str],
        velocities: ArrayLike,
        readout: float = 0.0,
        sigma: float = np.inf,
    ) -> None:
        """Says that the lines of images are exposed one after the other, at velocities of the camera.

        Args:
            camera: their camera: one readout for all.
            images: (n,) names.
            velocities: (n, 3) in the world, its unit per second.
            readout: seconds from the first line to the last.
            sigma: of it: 0 holds it, infinity leaves it unknown.

        Raises:
            InputError: a velocity is not finite, or a sigma below zero.
        """
        names = unique_names(images, f"shutter of {camera}: image")
        moving = rows_of(velocities, len(names), 3, f"shutter of {camera}: velocities")
        if not (np.isfinite(moving).all() and np.isfinite(readout) and sigma >= 0.0):
            raise InputError(
                f"shutter of {camera}: velocities and readout are finite, its sigma is 0 or more"
            )
        if camera in (shutter.name for shutter in self.shutters):
            raise InputError(f"shutter of {camera} is given twice")
        self.shutters.append(Shutter(camera, names, moving, float(readout), float(sigma)))


def velocities_of(images: Sequence[str], positions: FloatArray, times: FloatArray) -> FloatArray:
    """(n, 3) velocities along a flight: central differences of positions (n, 3) at times (n,), seconds.

    Raises:
        InputError: there are less than two images, or two of them have one time.
    """
    index_of(images, images, "flight: image")
    order = np.argsort(times, kind="stable")
    if len(order) < 2 or not (np.diff(times[order]) > 0.0).all():
        raise InputError("velocities take two images or more, of different times")
    found = np.empty_like(positions)
    found[order] = np.gradient(positions[order], times[order], axis=0)
    return found
