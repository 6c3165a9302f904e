"""The rows that the text and HTML reports share: titles and cells of each table, as text in user units."""

import math
from collections import Counter
from collections.abc import Sequence
from pathlib import PurePath

from obseq.dataclass import dataclass
from obseq.records.adjustment import (
    AdjustmentRecord,
    ConstraintRecord,
    MotionRecord,
    ObservationRecord,
    PointRecord,
    StatisticsRecord,
)
from obseq.report import units

ANGLES = frozenset({"Hz", "Zen"})
"""Types that are angles in records that do not hold the unit of their observations (obseq 0.1.0)."""


LONGEST_FILE = 16
"""Characters of the name of a file in a table as text; the head of a listing has whole names."""

JUDGED = ("redundancy", "standardised", "detectable", "effect")
"""Columns of observations whose reliability is known; effect: of the detectable bias, in sigmas."""


@dataclass(frozen=True)
class Table:
    """A table as text.

    Attributes:
        title: What it shows, units included.
        header: Titles of the columns.
        rows: One text per column.
        left: How many first columns are names; the others are numbers.
    """

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    left: int = 1


def frame_table(record: AdjustmentRecord, points: Sequence[PointRecord]) -> Table:
    """Coordinates in the computation frame."""
    shown = units.units_of(record)
    rows = (
        (
            point.name,
            *(shown.length.number(value) for value in (point.x, point.y, point.z)),
            *(shown.small_length.number(value) for value in (point.sx, point.sy, point.sz)),
        )
        for point in points
    )
    unit = shown.length.name
    title = f"Coordinates in the computation frame {record.frame} ({unit}), {_precisions(record)}"
    return Table(title, ("point", "x", "y", "z", "sx", "sy", "sz"), tuple(rows))


def crs_table(record: AdjustmentRecord, points: Sequence[PointRecord]) -> Table:
    """Coordinates in the system of the point files, with precisions if the record has them."""
    plan, height = record.points_crs_unit or "m", record.points_crs_height_unit or "m"
    shown = units.units_of(record)
    names = dict.fromkeys(units.plural(shown.coordinate_name(unit)) for unit in (plan, height))
    title = f"Coordinates in {record.points_crs} ({', '.join(names)})"
    header: tuple[str, ...] = ("point", "x", "y", "z")
    rows = [_crs_cells(shown, point, plan, height) for point in points]
    if any(point.crs_sx is not None for point in points):
        title = f"{title}, {_precisions(record)}"
        is_angular = record.points_crs_is_angular or plan == "degree"
        header += ("east", "north", "up") if is_angular else ("sx", "sy", "sz")
        rows = [cells + _crs_precisions(shown, point) for cells, point in zip(rows, points, strict=True)]
    return Table(title, header, tuple(rows))


def _crs_cells(shown: units.Units, point: PointRecord, plan: str, height: str) -> tuple[str, ...]:
    parts = ((point.crs_x, plan), (point.crs_y, plan), (point.crs_z, height))
    return (point.name, *(shown.coordinate(value, unit) for value, unit in parts))


def _crs_precisions(shown: units.Units, point: PointRecord) -> tuple[str, ...]:
    values = (point.crs_sx, point.crs_sy, point.crs_sz)
    return tuple(shown.small_length.number(value) for value in values)


def _precisions(record: AdjustmentRecord) -> str:
    """How the precisions of the tables are to be read."""
    kind, unit = record.precision, units.units_of(record).small_length.name
    return f"precisions {kind} ({unit})" if kind else f"precisions ({unit})"


def station_table(record: AdjustmentRecord) -> Table:
    """Stations and the azimuth of the zero of their circles."""
    angle = units.units_of(record).angle
    rows = ((row.origin, row.orientation, angle.turned(row.g0)) for row in record.stations)
    title = f"Stations, azimuth of the zero of the circle ({angle.name})"
    return Table(title, ("station", "orientation", "g0"), tuple(rows), 2)


def observation_table(
    record: AdjustmentRecord, title: str, observations: Sequence[ObservationRecord]
) -> Table:
    """Observations of the record with their residuals, and where they were read."""
    judged = JUDGED if record.reliability else ("normalised",)
    header = ("type", "from", "to", "file", "observed", "sigma", "residual", *judged)
    names, shown = brief_names({row.file for row in record.observations}), units.units_of(record)
    rows = [
        _observation_cells(shown, row, names[row.file])
        + (_judged_cells(shown, row) if record.reliability else _normalised_cells(row))
        for row in observations
    ]
    return Table(title, header, tuple(rows), 4)


def short_names(files: set[str]) -> dict[str, str]:
    """What tables call each file: its name without folders, unless two files have the same."""
    count = Counter(PurePath(file).name for file in files)
    return {file: name if count[name := PurePath(file).name] == 1 else file for file in files}


def brief_names(files: set[str]) -> dict[str, str]:
    """The same for tables as text, whose lines are short: of long names, their beginning and their end."""
    names = short_names(files)
    brief = {file: _elided(name) for file, name in names.items()}
    count = Counter(brief.values())
    return {file: name if count[name] == 1 else names[file] for file, name in brief.items()}


def _elided(name: str) -> str:
    if len(name) <= LONGEST_FILE:
        return name
    end = (LONGEST_FILE - 3) // 2
    return f"{name[: LONGEST_FILE - 3 - end]}...{name[-end:]}"


def _observation_cells(shown: units.Units, row: ObservationRecord, file: str) -> tuple[str, ...]:
    unit = unit_of(row)
    return (
        row.type,
        row.origin,
        row.target,
        f"{file}:{row.line}",
        shown.observed(unit, row.value),
        shown.small(unit, row.sigma),
        shown.small(unit, row.residual) if row.active else "rejected" if row.rejected else "not used",
    )


def _normalised_cells(row: ObservationRecord) -> tuple[str, ...]:
    return (units.fixed(row.normalised_residual, 2) if row.active else units.ABSENT,)


def _judged_cells(shown: units.Units, row: ObservationRecord) -> tuple[str, ...]:
    """Redundancy, standardised residual, detectable bias and its effect."""
    unit = unit_of(row)
    return (
        units.fixed(row.redundancy, 2),
        units.fixed(row.standardised_residual, 2),
        shown.small(unit, row.detectable),
        units.fixed(row.external, 1),
    )


def unit_of(row: ObservationRecord) -> str:
    """The unit of an observation: m or rad."""
    return row.unit or ("rad" if row.type in ANGLES else "m")


def judged_table(record: AdjustmentRecord) -> Table:
    """What else reliability says of observations: adjusted value, tau, the error that each may have."""
    names, shown = brief_names({row.file for row in record.observations}), units.units_of(record)
    rows = (
        (
            row.type,
            row.origin,
            row.target,
            f"{names[row.file]}:{row.line}",
            shown.observed(unit_of(row), row.adjusted),
            units.fixed(row.normalised_residual, 2),
            units.fixed(row.tau, 2),
            shown.small(unit_of(row), row.blunder),
            *_effect_cells(shown, row),
        )
        for row in record.observations
        if row.active
    )
    header = ("type", "from", "to", "file", "adjusted", "normalised", "tau", "off by", "moves", "by")
    title = (
        "Adjusted values; residual / sigma; tau, with the a posteriori sigma; estimated error of each if it "
        "were the only one; the point that its detectable bias moves most, and by how much"
        f" ({shown.small_length.name})"
    )
    return Table(title, header, tuple(rows), 4)


def _effect_cells(shown: units.Units, row: ObservationRecord) -> tuple[str, str]:
    if row.effect is None:
        return units.ABSENT, units.ABSENT
    return row.effect.point, shown.small_length.number(math.hypot(row.effect.x, row.effect.y, row.effect.z))


def statistics_table(title: str, first: str, found: Sequence[StatisticsRecord]) -> Table:
    """How the observations of each type, or from each point, fit."""
    rows = (
        (
            row.name,
            str(row.count),
            str(row.unused),
            units.fixed(row.redundancy, 2),
            units.fixed(row.mean, 2),
            units.fixed(row.rms, 2),
            units.fixed(row.largest, 2),
            units.fixed(row.sigma_factor, 2),
        )
        for row in found
    )
    header = (first, "used", "unused", "redundancy", "mean", "rms", "largest", "sigma x")
    return Table(title, header, tuple(rows))


def moved_table(record: AdjustmentRecord) -> Table:
    """What is known of each point, how it moved, and its precisions with inner constraints."""
    small = units.units_of(record).small_length
    rows = (
        (
            point.name,
            f"known {point.known}" if point.known else "free",
            *(small.number(value) for value in point.moved or (None,) * 3),
            *(small.number(value) for value in point.inner or (None,) * 3),
        )
        for point in record.points
    )
    header = ("point", "class", "dx", "dy", "dz", "inner sx", "inner sy", "inner sz")
    title = (
        f"Known coordinates (capitals: held), adjusted minus given coordinates ({small.name}), and "
        f"precisions with the datum of inner constraints ({small.name}) where they were asked for"
    )
    return Table(title, header, tuple(rows), 2)


def constraint_table(record: AdjustmentRecord, title: str, constraints: Sequence[ConstraintRecord]) -> Table:
    """Known coordinates with their residuals, and where they were read."""
    header = ("coordinate", "point", "file", "given", "sigma", "residual", "normalised")
    names = brief_names({row.file for row in record.constraints})
    return Table(
        title, header, tuple(_constraint_cells(record, row, names[row.file]) for row in constraints), 3
    )


def _constraint_cells(record: AdjustmentRecord, row: ConstraintRecord, file: str) -> tuple[str, ...]:
    unit = (record.points_crs_height_unit if row.coordinate == "z" else record.points_crs_unit) or "m"
    shown = units.units_of(record)
    return (
        row.coordinate,
        row.point,
        f"{file}:{row.line}" if row.file else units.ABSENT,
        f"{shown.coordinate(row.value, unit)} {shown.coordinate_name(unit)}",
        shown.small_length.text(row.sigma),
        shown.small_length.text(row.residual),
        units.fixed(row.normalised_residual, 2),
    )


def motion_table(found: Sequence[MotionRecord]) -> Table:
    """What the observations of a free network leave undetermined: motions, the point that each moves most."""
    rows = []
    for item in found:
        most = max(range(len(item.points)), key=lambda row: math.hypot(*item.moves[row]))
        moves = (units.fixed(move, 3) for move in item.moves[most])
        rows.append((item.text, str(len(item.points)), item.points[most], *moves))
    title = "Not determined by the observations (the datum takes it): motions, the point that each moves most"
    return Table(title, ("motion", "points", "most", "along x", "y", "z"), tuple(rows))
