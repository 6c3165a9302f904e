"""Results as files: points that a next adjustment reads (COR files), tables of points and observations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from obseq import crs, spreadsheets
from obseq.arrays import FloatArray
from obseq.errors import InputError
from obseq.formats.obs.cor import cor_text
from obseq.records.adjustment import AdjustmentRecord, PointRecord
from obseq.records.shown_units import METRES
from obseq.survey.model import Points, make_points

OBSERVATION_FIELDS = (
    *("type", "origin", "target", "backsight", "value", "sigma", "unit", "active", "rejected"),
    *("residual", "normalised_residual", "redundancy", "standardised_residual", "tau"),
    *("detectable", "external", "blunder", "file", "line"),
)
HEADER = ("name", "x", "y", "z", "sx", "sy", "sz")


def adjusted_points(record: AdjustmentRecord) -> Points:
    """The points of a result in their own system, known with their precisions; 0 where they were held.

    What nobody gave and nothing observes (the plan of points that are levelled) is NaN.

    Raises:
        InputError: A point has no coordinates at all in its system.
    """
    names = [point.name for point in record.points]
    coordinates = _table([(p.crs_x, p.crs_y, p.crs_z) for p in record.points])
    lacking = np.flatnonzero(~np.isfinite(coordinates).any(axis=1))
    if lacking.size:
        raise InputError(f"point {names[lacking[0]]} has no coordinates in {record.points_crs}")
    return make_points(names, coordinates, _table([_precisions(p) for p in record.points]))


def _precisions(point: PointRecord) -> tuple[float | None, ...]:
    return point.crs_sx, point.crs_sy, point.crs_sz


def _table(rows: list[tuple[float | None, ...]]) -> FloatArray:
    return np.array([[np.nan if v is None else v for v in row] for row in rows], np.float64).reshape(-1, 3)


def cor_of(record: AdjustmentRecord) -> str:
    """A COR file with the adjusted points: known, with their precisions."""
    header = (
        f"adjusted coordinates in {record.points_crs}; sigmas are standard deviations {record.precision} (m)"
    )
    return cor_text(adjusted_points(record), header)


def csv_of(record: AdjustmentRecord) -> str:
    """A table of the adjusted points, in their system: in feet where reports are, unless it has angles."""
    points, system, unit = adjusted_points(record), crs.parse(record.points_crs), record.units.length
    if unit == "m" or system.plan_unit.is_angle:
        return csv_text(points)
    factors = [system.plan_unit.factor, system.plan_unit.factor, system.height_unit.factor]
    return csv_text(replace(points, coordinates=points.coordinates * factors), unit)


def observations_csv(record: AdjustmentRecord) -> str:
    """A table of the observations of a result, in metres and radians, and of how they fit.

    It is no table to adjust again: a result does not say set-ups, heights of instruments or covariances.
    """
    rows = [[_cell(getattr(row, name)) for name in OBSERVATION_FIELDS] for row in record.observations]
    header = [{"origin": "from", "target": "to"}.get(name, name) for name in OBSERVATION_FIELDS]
    return spreadsheets.csv_text([header, *rows])


def _cell(value: object) -> str:
    """A cell: numbers at full precision, truths as 1 and 0, nothing where nothing is known."""
    if value is None:
        return ""
    return str(int(value)) if isinstance(value, bool) else str(value)


def csv_text(points: Points, unit: str = "m") -> str:
    """Points as a table with a header; a cell is empty where nothing is known or given.

    Args:
        points: In metres; in the units of their system where no unit is named.
        unit: Of lengths, in which they are written; a column names it unless it is the metre.
    """
    named = () if unit == "m" else (unit,)
    rows: list[tuple[str, ...]] = [(*HEADER, *("unit" for _ in named))]
    for name, xyz, sigmas in zip(points.names, points.coordinates, points.sigmas, strict=True):
        numbers = (np.concatenate([xyz, sigmas]) / METRES[unit]).tolist()
        rows.append((name, *("" if np.isnan(value) else repr(value) for value in numbers), *named))
    return spreadsheets.csv_text(rows)
