"""The tables that a plan has beside those of an adjustment: what is weak, and what more would bring."""

from __future__ import annotations

from typing import TYPE_CHECKING

from obseq.printable import printable_line
from obseq.report.tables.columns import choice, column, field, filled, table

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping

    from obseq.records.plan import PlanRecord
    from obseq.report.tables.columns import Table


def plan_tables(record: PlanRecord, rows: Mapping[str, int], names: Collection[str] = ()) -> list[Table]:
    """Weakest points, weakly checked observations, gains; or those of some names."""
    return filled(of(record, rows) for name, of in PLAN_TABLES.items() if not names or name in names)


def _points(record: PlanRecord, rows: Mapping[str, int]) -> Table | None:
    found = record.weakest_points
    columns = [
        column("point", "point", (rows[item.point] for item in found)),
        field("sigma", "small_length", found, "sigma", about="in the direction in which it is known worst"),
        field("azimuth", "bearing", found, "azimuth", about="of that direction"),
        field("elevation", "bearing", found, "elevation", about="of the same"),
    ]
    about = "Standard deviation in the direction in which the point is known worst, and that direction."
    return table("weakest", "Weakest points", columns, about=about)


def _observations(record: PlanRecord, _: Mapping[str, int]) -> Table | None:
    found = record.weakest_observations
    columns = [
        column("observation", "text", (printable_line(item.observation) for item in found)),
        field("redundancy", "number", found, "redundancy", bar="redundancy"),
        field("detectable", "small", found, "detectable", about="smallest error that its test finds"),
        field("effect", "number", found, "external", about="what it moves, in standard deviations"),
    ]
    about = "The smallest error that would be noticed, and what it moves. None without a number."
    units = [int(item.unit == "rad") for item in found]
    return table("weak", "Weakly checked", columns, about=about, angular=units)


def _gains(record: PlanRecord, rows: Mapping[str, int]) -> Table | None:
    found = record.gains
    names = [printable_line(item.point) for item in found]
    columns = [
        choice("type", [item.type for item in found]),
        column("from", "point", (rows.get(item.origin) for item in found)),
        column("to", "point", (rows.get(item.target) for item in found)),
        column("sigma", "small", [item.sigma for item in found]),
        field("network now", "small_length", found, "before"),
        field("then", "small_length", found, "after"),
        column("point", "text", names, about="the point that gains most"),
        field("point now", "small_length", found, "point_before"),
        field("point then", "small_length", found, "point_after"),
    ]
    about = (
        f"What one more observation would bring, the best of {record.candidates} tried. Network: root mean "
        "square of the standard deviations of all coordinates. Point: the one that gains most, in space."
    )
    return table("gains", "Gains", columns, about=about, angular=[int(item.unit == "rad") for item in found])


PLAN_TABLES: dict[str, Callable[[PlanRecord, Mapping[str, int]], Table | None]] = {
    "weakest": _points,
    "weak": _observations,
    "gains": _gains,
}
"""The tables by name, in the order of the page."""
