"""The rows that the text and HTML reports share: titles and cells of each table, as text in user units."""

from dataclasses import dataclass

from obseq.report import units
from obseq.report.record import AdjustmentRecord, ObservationRecord, PointRecord


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


def frame_table(record: AdjustmentRecord, points: list[PointRecord]) -> Table:
    """Coordinates in the computation frame."""
    rows = (
        (
            point["name"],
            *(units.metres(point[axis]) for axis in ("x", "y", "z")),
            *(units.millimetres(point[axis]) for axis in ("sx", "sy", "sz")),
        )
        for point in points
    )
    title = f"Coordinates in the computation frame {record['frame']} (m), precisions (mm)"
    return Table(title, ("point", "x", "y", "z", "sx", "sy", "sz"), tuple(rows))


def crs_table(record: AdjustmentRecord, points: list[PointRecord]) -> Table:
    """Coordinates in the system of the point files, with precisions if the record has them."""
    is_angular = record.get("points_crs_unit") == "degree"
    decimals = 9 if is_angular else 4
    with_precisions = any(point.get("crs_sx") is not None for point in points)
    rows = []
    for point in points:
        cells = [point["name"], units.fixed(point["crs_x"], decimals), units.fixed(point["crs_y"], decimals)]
        cells.append(units.metres(point["crs_z"]))
        if with_precisions:
            precisions = (point.get("crs_sx"), point.get("crs_sy"), point.get("crs_sz"))
            cells += [units.millimetres(value) for value in precisions]
        rows.append(tuple(cells))
    header = ("point", "x", "y", "z", *(("east", "north", "up") if with_precisions else ()))
    unit = "degrees, m" if is_angular else "m"
    more = ", precisions (mm)" if with_precisions else ""
    return Table(f"Coordinates in {record['points_crs']} ({unit}){more}", header, tuple(rows))


def station_table(record: AdjustmentRecord) -> Table:
    """Stations and the azimuth of the zero of their circles."""
    rows = ((row["origin"], row["orientation"], units.gon(row["g0"])) for row in record["stations"])
    return Table(
        "Stations, azimuth of the zero of the circle (gon)", ("station", "orientation", "g0"), tuple(rows), 2
    )


def observation_table(title: str, observations: list[ObservationRecord]) -> Table:
    """Observations with their residuals."""
    header = ("type", "from", "to", "file", "observed", "sigma", "residual", "normalised")
    return Table(title, header, tuple(_observation_cells(row) for row in observations), 4)


def _observation_cells(row: ObservationRecord) -> tuple[str, ...]:
    kind = row["type"]
    return (
        kind,
        row["from"],
        row["to"],
        f"{row['file']}:{row['line']}",
        units.observed(kind, row["value"]),
        units.small(kind, row["sigma"]),
        units.small(kind, row["residual"]) if row["active"] else "not used",
        units.fixed(row["normalised_residual"], 2) if row["active"] else units.ABSENT,
    )
