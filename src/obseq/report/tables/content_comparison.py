"""The table of a comparison: displacements of points, and their tests."""

from __future__ import annotations

from typing import TYPE_CHECKING

from obseq.report.tables.columns import choice, column, ellipse_columns, field, table

if TYPE_CHECKING:
    from obseq.records.comparison import ComparisonRecord
    from obseq.report.tables.columns import Table


def displacements(record: ComparisonRecord) -> Table:
    """How far each point moved, and how sure that is."""
    found, chance = record.displacements, "probability of a larger test where it has not moved"
    columns = [
        column("point", "point", range(len(found))),
        *([] if record.obstacles else [choice("verdict", [_word(record, k) for k in range(len(found))])]),
        *(field(axis, "length", found, axis, rare=True) for axis in "xyz"),
        *(field(axis, "small_length", found, axis, by_size=True) for axis in ("east", "north", "up")),
        *(field(f"s {axis}", "small_length", found, f"s_{axis}") for axis in ("east", "north", "up")),
        field("length", "small_length", found, "length"),
        column("test", "number", [row.test and row.test.statistic for row in found]),
        column("limit", "number", [row.test and row.test.limit for row in found]),
        column("p", "small_number", [row.test and row.test.p_value for row in found], about=chance),
        field("p over all", "small_number", found, "overall", about="the same at any of the points (Holm)"),
        *ellipse_columns(row.ellipse for row in found),
    ]
    note = "Second epoch minus first. The verdict judges all points together (Holm)."
    return table(
        "displacements",
        "Displacements",
        columns,
        about=note,
        rows="point",
        order="length",
        hint="moved length>5",
    )


def _word(record: ComparisonRecord, k: int) -> str:
    row = record.displacements[k]
    if row.point in record.undecided:
        return "undecided"
    if row.is_significant:
        return "moved"
    return (
        "marginal"
        if row.is_marginal
        else "held"
        if row.test is None
        else "reference"
        if row.is_reference
        else "stayed"
    )
