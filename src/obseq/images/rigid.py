"""Rigid blocks: cameras that are fixed to one another and exposed together.

The pose of a camera in its block takes its frame to that of the block, which is the frame of the master.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.geometry import RigidMotion, closest_rotation, logarithm
from obseq.images.names import index_of, numbered, unique_names
from obseq.images.poses import Poses

Sigmas = tuple[float, float]
"""Of a translation per coordinate (unit of the world), and of a rotation per axis (radians)."""
Gauge = tuple[float | None, float | None]
"""The same, where None stands for what is held."""
GROSS = 4.0
"""An exposure that is off by this many times the typical scatter does not fit the block."""


@dataclass(frozen=True, eq=False)
class Exposures:
    """Which images were taken together, by which camera of a block.

    Attributes:
        cameras: (k,) identifiers of the cameras in the block.
        names: (e,) identifiers of the exposures.
        images: (m,) names of images.
        camera: (m,) camera of each, a position in `cameras`.
        exposure: (m,) exposure of each, a position in `names`.
        others: images that the pattern does not match.
    """

    cameras: tuple[str, ...]
    names: tuple[str, ...]
    images: tuple[str, ...]
    camera: IntArray
    exposure: IntArray
    others: tuple[str, ...] = ()

    @classmethod
    def of(
        cls, images: Sequence[str], pattern: str, camera_group: int = 1, exposure_group: int = 2
    ) -> Exposures:
        """The exposures that a pattern sees in image names.

        Args:
            images: names.
            pattern: regular expression that matches a whole name, `(.*)_(.*).tif`.
            camera_group: number of the group that is the camera of the block.
            exposure_group: number of the group that is the exposure.

        Raises:
            InputError: the pattern is no expression, has not these groups, or gives two images the same pair.
        """
        try:
            expression = re.compile(pattern)
        except re.error as error:
            raise InputError(f"{pattern!r} is not a regular expression: {error}") from None
        if max(camera_group, exposure_group) > expression.groups:
            raise InputError(
                f"{pattern!r} has {expression.groups} groups in parentheses; camera and exposure are said to "
                f"be groups {camera_group} and {exposure_group}"
            )
        found = {image: expression.fullmatch(image) for image in images}
        pairs = {
            image: (match[camera_group], match[exposure_group]) for image, match in found.items() if match
        }
        unique_names([f"{camera}, {exposure}" for camera, exposure in pairs.values()], "camera and exposure")
        cameras, camera = numbered([pair[0] for pair in pairs.values()])
        names, exposure = numbered([pair[1] for pair in pairs.values()])
        others = tuple(image for image, match in found.items() if match is None)
        return cls(cameras, names, tuple(pairs), camera, exposure, others)

    def pairs(self, first: int, second: int) -> tuple[IntArray, IntArray, IntArray]:
        """Rows of the images of two cameras that were exposed together, and the exposures."""
        row = self._rows()
        both = np.flatnonzero((row[first] >= 0) & (row[second] >= 0))
        return row[first, both], row[second, both], both

    def missing(self, first: int, second: int) -> tuple[tuple[str, str], ...]:
        """Exposures with an image of only one of two cameras, and the camera that has none."""
        there = self._rows()[[first, second]] >= 0
        cameras = self.cameras[second], self.cameras[first]
        alone = np.flatnonzero(there[0] != there[1]).tolist()
        return tuple((self.names[k], cameras[int(there[1, k])]) for k in alone)

    def _rows(self) -> IntArray:
        """(cameras, exposures) rows of the images; -1 where there is none."""
        row = np.full((len(self.cameras), len(self.names)), -1, dtype=np.int64)
        row[self.camera, self.exposure] = np.arange(len(self.images))
        return row


@dataclass(frozen=True, eq=False)
class PairStatistics:
    """How constant the pose of one camera is in the frame of another.

    Attributes:
        first: identifier of the camera whose frame it is.
        second: identifier of the other.
        exposures: (n,) identifiers of the exposures that have both.
        translations: (n, 3) of the second in the frame of the first.
        rotations: (n, 3, 3).
        mean: mean translation, and rotation closest to the mean matrix.
        sigma_translation: square root of the mean squared distance to the mean (n - 1); NaN for one exposure.
        sigma_rotation: the same for the Frobenius norm of the difference of matrices (MMVII's; about
            sqrt(2) times an angle).
        fits: (n,) False for exposures that are off by far more than the others.
        missing: exposures that have an image of only one of the two, and the camera that has none.
    """

    first: str
    second: str
    exposures: tuple[str, ...]
    translations: FloatArray
    rotations: FloatArray
    mean: RigidMotion
    sigma_translation: float
    sigma_rotation: float
    fits: BoolArray
    missing: tuple[tuple[str, str], ...] = ()

    @property
    def sigmas(self) -> Sigmas:
        """Scatter of the translation per coordinate, and of the rotation per axis (radians)."""
        return self.sigma_translation / np.sqrt(3.0), self.sigma_rotation / np.sqrt(6.0)

    @property
    def misfits(self) -> tuple[str, ...]:
        """The exposures that do not fit."""
        return tuple(np.array(self.exposures, dtype=object)[~self.fits])


@dataclass(frozen=True, eq=False)
class RigidBlock:
    """Cameras fixed to one another, and how firmly.

    Attributes:
        name: of the block.
        master: identifier of the camera whose frame is that of the block.
        exposures: which images were taken together.
        places: poses of the cameras in the block, named by their identifiers.
        sigma_translation: of a relative translation, per coordinate, in the unit of the world.
        sigma_rotation: of a relative rotation, per axis, radians.
        is_fixed: True when the places are known exactly.
        place_sigmas: (translation, rotation) of the places as given, when they are observations, for all
            cameras or by camera; None when they are free.
        master_sigmas: (translation, rotation) of the place of the master, where it is not held (a soft
            gauge), besides those of `place_sigmas`. None for one of them: it is held.
        pair_sigmas: (translation, rotation) of the pairs of cameras that are observed, where each has its
            own (MMVII's instrument blocks); None: every camera with the master, with the sigmas above.
        is_exact: True where the sigmas stand for exactness; unknown places say nothing of scale then.
        as_matrices: True for MMVII's twelve equations of a pair, nine of them the entries of a matrix, which
            count three degrees of freedom nine times; six equations otherwise. The weight is the same.
    """

    name: str
    master: str
    exposures: Exposures
    places: Poses
    sigma_translation: float
    sigma_rotation: float
    is_fixed: bool = False
    place_sigmas: Sigmas | Mapping[str, Sigmas] | None = None
    master_sigmas: Gauge | None = None
    pair_sigmas: Mapping[tuple[str, str], Sigmas] | None = None
    as_matrices: bool = False
    is_exact: bool = False

    @property
    def has_scale(self) -> bool:
        """Whether it says how long the unit of the world is: places that are known do, and sigmas do."""
        return self.is_fixed or bool(self.observed_places) or not self.is_exact

    def __post_init__(self) -> None:
        index_of(self.places.images, [self.master, *self.exposures.cameras], f"block {self.name}: camera")
        for first, second in self.pair_sigmas or ():
            index_of(self.places.images, [first, second], f"block {self.name}: pair of camera")
        own = (self.sigma_translation, self.sigma_rotation)
        places = (*self.observed_places.values(), *self.soft_gauge.values())
        every = (own, *places, *self.pairs.values())
        for sigma in (sigma for sigmas in every for sigma in sigmas):
            if sigma is not None and not (np.isfinite(sigma) and sigma > 0.0):
                raise InputError(f"block {self.name}: a sigma must be positive, not {sigma}")

    @property
    def pairs(self) -> dict[tuple[str, str], Sigmas]:
        """The pairs of cameras whose relative pose is observed at every exposure, and its sigmas."""
        if self.pair_sigmas is not None:
            return dict(self.pair_sigmas)
        own = (self.sigma_translation, self.sigma_rotation)
        return {(self.master, camera): own for camera in self.exposures.cameras if camera != self.master}

    @property
    def gauge(self) -> Gauge:
        """The sigmas of the place of the master; None for what is held."""
        return self.master_sigmas or (None, None)

    @property
    def soft_gauge(self) -> dict[str, Gauge]:
        """The sigmas of the place of the master, by its name; nothing where it is held."""
        return {} if self.gauge == (None, None) else {self.master: self.gauge}

    @property
    def observed_places(self) -> dict[str, Gauge]:
        """The cameras whose places are observed, and the sigmas; None for what is held."""
        given = self.place_sigmas or {}
        if not isinstance(given, Mapping):
            given = dict.fromkeys(self.places.images, given)
        own = {self.master: self._unheld(given[self.master])} if self.master in given else {}
        return {camera: sigmas for camera, sigmas in {**given, **own}.items() if sigmas != (None, None)}

    def _unheld(self, sigmas: Sigmas) -> Gauge:
        """The sigmas of the place of the master where a soft gauge does not hold it; None elsewhere."""
        translation, rotation = (
            None if gauge is None else own for gauge, own in zip(self.gauge, sigmas, strict=True)
        )
        return translation, rotation


def pair_statistics(poses: Poses, exposures: Exposures, first: str, second: str) -> PairStatistics:
    """The relative poses of two cameras over the exposures that have both.

    Raises:
        InputError: no exposure has both, or an image has no pose.
    """
    a, b = index_of(exposures.cameras, [first, second], "block: camera")
    rows_a, rows_b, common = exposures.pairs(int(a), int(b))
    if not common.size:
        raise InputError(f"block: no exposure has both camera {first} and camera {second}")
    images = [exposures.images[row] for row in (*rows_a, *rows_b)]
    both = poses.select(images).motions
    n = len(common)
    relative = RigidMotion(both.centre[n:], both.rotation[n:]).relative_to(
        RigidMotion(both.centre[:n], both.rotation[:n])
    )
    mean = RigidMotion(relative.centre.mean(axis=0), closest_rotation(relative.rotation.mean(axis=0)))
    shifts = np.linalg.norm(relative.centre - mean.centre, axis=1)
    turns = np.linalg.norm(relative.rotation - mean.rotation, axis=(1, 2))
    return PairStatistics(
        first,
        second,
        tuple(exposures.names[k] for k in common),
        relative.centre,
        relative.rotation,
        mean,
        _standard_deviation(shifts),
        _standard_deviation(turns),
        _fitting(relative),
        exposures.missing(int(a), int(b)),
    )


def _standard_deviation(distances: FloatArray) -> float:
    """Of what lies at these distances from its mean; NaN of a single one."""
    n = len(distances)
    return float(np.sqrt(np.sum(distances**2) / (n - 1))) if n > 1 else float("nan")


def _fitting(relative: RigidMotion) -> BoolArray:
    """(n,) exposures whose translation and rotation are near the medians, in units of their typical distance.

    Of two exposures nobody can say which one is off.
    """
    n = len(relative.centre)
    if n < 3:
        return np.ones(n, dtype=bool)
    middle = np.median(relative.centre, axis=0)
    shifts = np.linalg.norm(relative.centre - middle, axis=1)
    about = closest_rotation(np.median(relative.rotation, axis=0))
    turns = np.linalg.norm(logarithm(about.T @ relative.rotation), axis=1)
    near = [values <= GROSS * max(float(np.median(values)), 1e-12) for values in (shifts, turns)]
    return np.asarray(near[0] & near[1])


def initial_block(
    poses: Poses,
    exposures: Exposures,
    master: str | None = None,
    name: str = "TheBloc",
    sigma_translation: float | None = None,
    sigma_rotation: float | None = None,
    all_pairs: bool = False,
) -> tuple[RigidBlock, tuple[PairStatistics, ...]]:
    """A rigid block from poses that are known: the mean places of its cameras (MMVII's `BlockCamInit`).

    Args:
        poses: of the images.
        exposures: which images were taken together.
        master: identifier of the camera whose frame is that of the block; that of the first image when None.
        name: of the block.
        sigma_translation: of the block; the largest scatter of its pairs, per coordinate, when None.
        sigma_rotation: of the block, radians; the same.
        all_pairs: True to observe every pair of cameras with the scatter of its own (MMVII's
            `BlockInstrInitCam`), instead of every camera with the master.

    Returns:
        The block, and the statistics of its pairs, those with the master first.

    Raises:
        InputError: a camera has no exposure in common with the master.
    """
    known = [row for row, image in enumerate(exposures.images) if image in set(poses.images)]
    used = Exposures(
        exposures.cameras,
        exposures.names,
        tuple(exposures.images[row] for row in known),
        exposures.camera[known],
        exposures.exposure[known],
        exposures.others,
    )
    chief = master or used.cameras[0]
    pairs = tuple(pair_statistics(poses, used, chief, camera) for camera in used.cameras if camera != chief)
    places = Poses.of(
        [chief, *(pair.second for pair in pairs)],
        [np.zeros(3), *(pair.mean.centre for pair in pairs)],
        [np.eye(3), *(pair.mean.rotation for pair in pairs)],
    )
    translation = sigma_translation or _largest(pair.sigmas[0] for pair in pairs)
    rotation = sigma_rotation or _largest(pair.sigmas[1] for pair in pairs)
    block = RigidBlock(name, chief, used, places, translation, rotation)
    if not all_pairs:
        return block, pairs
    others = [camera for camera in used.cameras if camera != chief]
    pairs += tuple(pair_statistics(poses, used, a, b) for a, b in itertools.combinations(others, 2))
    sigmas = {(pair.first, pair.second): _finite(pair.sigmas, (translation, rotation)) for pair in pairs}
    return replace(block, pair_sigmas=sigmas), pairs


def _finite(sigmas: Sigmas, instead: Sigmas) -> Sigmas:
    """The sigmas of a pair, or those of the block where one exposure says nothing of the scatter."""
    chosen = [
        max(own, 1e-12) if np.isfinite(own) else other for own, other in zip(sigmas, instead, strict=True)
    ]
    return chosen[0], chosen[1]


def _largest(values: Iterable[float]) -> float:
    found = [value for value in values if np.isfinite(value)]
    if not found:
        raise InputError(
            "block: one exposure says nothing of how firm the block is; give sigma_translation and "
            "sigma_rotation"
        )
    return float(max(max(found), 1e-12))
