"""What a notebook or a terminal shows of a network and of its adjustment, without any script."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from obseq.records.adjustment import AdjustmentRecord, PointRecord
from obseq.report.adjusted import outcome
from obseq.report.drawings.figure import figure
from obseq.report.drawings.html import escaped
from obseq.report.drawings.plan import plan, plan_of_points
from obseq.report.summary import brief
from obseq.report.tables.content import numbers_of, tables
from obseq.report.tables.spared import spared
from obseq.report.tables.units import units_of
from obseq.report.writer import Printed, Writer, worst

WORST = 10
MOST_POINTS = 20
STYLE = """
.obseq svg { max-width: 44rem; width: 100%; height: auto; font-size: 13px; }
.obseq svg text { fill: currentColor; }
.obseq .sight { stroke: #8888; fill: none; } .obseq .bar { stroke: currentColor; stroke-width: 2; }
.obseq .point { fill: currentColor; } .obseq .station { fill: #3070c0; }
.obseq .precision { stroke: #c8382e; fill: #c8382e22; }
.obseq td, .obseq th { text-align: right; padding: 0 .6em; } .obseq .name { text-align: left; }
.obseq .bad { color: #c8382e; font-weight: 600; }
"""


def adjustment_html(record: AdjustmentRecord) -> str:
    """The outcome, the plan with ellipses, the worst observations with their reliability, the points."""
    given = spared(record)
    numbers = numbers_of(given)
    writer, found = (
        Writer(list(numbers), units_of(record)),
        {item["id"]: item for item in tables(given, numbers, ["observations", "points"])},
    )
    shown = []
    if "observations" in found:
        rows = worst(found["observations"], "effect" if record.planned else "w")[:WORST]
        shown.append(_table("Observations", writer.printed(found["observations"], rows)))
    if "points" in found:
        rows = list(range(len(record.points)))[:MOST_POINTS]
        shown.append(_table("Points", writer.printed(found["points"], rows)))
    return _framed([*_outcome(record), network_figure(given), *shown])


def network_figure(record: AdjustmentRecord) -> str:
    """The plan of an adjusted network as an SVG element."""
    numbers = numbers_of(record)
    sights = ((row.origin, row.target) for row in record.observations if row.active)
    return figure(plan(record, numbers), list(numbers), sights)


def adjustment_text(record: AdjustmentRecord) -> str:
    """The outcome in a few lines, for a terminal."""
    first, *others = (text for text, _ in brief(outcome(record)))
    return "\n".join([f"Adjustment: {first}", *(f"  {text}" for text in others)])


def network_html(
    points: Sequence[PointRecord], sights: Iterable[tuple[str, str]], stations: set[str], counts: str
) -> str:
    """A network before its adjustment: what it consists of, and the plan of what has coordinates."""
    drawn = figure(plan_of_points(points, stations), [point.name for point in points], sights)
    return _framed([f"<p>{escaped(counts)}</p>", drawn])


def _framed(parts: Iterable[str]) -> str:
    return f'<div class="obseq"><style>{STYLE}</style>{"".join(parts)}</div>'


def _outcome(record: AdjustmentRecord) -> list[str]:
    return [f'<p class="{level}">{escaped(text)}</p>' for text, level in brief(outcome(record))]


def _table(title: str, printed: Iterable[Printed]) -> str:
    columns = list(printed)
    heads = [f"{column.title} {column.unit}".rstrip() for column in columns]
    grid = [_row(columns, cells, "td") for cells in zip(*(column.cells for column in columns), strict=True)]
    return f"<p>{title}</p><table>{_row(columns, heads, 'th')}{''.join(grid)}</table>"


def _row(columns: Sequence[Printed], cells: Sequence[str], tag: str) -> str:
    parts = (
        f'<{tag} class="{"name" if column.is_text else ""}">{escaped(cell)}</{tag}>'
        for column, cell in zip(columns, cells, strict=True)
    )
    return f"<tr>{''.join(parts)}</tr>"
