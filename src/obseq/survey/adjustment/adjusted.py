"""The adjusted network: points, stations, observations, and the record that is written to files."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from obseq.survey.model import ObservationType, Orientation

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from obseq.arrays import FloatArray
    from obseq.leastsquares import LeastSquaresResult
    from obseq.survey.initial.left_out import LeftOut
    from obseq.survey.model import FieldBook


FORMAT = "obseq-adjustment"
VERSION = 1


@dataclass(frozen=True, eq=False)
class AdjustedPoints:
    """Adjusted points, one row each.

    Attributes:
        names: Their names.
        coordinates: (n, 3) in the computation frame, m.
        covariances: (n, 3, 3) in the computation frame, m^2.
        crs_coordinates: (n, 3) in the system of the points.
        crs_precisions: (n, 3) m: along the axes of the system of the points when it is in metres, along
            east, north and up when it is geographic.
    """

    names: tuple[str, ...]
    coordinates: FloatArray
    covariances: FloatArray
    crs_coordinates: FloatArray
    crs_precisions: FloatArray

    @property
    def precisions(self) -> FloatArray:
        """(n, 3) standard deviations in the computation frame, m."""
        return np.sqrt(np.diagonal(self.covariances, axis1=1, axis2=2))


@dataclass(frozen=True, eq=False)
class AdjustedStations:
    """Adjusted stations, one row each.

    Attributes:
        origins: Names of their points.
        orientations: (m,) int8 values of `Orientation`, after the automatic #FIX.
        g0: (m,) azimuth of the zero of the horizontal circle, rad.
        rotations: (m, 3, 3) from the local vertical (or the frame, where it has none) to the instrument.
    """

    origins: tuple[str, ...]
    orientations: NDArray[np.int8]
    g0: FloatArray
    rotations: FloatArray


@dataclass(frozen=True, eq=False)
class Adjustment:
    """An adjusted network; residuals, coordinates and sigma0 all belong to the same, final, solution.

    Attributes:
        solution: The result of the least squares.
        points: The adjusted points.
        stations: The adjusted stations.
        book: The observations.
        residuals: (n,) computed minus observed, m or rad; NaN for inactive observations.
        frame: Definition of the computation frame.
        points_crs: Definition of the system of the points.
        points_crs_unit: Unit of its first two coordinates: "m" or "degree".
        precision: "a posteriori" when precisions are scaled by the variance factor, "a priori" when there
            is no redundancy to estimate it.
        warnings: What the user should know of the input, one sentence each.
        phases: Seconds of each phase of the work.
        left_out: The points and stations that nothing determined, left out with their observations.
    """

    solution: LeastSquaresResult
    points: AdjustedPoints
    stations: AdjustedStations
    book: FieldBook
    residuals: FloatArray
    frame: str
    points_crs: str
    points_crs_unit: str
    precision: str
    warnings: tuple[str, ...]
    phases: Mapping[str, float]
    left_out: tuple[LeftOut, ...] = ()

    @property
    def sigma0(self) -> float | None:
        """Unit-weight estimate of the final solution, survey observations only (MMVII's definition)."""
        return self.solution.sigma0

    @property
    def converged(self) -> bool:
        """Whether the iterations ended by themselves."""
        return self.solution.converged

    @property
    def normalised_residuals(self) -> FloatArray:
        """(n,) residual over sigma; NaN for inactive observations."""
        return np.asarray(self.residuals / self.book.observations.sigmas)

    def to_dict(self) -> dict[str, Any]:
        """The record of the result file (format "obseq-adjustment", version 1): metres and radians."""
        solution = self.solution
        return {
            "format": FORMAT,
            "version": VERSION,
            "n_observations": solution.n_observations,
            "n_constraints": solution.n_constraints,
            "n_unknowns": solution.n_unknowns,
            "redundancy": solution.redundancy,
            "iterations": [
                {"sigma0": step.sigma0, "max_step": step.max_step} for step in solution.iterations
            ],
            "sigma0": solution.sigma0,
            "variance_factor": solution.variance_factor,
            "converged": solution.converged,
            "stop_reason": solution.stop_reason.value,
            "precision": self.precision,
            "frame": self.frame,
            "points_crs": self.points_crs,
            "points_crs_unit": self.points_crs_unit,
            "points": self._points(),
            "stations": self._stations(),
            "observations": self._observations(),
            "warnings": list(self.warnings),
            "left_out": [item.record() for item in self.left_out],
            "phases": [{"name": name, "seconds": seconds} for name, seconds in self.phases.items()],
        }

    def _points(self) -> list[dict[str, Any]]:
        points = self.points
        upper = points.covariances[:, (0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2)]
        columns = np.hstack(
            [points.coordinates, points.precisions, points.crs_coordinates, points.crs_precisions]
        )
        keys = ("x", "y", "z", "sx", "sy", "sz", "crs_x", "crs_y", "crs_z", "crs_sx", "crs_sy", "crs_sz")
        return [
            {"name": name, **dict(zip(keys, row, strict=True)), "covariance": covariance}
            for name, row, covariance in zip(points.names, columns.tolist(), upper.tolist(), strict=True)
        ]

    def _stations(self) -> list[dict[str, Any]]:
        stations = self.stations
        return [
            {"origin": origin, "orientation": Orientation(status).keyword, "g0": float(g0)}
            for origin, status, g0 in zip(stations.origins, stations.orientations, stations.g0, strict=True)
        ]

    def _observations(self) -> list[dict[str, Any]]:
        book, rows = self.book, self.book.observations
        names = {int(kind): kind.name for kind in ObservationType}
        columns = zip(
            rows.types.tolist(),
            rows.from_points.tolist(),
            rows.to_points.tolist(),
            rows.values.tolist(),
            rows.sigmas.tolist(),
            self.residuals.tolist(),
            self.normalised_residuals.tolist(),
            rows.file_indices.tolist(),
            rows.lines.tolist(),
            rows.active.tolist(),
            strict=True,
        )
        return [
            {
                "type": names[kind],
                "from": book.point_names[origin],
                "to": book.point_names[target],
                "value": value,
                "sigma": sigma,
                "residual": residual if active else None,
                "normalised_residual": normalised if active else None,
                "file": book.files[file],
                "line": line,
                "active": active,
            }
            for kind, origin, target, value, sigma, residual, normalised, file, line, active in columns
        ]
