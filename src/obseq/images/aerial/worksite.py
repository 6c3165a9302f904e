"""A worksite: shots, cameras, the map they are on; from images to the ground and back.

In the exact computation everything happens in geocentric coordinates: a shot is a centre and a rotation
there, and a local frame (`obseq.images.aerial.frames`) only says how to write the result. In the approximate
frame each computation has a frame of its own, centred on the shot or on the mean of the shots.

A z of type altitude is used as if it were ellipsoidal, as Borea does (about a centimetre of effect over a
geoid of 50 m): work in heights where that counts.
"""

from __future__ import annotations

import logging
from dataclasses import field, replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.images.aerial.frames import ApproximateFrames, LocalFrames, turned
from obseq.images.aerial.heights import HeightType, convert_heights, remove_alteration

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from obseq.arrays import BoolArray, FloatArray, IntArray
    from obseq.images.aerial.frames import Frames
    from obseq.images.aerial.heights import Geoid
    from obseq.images.aerial.mapping import MapSystem
    from obseq.images.aerial.shots import FrameCamera, Shots
    from obseq.images.aerial.surfaces import Surface


_log = logging.getLogger(__name__)
GROUND_STEPS = 50
"""Steps from the ray to the ground at most; over real ground three to ten are taken."""
GROUND_PRECISION = 1e-6
"""The ground is met when the last step changed the height by less (m)."""


@dataclass(frozen=True)
class Worksite:
    """Shots on a map.

    Attributes:
        shots: the images.
        cameras: by name.
        system: the map; None for work in the approximate frame without a coordinate system.
        geoid: joins altitudes and heights; needed only where both occur.
        is_approximate: whether to compute in the approximate frame, which keeps the linear alteration.
    """

    shots: Shots
    cameras: Mapping[str, FrameCamera]
    system: MapSystem | None
    geoid: Geoid | None = None
    is_approximate: bool = False
    _intrinsics: FloatArray = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.system is None and not self.is_approximate:
            raise InputError("a worksite needs its map (a projected CRS), or the approximate frame.")
        object.__setattr__(self, "_intrinsics", _intrinsics(self.shots, self.cameras))

    def approximately(self) -> Worksite:
        """The worksite computed in approximate frames."""
        return replace(self, is_approximate=True)

    def with_nadir(self, surface: Surface) -> Worksite:
        """The worksite with the z of the ground on the axis of each shot, in the type of the shots."""
        rows = np.arange(len(self.shots))
        bare = replace(self, shots=replace(self.shots, has_alteration=False))
        ground = bare.image_to_world(rows, self._intrinsics[:, :2], surface, self.shots.height_type)
        return replace(self, shots=self.shots.with_nadir(ground[:, 2]))

    def positions(self, wanted: HeightType | None, *, keep_alteration: bool = False) -> FloatArray:
        """Positions (n, 3) of the shots as computations use them: alteration removed, z of the wanted type.

        A missing ground under a shot whose z carries the alteration is logged, and its z left as it is.
        """
        moved = self.shots.positions.copy()
        if self.shots.has_alteration and not keep_alteration:
            moved[:, 2] = self._without_alteration()
        moved[:, 2] = self._converted(moved, self.shots.height_type, wanted)
        return moved

    def centres_and_matrices(self, wanted: HeightType | None) -> tuple[FloatArray, FloatArray]:
        """Geocentric centres (n, 3), and rotations (n, 3, 3) from geocentric axes to the images."""
        system = self.map
        matrices = self.shots.matrices @ system.axes(self.shots.positions[:, :2])
        return system.geocentric(self.positions(wanted)), matrices

    def frames(self, centres: FloatArray) -> Frames:
        """Euclidean frames centred on map points (n, 2)."""
        return ApproximateFrames(centres) if self.is_approximate else LocalFrames(self.map, centres)

    def directions(self, shots: IntArray, pixels: FloatArray) -> FloatArray:
        """Directions (n, 3) of rays in image axes: focal units, forward positive."""
        inner = self._intrinsics[shots]
        return np.column_stack([pixels - inner[:, :2], inner[:, 2]])

    def rows(self, names: Iterable[str]) -> IntArray:
        """Rows of shots by name."""
        return self.shots.index(names)

    def contains(self, shots: IntArray, pixels: FloatArray) -> BoolArray:
        """Whether pixels (n, 2) lie in their images; cameras without size have no border."""
        sizes = [self.cameras[name].size or (np.inf, np.inf) for name in self.shots.cameras]
        size = np.array(sizes, dtype=np.float64).reshape(-1, 2)[shots]
        with np.errstate(invalid="ignore"):
            return np.asarray(((pixels >= 0.0) & (pixels <= size)).all(axis=1))

    def world_to_image(
        self, shots: IntArray, points: FloatArray, height_type: HeightType | None = None
    ) -> FloatArray:
        """Pixels (n, 2), column and line, of map points (n, 3) in shots (n,); nan behind the camera.

        Args:
            shots: row of the shot of each point.
            points: map coordinates and z of `height_type`.
            height_type: type of z; None is the type of the shots.
        """
        wanted = height_type or self.shots.height_type
        if self.is_approximate:
            if not self.shots.has_alteration:
                raise InputError("the approximate frame is for shots whose z carries the linear alteration.")
            frames = ApproximateFrames(self.shots.positions[shots, :2])
            centres = frames.to_euclidean(self.positions(wanted, keep_alteration=True)[shots])
            sight = turned(self.shots.matrices[shots], frames.to_euclidean(points) - centres)
        else:
            centres, matrices = self.centres_and_matrices(wanted)
            sight = turned(matrices[shots], self.map.geocentric(points) - centres[shots])
        return project(sight, self._intrinsics[shots])

    def image_to_world(
        self,
        shots: IntArray,
        pixels: FloatArray,
        surface: Surface,
        height_type: HeightType | None = None,
    ) -> FloatArray:
        """Map points (n, 3) where rays of pixels (n, 2) meet a surface; nan where they do not.

        The point of the ray whose z in the world is that of the surface, at any distance from the nadir.
        z comes out in `height_type`, or in the type of the surface.
        """
        ground = surface.height_type or self.shots.height_type
        centres, rays, frames = self._rays(shots, pixels, ground)
        found = _meet(centres, rays, frames, surface, self.shots.positions[shots, :2])
        wanted = height_type or ground
        met = np.isfinite(found).all(axis=1)
        found[met, 2] = self._converted(found[met], ground, wanted)
        return found

    def _rays(
        self, shots: IntArray, pixels: FloatArray, wanted: HeightType | None
    ) -> tuple[FloatArray, FloatArray, Frames]:
        """Centres and directions (n, 3) in a frame centred on the shot of each row."""
        frames = self.frames(self.shots.positions[shots, :2])
        keep = self.is_approximate
        centres = frames.to_euclidean(self.positions(wanted, keep_alteration=keep)[shots])
        turn = frames.to_frame(self.shots.matrices[shots], self.shots.positions[shots, :2])
        return centres, turned(np.swapaxes(turn, -1, -2), self.directions(shots, pixels)), frames

    def _without_alteration(self) -> FloatArray:
        z, nadir = self.shots.positions[:, 2], self.shots.nadir
        known = np.zeros(len(z), dtype=bool) if nadir is None else np.isfinite(nadir)
        if nadir is None or not known.all():
            _log.warning(
                "%d shots carry the linear alteration over unknown ground (no terrain model): "
                "their z is used as it is",
                int((~known).sum()),
            )
        if nadir is None or not known.any():
            return z
        alteration = self.map.alteration(self.shots.positions[:, :2])
        return np.where(known, remove_alteration(z, alteration, nadir), z)

    def _converted(
        self, points: FloatArray, given: HeightType | None, wanted: HeightType | None
    ) -> FloatArray:
        if given is None or wanted is None or given is wanted:
            return points[:, 2]
        return convert_heights(points[:, 2], points[:, :2], given, wanted, self.map, self.geoid)

    @property
    def map(self) -> MapSystem:
        """The map.

        Raises:
            InputError: if there is none.
        """
        if self.system is None:
            raise InputError("this needs the map of the worksite: give its projected CRS, such as EPSG:2154.")
        return self.system


def project(sight: FloatArray, intrinsics: FloatArray) -> FloatArray:
    """Pixels (n, 2) of vectors (n, 3) in image axes; nan for points that are not in front.

    Args:
        sight: from the projection centre to the points.
        intrinsics: (n, 3) principal column and line, focal.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels = intrinsics[:, :2] + intrinsics[:, 2:] * sight[:, :2] / sight[:, 2:]
    pixels[~(sight[:, 2] > 0.0)] = np.nan
    return pixels


def _intrinsics(shots: Shots, cameras: Mapping[str, FrameCamera]) -> FloatArray:
    """(n, 3) principal column and line, focal, of each shot."""
    rows = []
    for shot, name in zip(shots.names, shots.cameras, strict=True):
        if name not in cameras:
            raise InputError(
                f"shot {shot}: its camera {name} is unknown; the cameras are {', '.join(cameras)}."
            )
        camera = cameras[name]
        rows.append((*camera.principal_point, camera.focal))
    return np.array(rows, dtype=np.float64).reshape(-1, 3)


def _meet(
    centres: FloatArray, rays: FloatArray, frames: Frames, surface: Surface, below: FloatArray
) -> FloatArray:
    """Map points where rays meet the surface: from the height under the shot, step by step; nan where not."""
    z = surface.z(below)
    down = rays[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = (z - centres[:, 2]) / down
        for _ in range(GROUND_STEPS):
            found = frames.to_map(centres + reach[:, None] * rays)
            left = surface.z(found[:, :2]) - found[:, 2]
            reach = reach + left / down
            if not (np.abs(left) > GROUND_PRECISION).any():
                break
    lost = ~(np.abs(left) <= GROUND_PRECISION) | ~(reach > 0.0)
    found[lost] = np.nan
    return found
