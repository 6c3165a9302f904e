"""An adjusted block as people ask it, by names, as of networks: tables, covariances, a drawing, files."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, overload

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError, nearest
from obseq.images.adjustment.solution import BundleSolution
from obseq.leastsquares.statistics.ellipses import ellipses_of
from obseq.survey.adjustment.adjusted_quality import ellipse_records

if TYPE_CHECKING:
    from pathlib import Path

    from obseq.arrays import FloatArray
    from obseq.images.output.block_record import (
        BlockPointRecord,
        BundleRecord,
        CameraRecord,
        ImageRecord,
        MeasureRecord,
    )
    from obseq.records.adjustment import EllipseRecord
    from obseq.records.diagnosis import AccusedRecord, DiagnosisRecord
    from obseq.records.table import AnyTable, Table
    from obseq.survey.adjustment.plotting import Axes


@dataclass(frozen=True, eq=False)
class AdjustedBlock(BundleSolution):
    """What `adjust` found: the solution, what may be wrong with it, and its tables, drawings and files.

    Attributes:
        diagnosis: what is wrong with it; None where nothing can tell.
        failures: what should explain it, and failed.
    """

    diagnosis: DiagnosisRecord | None = None
    failures: tuple[str, ...] = ()

    @property
    def gross_errors(self) -> tuple[AccusedRecord, ...]:
        """The errors that were found, the clearest first."""
        return () if self.diagnosis is None else self.diagnosis.accused

    def record(self) -> BundleRecord:
        """What the result file holds, and the reports are made of."""
        from obseq.images.output.record import record_of

        return record_of(self, self.result.has_covariances, self.diagnosis, self.failures)

    @overload
    def table(self, name: Literal["points"] = ...) -> Table[BlockPointRecord]: ...
    @overload
    def table(self, name: Literal["images"]) -> Table[ImageRecord]: ...
    @overload
    def table(self, name: Literal["cameras"]) -> Table[CameraRecord]: ...
    @overload
    def table(self, name: Literal["measures"]) -> Table[MeasureRecord]: ...
    @overload
    def table(self, name: str) -> AnyTable: ...

    def table(self, name: str = "points") -> AnyTable:
        """A table of the result: columns by name, `rows`, `where`, `frame()` for pandas, `save` as CSV.

        Args:
            name: "points", "images", "cameras", "measures" (image points), "check_points", "left_out",
                "iterations", or another list of the record.

        Raises:
            InputError: The record has no such list.
        """
        return self.record().table(name)

    def covariance(self, *names: str) -> FloatArray:
        """(3 k, 3 k) covariance of points and centres of images together; of all points when none is named.

        Raises:
            InputError: No point and no image is called so, or the solution is one without covariances.
        """
        ids = dict(zip(self.poses.images, self.equations.centres.tolist(), strict=True))
        ids |= dict(zip(self.points, self.equations.points.tolist(), strict=True))
        for name in names:
            if name not in ids:
                raise InputError(f"covariance: no point and no image is called {nearest(name, ids)}")
        chosen = np.array([ids[name] for name in names or self.points])
        return self.covariance_between(chosen, chosen)

    def ellipse(self, name: str, level: float | None = 0.95) -> EllipseRecord:
        """The error ellipse in x and y of a point, or of the centre of an image.

        Args:
            name: Of the point or the image.
            level: Probability that the true place is inside; None for the standard ellipse.

        Raises:
            InputError: Nothing is called so, or the level is no probability.
        """
        block = self.covariance(name)[None]
        return next(iter(ellipse_records(ellipses_of((name,), block, level, self._shape_redundancy))))

    def plot(self, level: float | None = 0.95, residuals: bool = False, axes: Axes = None) -> Axes:
        """Draws the plan with matplotlib: points, rays, error ellipses; gives the axes.

        Args:
            level: Of the ellipses.
            residuals: Colours the rays by their residuals over their sigmas.
            axes: Where to draw; by default a figure of its own.

        Raises:
            MissingPackageError: matplotlib is not installed.
        """
        from obseq.survey.adjustment.plotting import Places, Sights, plan

        found = self.residuals
        ends = np.stack([self.poses.centres[found.image], self.coordinates[found.point]], axis=1)
        sizes = np.linalg.norm(found.residuals / found.sigmas, axis=1) / np.sqrt(2.0) if residuals else None
        places = Places(self.points, self.coordinates, self.point_covariances, self.start.is_control)
        return plan(places, Sights(ends, sizes), (level, self._shape_redundancy), axes)

    def save(self, path: str | Path) -> None:
        """Writes the result by the suffix: `.json` or `.npz` (read again by `obseq.load`), `.html`, `.txt`.

        Raises:
            InputError: The suffix is another, or the file cannot be written.
        """
        from obseq.images.output.page import contents
        from obseq.report.formats import FORMATS
        from obseq.report.saving import save

        made = contents(self.record())
        save({form.suffix: made[form.name] for form in FORMATS}, path)

    @property
    def _shape_redundancy(self) -> int | None:
        """Of sigma0, which widens ellipses; None where precisions are a priori."""
        return self.result.redundancy if self.is_a_posteriori else None
