"""The HTML report: one file that needs nothing else, with a plan of the network."""

from collections.abc import Iterator
from importlib.resources import files
from string import Template

from obseq.arguments import expecting, instance
from obseq.record import AdjustmentRecord
from obseq.report import rows
from obseq.report.figure import network_figure
from obseq.report.html import escaped
from obseq.report.quality import quality_tables, single_tests, snooping_lines, suspects
from obseq.report.summary import expected, how_it_ended, kinds, notes, run_line, warnings
from obseq.report.units import significant
from obseq.report.verdict import Verdict, worst_constraints_first, worst_first, worst_title

MOST_ROWS = 2000
MOST_WARNINGS = 20


@expecting(record=instance(AdjustmentRecord))
def page(record: AdjustmentRecord) -> str:
    """The report as an HTML document; of a large network, the worst observations and the first points."""
    template = Template(files("obseq.report").joinpath("page.html").read_text(encoding="utf-8"))
    return template.substitute(
        title=escaped(f"{len(record.points)} points, {record.n_observations} observations"),
        facts=_facts(record),
        figure=network_figure(record),
        tables="\n".join(_sections(record)),
    )


def _facts(record: AdjustmentRecord) -> str:
    verdict = Verdict(record)
    sigma0 = f"{significant(record.sigma0)} {verdict.headline}"
    if verdict.test:
        sigma0 = f"{sigma0}; {expected(record, verdict.test)}"
    items = [
        ("result", how_it_ended(record), "good" if record.converged else "bad"),
        ("observations", f"{record.n_observations} ({kinds(record)})", ""),
        ("constraints", f"{record.n_constraints}", ""),
        ("unknowns", f"{record.n_unknowns}", ""),
        ("redundancy", f"{record.redundancy}", ""),
        ("sigma0 by iteration", ", ".join(significant(row.sigma0) for row in record.iterations), ""),
        ("sigma0", sigma0, "good" if verdict.is_accepted else "bad"),
        ("", verdict.explanation, ""),
        *(("", line, "bad" if suspects(record) else "") for line in single_tests(record)),
        *(("snooping", line, "") for line in snooping_lines(record)),
        ("run", run_line(record), ""),
        *(("note", line.removeprefix("Note: "), "") for line in notes(record)),
        *(("warning", line.removeprefix("Warning: "), "") for line in warnings(record, MOST_WARNINGS)),
    ]
    cells = (
        f'<dt>{escaped(name)}</dt><dd class="{style}">{escaped(text)}</dd>' for name, text, style in items
    )
    return f"<dl>{''.join(cells)}</dl>"


def _sections(record: AdjustmentRecord) -> Iterator[str]:
    worst, points = worst_first(record), record.points
    title = f"Observations by {worst_title(record)}"
    yield _section(rows.observation_table(record, title, worst[:MOST_ROWS]), len(worst))
    known = worst_constraints_first(record)
    if known:
        title = "Known coordinates, the worst normalised residual first"
        yield _section(rows.constraint_table(record, title, known[:MOST_ROWS]), len(known))
    yield _section(rows.frame_table(record, points[:MOST_ROWS]), len(points))
    if record.points_crs != record.frame:
        yield _section(rows.crs_table(record, points[:MOST_ROWS]), len(points))
    yield _section(rows.station_table(record), len(record.stations))
    for table in quality_tables(record):
        yield _section(table, len(table.rows))


def _section(table: rows.Table, count: int) -> str:
    """A table, and a note when it has not all of so many rows."""
    body = "\n".join(_row(row, table.left, "td") for row in table.rows)
    hidden = count - len(table.rows)
    note = f"<p>and {hidden} more rows, which the text listing and the JSON file have</p>" if hidden else ""
    return (
        f'<h2>{escaped(table.title)}</h2>\n<div class="scroll"><table>\n'
        f"{_row(table.header, table.left, 'th')}\n{body}\n</table></div>{note}"
    )


def _row(cells: tuple[str, ...], left: int, tag: str) -> str:
    styles = ('class="name"' if k < left else "" for k in range(len(cells)))
    texts = (f"<{tag} {style}>{escaped(cell)}</{tag}>" for style, cell in zip(styles, cells, strict=True))
    return f"<tr>{''.join(texts)}</tr>"
