"""What people ask an adjusted network for, by names: tables, covariances, ellipses, a drawing, files."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np

from obseq.errors import InputError
from obseq.leastsquares.solution.export import as_table
from obseq.leastsquares.statistics.ellipses import ellipses_of
from obseq.records.table import table_of
from obseq.survey.adjustment.adjusted_quality import covariance_of, ellipse_records

if TYPE_CHECKING:
    from pathlib import Path

    from obseq.arrays import FloatArray
    from obseq.leastsquares import LeastSquaresResult
    from obseq.records.adjustment import (
        AdjustmentRecord,
        ConstraintRecord,
        EllipseRecord,
        IterationRecord,
        ObservationRecord,
        PointRecord,
        StationRecord,
    )
    from obseq.records.quality import StatisticsRecord
    from obseq.records.table import Table
    from obseq.survey.adjustment.adjusted_quality import AdjustedQuality
    from obseq.survey.adjustment.adjusted_records import AdjustedPoints
    from obseq.survey.adjustment.plotting import Axes
    from obseq.survey.model import FieldBook


class Asked:
    """The part of an adjustment that answers questions by names."""

    if TYPE_CHECKING:  # the adjustment has them
        solution: LeastSquaresResult
        points: AdjustedPoints
        book: FieldBook
        quality: AdjustedQuality

        @property
        def normalised_residuals(self) -> FloatArray:
            """(n,) residual over sigma."""

        def record(self, title: str | None = None) -> AdjustmentRecord:
            """What the result file holds."""

    @overload
    def table(self, name: Literal["points"] = ...) -> Table[PointRecord]: ...
    @overload
    def table(self, name: Literal["observations"]) -> Table[ObservationRecord]: ...
    @overload
    def table(self, name: Literal["stations"]) -> Table[StationRecord]: ...
    @overload
    def table(self, name: Literal["constraints"]) -> Table[ConstraintRecord]: ...
    @overload
    def table(self, name: Literal["types", "setups"]) -> Table[StatisticsRecord]: ...
    @overload
    def table(self, name: Literal["iterations"]) -> Table[IterationRecord]: ...
    @overload
    def table(self, name: str, package: str | None = ...) -> Any: ...
    def table(self, name: str = "points", package: str | None = None) -> object:
        """A table of the result: columns by name, `rows`, `where`, `frame()` for pandas, `save` as CSV.

        Args:
            name: "points", "observations", "stations", "constraints" (known coordinates), "types", "setups",
                "iterations", or another list of the record (docs/result-file.md).
            package: "pandas" for a DataFrame, "pyarrow" for a Table; None for one of ours.

        Raises:
            InputError: The record has no such list, or the package is not installed.
        """
        found = table_of(self.record(), name)
        return found if package is None else as_table(dict(found), package)

    def covariance(self, *names: str) -> FloatArray:
        """(3 k, 3 k) covariance of points together, in the computation frame, m^2; of all when none is named.

        Raises:
            InputError: A point is not in the network.
        """
        return covariance_of(self.solution, self.points.names, names, self.quality.a_priori)

    def ellipse(self, name: str, level: float | None = 0.95) -> EllipseRecord:
        """The error ellipse of a point in x and y.

        Args:
            name: Of the point.
            level: Probability that the true point is inside; None for the standard ellipse.

        Raises:
            InputError: The point is not in the network, its plan is held, or the level is no probability.
        """
        redundancy = None if self.quality.a_priori else self.solution.redundancy
        block = self.covariance(name)[None]
        if not block[0, :2, :2].any():
            raise InputError(
                f"{name} has no ellipse: its x and y are held; covariance({name!r}) has its height"
            )
        return next(iter(ellipse_records(ellipses_of((name,), block, level, redundancy))))

    def plot(self, level: float | None = 0.95, residuals: bool = False, axes: Axes = None) -> Axes:
        """Draws the plan with matplotlib: points, sights, error ellipses; gives the axes.

        Args:
            level: Of the ellipses.
            residuals: Colours the sights by their residuals over their sigmas.
            axes: Where to draw; by default a figure of its own.

        Raises:
            MissingPackageError: matplotlib is not installed.
        """
        from obseq.survey.adjustment.plotting import Places, Sights, plan

        redundancy = None if self.quality.a_priori else self.solution.redundancy
        points, rows = self.points, self.book.observations
        numbers = {name: k for k, name in enumerate(points.names)}
        known = np.array([numbers.get(name, -1) for name in self.book.point_names])
        ends = known[np.column_stack([rows.from_points, rows.to_points])]
        used = rows.active & (ends >= 0).all(axis=1)
        places = Places(
            points.names,
            points.coordinates,
            points.covariances,
            np.asarray(~points.points.is_free.any(axis=1)),
        )
        sights = Sights(
            points.coordinates[ends[used]], np.abs(self.normalised_residuals[used]) if residuals else None
        )
        return plan(places, sights, (level, redundancy), axes)

    def save(self, path: str | Path) -> None:
        """Writes the result: `.json` (read again by `obseq.load`), `.html` or `.txt`, by the suffix.

        Raises:
            InputError: The suffix is another, or the file cannot be written.
        """
        from obseq.report.formats import FORMATS
        from obseq.report.saving import save

        record = self.record()
        save({form.suffix: partial(form.write, record) for form in FORMATS}, path)
