"""What the observations of a block should have been, where the rest of them says so."""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.images.camera import Camera
from obseq.images.causes.numbering import Numbering
from obseq.images.poses import Poses


@dataclass(frozen=True, eq=False)
class Evidence:
    """A block at a place.

    Attributes:
        numbering: of its equations.
        poses: of its images.
        cameras: of its images.
        coordinates: (n, 3) of its points.
    """

    numbering: Numbering
    poses: Poses
    cameras: list[Camera]
    coordinates: FloatArray

    @classmethod
    def of(cls, numbering: Numbering) -> Evidence:
        """A block where its unknowns are."""
        equations, system = numbering.equations, numbering.equations.system
        start = equations.start
        blocks = dict(zip(equations.cameras, equations.calibrations.tolist(), strict=True))
        adjusted = {
            camera.name: camera.with_parameters(system.values([blocks[camera.name]])[0])
            for camera in {camera.name: camera for camera in start.cameras}.values()
        }
        return cls(
            numbering,
            Poses(
                start.poses.images,
                system.values(equations.centres),
                system.values(equations.rotations),
                start.poses.cameras,
            ),
            [adjusted[camera.name] for camera in start.cameras],
            system.values(equations.points),
        )

    def pixels(self, image: int, points: IntArray | None = None) -> FloatArray:
        """(k, 2) where points are in an image; NaN where it does not see them."""
        camera = self.cameras[image]
        places = self.coordinates if points is None else self.coordinates[points]
        local = self.poses[self.poses.images[image]].to_local(places)
        found = np.full((len(local), 2), np.nan)
        seen = camera.sees(local)
        found[seen] = camera.project(local[seen])
        return found

    def written(self, measures: IntArray) -> tuple[FloatArray, FloatArray]:
        """(k, 2) image points as they are given, and their sigmas."""
        sets, numbering = self.numbering.equations.start.sets, self.numbering
        pairs = list(zip(numbering.part[measures].tolist(), numbering.row[measures].tolist(), strict=True))
        xy = [sets[part].given.measures.xy[row] for part, row in pairs]
        sigmas = [sets[part].given.measures.sigmas[row] for part, row in pairs]
        return np.array(xy).reshape(-1, 2), np.array(sigmas).reshape(-1, 2)

    def of_image(self, image: int) -> IntArray:
        """Image points of an image that take part."""
        return np.flatnonzero(self.numbering.kept & (self.numbering.image == image))
