"""What a solution says of antennas, rolling shutters and check points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.images.names import index_of

if TYPE_CHECKING:
    from obseq.arrays import FloatArray
    from obseq.images.adjustment.equations import Equations
    from obseq.images.adjustment.reference_equations import AntennaEquations
    from obseq.images.adjustment.start import Start
    from obseq.images.block import Block
    from obseq.images.poses import Poses
    from obseq.leastsquares import LeastSquaresResult


@dataclass(frozen=True, eq=False)
class CheckResiduals:
    """Check points, compared with what was adjusted.

    Attributes:
        names: (n,) those that the adjustment has determined.
        differences: (n, 3) adjusted minus given.
        covariances: (n, 3, 3) of the differences: of the given coordinates, and of the adjusted ones where
            there are precisions.
        unmeasured: names of the others.
    """

    names: tuple[str, ...]
    differences: FloatArray
    covariances: FloatArray
    unmeasured: tuple[str, ...]

    @property
    def sigmas(self) -> FloatArray:
        """(n, 3) of the differences."""
        return np.sqrt(np.diagonal(self.covariances, axis1=1, axis2=2))


class Referenced:
    """The part of a solution that is about references of images and points."""

    if TYPE_CHECKING:  # the solution has them
        block: Block
        start: Start
        equations: Equations
        result: LeastSquaresResult

        @property
        def coordinates(self) -> FloatArray:  # noqa: D102
            ...

        @property
        def point_covariances(self) -> FloatArray:  # noqa: D102
            ...

        @property
        def poses(self) -> Poses:  # noqa: D102
            ...

        @property
        def is_a_posteriori(self) -> bool:  # noqa: D102
            ...

    def lever_arm(self, name: str = "GNSS") -> tuple[FloatArray, FloatArray]:
        """(3,) adjusted lever arm of an antenna in the camera frame, and (3,) its precision; 0 where held."""
        known = [part.antenna.name for part in self.equations.antennas]
        part = self.equations.antennas[int(index_of(known, [name], "antenna")[0])]
        if not part.lever.size:
            return part.antenna.lever_arm, np.zeros(3)
        covariance = self.result.covariance(part.lever, not self.is_a_posteriori)[0]
        return self.lever_value(part), np.sqrt(np.diagonal(covariance))

    def lever_value(self, part: AntennaEquations) -> FloatArray:
        """(3,) adjusted lever arm."""
        return self.result.values(part.lever)[0] if part.lever.size else part.antenna.lever_arm

    def antenna_residuals(self, name: str = "GNSS") -> tuple[tuple[str, ...], FloatArray]:
        """Images, and (n, 3) adjusted minus observed positions of an antenna."""
        known = [part.antenna.name for part in self.equations.antennas]
        part = self.equations.antennas[int(index_of(known, [name], "antenna")[0])]
        places = self.poses.centres[part.rows] + self.poses.rotations[part.rows] @ self.lever_value(part)
        return part.antenna.images, places - part.antenna.positions

    def readout(self, camera: str) -> tuple[float, float]:
        """Adjusted readout of a rolling shutter, seconds, and its precision; 0 where held."""
        known = [part.shutter.name for part in self.equations.shutters]
        part = self.equations.shutters[int(index_of(known, [camera], "shutter")[0])]
        variance = self.result.covariance(part.readout, not self.is_a_posteriori)[0, 0, 0]
        return float(self.result.values(part.readout)[0, 0]), float(np.sqrt(variance))

    def check_residuals(self) -> CheckResiduals:
        """How the result agrees with the check points."""
        given = self.block.check_points
        place = {name: row for row, name in enumerate(self.start.points)}
        known = [name for name in given.names if name in place]
        found, rows = given.select(known), [place[name] for name in known]
        covariances = found.covariances.copy()
        if self.result.has_covariances and rows:
            covariances = covariances + self.point_covariances[rows]
        lost = tuple(name for name in given.names if name not in place)
        return CheckResiduals(found.names, self.coordinates[rows] - found.coordinates, covariances, lost)
