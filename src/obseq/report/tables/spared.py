"""A record without precisions that suspected errors spoil: from the given sigmas, as reports show it then."""

from __future__ import annotations

from typing import TypeVar

from msgspec import structs

from obseq.records.adjustment import AdjustmentRecord
from obseq.records.columns import Lazy
from obseq.records.record import Record
from obseq.records.rows import Rows

Kind = TypeVar("Kind", bound=Record)
POINTS = (
    *(f"{system}s{axis}" for system in ("", "crs_") for axis in "xyz"),
    *("covariance", "inner", "ellipse.semi_major", "ellipse.semi_minor", "ellipsoid.axes"),
)
"""Columns of points that are precisions."""
PAIRS = ("precision", "bearing_precision", "ellipse.semi_major", "ellipse.semi_minor")
"""Those of pairs of points."""
GIVEN = "from the given sigmas"


def spared(record: AdjustmentRecord) -> AdjustmentRecord:
    """The record; with errors suspected, its precisions do not hold the sigma0 that they spoil."""
    if not record.gross_errors or record.precision != "a posteriori" or not record.sigma0:
        return record
    by = 1.0 / record.sigma0
    return structs.replace(
        record,
        precision=GIVEN,
        points=_times(record.points, POINTS, by),
        relative=record.relative and _times(record.relative, PAIRS, by),
    )


def _times(rows: Rows[Kind], names: tuple[str, ...], by: float) -> Rows[Kind]:
    """Rows with precisions multiplied, and covariances by the square."""
    factors = {name: by * by if name == "covariance" else by for name in names if name in rows.columns}
    return rows.changed(Lazy(factors, lambda name: factors[name] * rows.numbers(name)))
