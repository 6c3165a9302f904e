"""Rigid blocks in the system of a block of images: places of cameras, pairs exposed together."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.geometry import RigidMotion, logarithm
from obseq.images.adjustment.start import LeftOut
from obseq.images.names import index_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from obseq.arrays import FloatArray, IntArray
    from obseq.images.poses import Poses
    from obseq.images.rigid import Gauge, RigidBlock
    from obseq.leastsquares import Batch, LeastSquares

GROUP = "rigid blocks"
MOST_NAMES = 5
ROTATION_ENTRIES = np.sqrt(2.0)
"""Sigma of the entries of a matrix over that of the angle: nine squares sum up to twice that of the angle."""


@dataclass(frozen=True, eq=False)
class Pairs:
    """Images that were exposed together, of pairs of cameras of a rigid block.

    Attributes:
        first: (n,) images of the first cameras.
        second: (n,) images of the second ones.
        cameras: (n, 2) their places in the block.
        exposures: (n,) names.
        sigmas: (n, 2) of translation and rotation.
        missing: what has no pair, and why.
    """

    first: IntArray
    second: IntArray
    cameras: IntArray
    exposures: tuple[str, ...]
    sigmas: FloatArray
    missing: tuple[LeftOut, ...]


@dataclass(frozen=True, eq=False)
class RigidResiduals:
    """Relative poses of the cameras of a rigid block, minus those of their places, an exposure a row.

    Attributes:
        cameras: (n,) identifiers of the two cameras.
        exposures: (n,) names.
        translations: (n, 3) in the frame of the first camera, in the unit of the world.
        rotations: (n, 3) rotation vectors, radians.
        sigmas: (n, 2) given, of translation and rotation, per coordinate.
    """

    cameras: tuple[tuple[str, str], ...]
    exposures: tuple[str, ...]
    translations: FloatArray
    rotations: FloatArray
    sigmas: FloatArray

    def scatter(self) -> dict[tuple[str, str], tuple[float, float]]:
        """By pair of cameras, the quadratic means per coordinate of translations and rotations."""
        squares = np.column_stack([np.mean(part**2, axis=1) for part in (self.translations, self.rotations)])
        found: dict[tuple[str, str], tuple[float, float]] = {}
        for pair in dict.fromkeys(self.cameras):
            rows = [k for k, other in enumerate(self.cameras) if other == pair]
            translation, rotation = np.sqrt(squares[rows].mean(axis=0)).tolist()
            found[pair] = translation, rotation
        return found


class RigidEquations:
    """A rigid block in a system.

    Attributes:
        block: the block.
        centres: (k,) blocks of unknowns of the places of its cameras.
        rotations: (k,) the same for their rotations.
        pairs: what was exposed together.
        batch: the equations of the pairs.
    """

    def __init__(
        self,
        system: LeastSquares,
        block: RigidBlock,
        images: Sequence[str],
        poses: tuple[IntArray, IntArray],
    ) -> None:
        self.block, self._system = block, system
        names = [f"{block.name} {camera}" for camera in block.places.images]
        self.centres = system.add_points([f"{name} place" for name in names], block.places.centres)
        self.rotations = system.add_rotations(names, block.places.rotations)
        self.pairs = pairs_of(block, images)
        self._hold()
        self._observe_places()
        self.batch = self._add_pairs(*poses)

    def _rows(self, cameras: Sequence[str]) -> IntArray:
        return index_of(self.block.places.images, cameras, f"block {self.block.name}: camera")

    def _hold(self) -> None:
        block, lone = self.block, _lone(self.block, self.pairs.cameras)
        for unknowns, sigma in zip((self.centres, self.rotations), block.gauge, strict=True):
            gauge = (block.master,) if sigma is None else ()
            fixed = block.places.images if block.is_fixed else gauge
            held = self._rows(list(dict.fromkeys([*fixed, *lone])))
            if held.size:
                self._system.freeze(unknowns[held])

    def _observe_places(self) -> None:
        """Places as they were given, and the soft gauge, which is an observation of its own."""
        if not self.block.is_fixed:
            for observed in (self.block.observed_places, self.block.soft_gauge):
                self._observe(observed)

    def _observe(self, observed: Mapping[str, Gauge]) -> None:
        places = self.block.places
        shifts = {camera: own[0] for camera, own in observed.items() if own[0] is not None}
        turns = {camera: own[1] for camera, own in observed.items() if own[1] is not None}
        if shifts:
            rows, sigmas = self._rows(list(shifts)), np.array(list(shifts.values()))[:, None]
            self._system.add_prior(
                self.centres[rows], places.centres[rows], np.repeat(sigmas, 3, axis=1), GROUP
            )
        if turns:
            rows, sigmas = self._rows(list(turns)), np.array(list(turns.values()))[:, None]
            attach_rotations(self._system, self.rotations[rows], places.rotations[rows], sigmas, GROUP)

    def _add_pairs(self, centres: IntArray, rotations: IntArray) -> Batch:
        pairs = self.pairs
        blocks = {
            "camera_a.centre": centres[pairs.first],
            "camera_a.rotation": rotations[pairs.first],
            "camera_b.centre": centres[pairs.second],
            "camera_b.rotation": rotations[pairs.second],
            "place_1.centre": self.centres[pairs.cameras[:, 0]],
            "place_1.rotation": self.rotations[pairs.cameras[:, 0]],
            "place_2.centre": self.centres[pairs.cameras[:, 1]],
            "place_2.rotation": self.rotations[pairs.cameras[:, 1]],
        }
        factor, turns = (ROTATION_ENTRIES, 9) if self.block.as_matrices else (1.0, 3)
        sigmas = np.repeat(pairs.sigmas * [1.0, factor], [3, turns], axis=1)
        names = np.array(self.block.places.images, dtype=object)[pairs.cameras]
        labels = [
            f"block {self.block.name}, exposure {exposure}, cameras {a} and {b}"
            for exposure, (a, b) in zip(pairs.exposures, names, strict=True)
        ]
        formula = "BlocRigid" if self.block.as_matrices else "RigidPair"
        return self._system.add(formula, blocks, None, sigmas, labels, GROUP)


def attach_rotations(
    system: LeastSquares, rotations: IntArray, known: FloatArray, sigmas: FloatArray | float, group: str
) -> Batch:
    """Observes rotations (n,) as known matrices (n, 3, 3), with sigmas per axis: a number or (n, 1)."""
    spread = np.broadcast_to(sigmas, (len(rotations), 3))
    return system.add("KnownRotation", {"rotation": rotations}, known.reshape(-1, 9), spread, None, group)


def pairs_of(block: RigidBlock, images: Sequence[str]) -> Pairs:
    """The pairs of images of a block that were exposed together; images that are not adjusted have none.

    Raises:
        InputError: there is none at all.
    """
    number = {image: k for k, image in enumerate(images)}
    exposures = block.exposures
    there = {
        (exposures.cameras[camera], exposures.names[exposure]): number[image]
        for image, camera, exposure in zip(
            exposures.images, exposures.camera.tolist(), exposures.exposure.tolist(), strict=True
        )
        if image in number
    }
    place = {camera: k for k, camera in enumerate(block.places.images)}
    rows, names, sigmas, missing = [], [], [], _outside(block)
    for (first, second), pair_sigmas in block.pairs.items():
        for exposure in exposures.names:
            ends = there.get((first, exposure)), there.get((second, exposure))
            if None not in ends:
                rows.append((*ends, place[first], place[second]))
                names.append(exposure)
                sigmas.append(pair_sigmas)
            elif ends != (None, None):
                missing.append(_missing(block, exposure, (first, second), ends))
    if not rows:
        raise InputError(f"block {block.name}: no exposure has the master and another camera")
    first_image, second_image, a, b = np.array(rows, dtype=np.int64).T
    cameras = np.column_stack([a, b])
    reason = "is in no exposure with another camera of the block: its place stays as it was given"
    missing += [
        LeftOut("camera", f"block {block.name}, camera {name}", reason) for name in _lone(block, cameras)
    ]
    return Pairs(first_image, second_image, cameras, tuple(names), np.array(sigmas), tuple(missing))


def _outside(block: RigidBlock) -> list[LeftOut]:
    others = block.exposures.others
    listed = ", ".join(others[:MOST_NAMES]) + (", ..." if len(others) > MOST_NAMES else "")
    reason = f"{len(others)} images are of none of its exposures: {listed}"
    return [LeftOut("images", f"block {block.name}", reason)] if others else []


def _lone(block: RigidBlock, cameras: IntArray) -> list[str]:
    """The cameras that no pair has, and whose places nothing observes."""
    used = set(cameras.ravel().tolist())
    names = enumerate(block.places.images)
    tied = block.observed_places.keys() | block.soft_gauge.keys()
    return [name for row, name in names if row not in used and name not in tied]


def _missing(
    block: RigidBlock, exposure: str, cameras: tuple[str, str], ends: tuple[int | None, int | None]
) -> LeftOut:
    absent = cameras[0] if ends[0] is None else cameras[1]
    pair = f"block {block.name}, exposure {exposure}, cameras {cameras[0]} and {cameras[1]}"
    return LeftOut("pair", pair, f"camera {absent} has no image that is adjusted")


def residuals_of(part: RigidEquations, poses: Poses, places: Poses) -> RigidResiduals:
    """How poses of images agree with the places of cameras in a rigid block."""
    pairs = part.pairs
    ends = [RigidMotion(poses.centres[k], poses.rotations[k]) for k in (pairs.first, pairs.second)]
    own = [RigidMotion(places.centres[k], places.rotations[k]) for k in pairs.cameras.T]
    found, fixed = ends[1].relative_to(ends[0]), own[1].relative_to(own[0])
    return RigidResiduals(
        tuple((places.images[a], places.images[b]) for a, b in pairs.cameras),
        pairs.exposures,
        found.centre - fixed.centre,
        logarithm(np.swapaxes(fixed.rotation, 1, 2) @ found.rotation),
        pairs.sigmas,
    )
