"""What a notebook or a terminal shows of a network and of its adjustment, without any script."""

from __future__ import annotations

from typing import TYPE_CHECKING

from obseq.report import rows
from obseq.report.basis import how_it_ended, kinds
from obseq.report.figure import network_figure, plan_figure
from obseq.report.html import escaped
from obseq.report.quality import single_tests, suspects
from obseq.report.summary import gross_errors, left_out, tested
from obseq.report.units import significant
from obseq.report.verdict import Verdict, worst_first, worst_title

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from obseq.records.adjustment import AdjustmentRecord, PointRecord

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
    worst = worst_first(record)[:WORST]
    observed = rows.observation_table(record, f"Observations by {worst_title(record)}", worst)
    points = rows.frame_table(record, record.points[:MOST_POINTS])
    return _framed([*_outcome(record), network_figure(record), _table(observed), _table(points)])


def adjustment_text(record: AdjustmentRecord) -> str:
    """The outcome in a few lines, for a terminal."""
    first, *others = (text for text, _ in _told(record))
    return "\n".join([f"Adjustment: {first}", *(f"  {text}" for text in others)])


def network_html(
    points: Sequence[PointRecord], sights: Iterable[tuple[str, str]], stations: set[str], counts: str
) -> str:
    """A network before its adjustment: what it consists of, and the plan of what has coordinates."""
    return _framed([f"<p>{escaped(counts)}</p>", plan_figure(points, sights, stations)])


def _framed(parts: Iterable[str]) -> str:
    return f'<div class="obseq"><style>{STYLE}</style>{"".join(parts)}</div>'


def _outcome(record: AdjustmentRecord) -> list[str]:
    return [f'<p class="{"bad" if is_bad else ""}">{escaped(text)}</p>' for text, is_bad in _told(record)]


def _told(record: AdjustmentRecord) -> list[tuple[str, bool]]:
    """The outcome sentence by sentence, and whether each is bad news."""
    verdict = Verdict(record)
    return [
        (f"{len(record.points)} points, {how_it_ended(record)}", not record.is_complete),
        *((line.strip(), True) for line in (*gross_errors(record, 5), *left_out(record))),
        (f"{record.n_observations} observations ({kinds(record)}), redundancy {record.redundancy}", False),
        (f"sigma0 {significant(record.sigma0)}; {tested(record)}", not verdict.is_accepted),
        (verdict.explanation, False),
        *((line, bool(suspects(record))) for line in single_tests(record)),
    ]


def _table(table: rows.Table) -> str:
    body = "".join(_row(row, table.left, "td") for row in table.rows)
    return f"<p>{escaped(table.title)}</p><table>{_row(table.header, table.left, 'th')}{body}</table>"


def _row(cells: tuple[str, ...], left: int, tag: str) -> str:
    parts = (
        f'<{tag} class="{"name" if k < left else ""}">{escaped(cell)}</{tag}>' for k, cell in enumerate(cells)
    )
    return f"<tr>{''.join(parts)}</tr>"
