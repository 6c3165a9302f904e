"""The HTML report: one file that needs nothing else, with a plan and tables that are linked."""

from importlib.resources import files
from string import Template

from obseq.arguments import expecting, instance
from obseq.records.adjustment import AdjustmentRecord
from obseq.records.record import encoded
from obseq.report.content import content
from obseq.report.html import escaped
from obseq.report.quality import single_tests, snooping_lines, suspects
from obseq.report.summary import (
    basis,
    gross_errors,
    how_it_ended,
    kinds,
    left_out,
    notes,
    tested,
    warnings,
)
from obseq.report.units import significant
from obseq.report.verdict import Verdict

SCRIPTS = ("elements", "numbers", "table", "drawing", "sights", "motions", "plan", "charts", "main")
MOST_WARNINGS = 20

Facts = list[tuple[str, str, str]]


@expecting(record=instance(AdjustmentRecord))
def page(record: AdjustmentRecord) -> str:
    """The report as an HTML document that loads nothing: its script and all numbers are inside."""
    return Template(_part("page.html")).substitute(
        title=escaped(title(record)),
        style=_part("page.css"),
        facts=_facts(record),
        content=_embedded(content(record)),
        script="\n".join(_part(f"{name}.js") for name in SCRIPTS),
    )


def title(record: AdjustmentRecord) -> str:
    """What the user calls the adjustment, or what it is of."""
    return record.title or f"Adjustment: {len(record.points)} points, {record.n_observations} observations"


def _part(name: str) -> str:
    return files("obseq.report").joinpath("web", name).read_text(encoding="utf-8")


def _embedded(plain: dict[str, object]) -> str:
    """JSON inside an element of HTML: nothing in it ends the element."""
    return encoded(plain).replace("<", "\\u003c")


def _facts(record: AdjustmentRecord) -> str:
    items = [*_outcome(record), *((name, text, "") for name, text in basis(record)), *_remarks(record)]
    cells = (
        f'<dt>{escaped(name)}</dt><dd class="{style}">{escaped(text)}</dd>' for name, text, style in items
    )
    return f"<dl>{''.join(cells)}</dl>"


def _outcome(record: AdjustmentRecord) -> Facts:
    verdict = Verdict(record)
    sigma0 = tested(record) if record.planned else f"{significant(record.sigma0)}; {tested(record)}"
    accepted = "good" if verdict.is_accepted else "bad"
    return [
        ("result", how_it_ended(record), "good" if record.converged else "bad"),
        *(("gross errors", line.strip(), "bad") for line in gross_errors(record, MOST_WARNINGS)),
        *(("", line.strip(), "bad") for line in left_out(record)),
        ("observations", f"{record.n_observations} ({kinds(record)})", ""),
        ("constraints", f"{record.n_constraints}", ""),
        ("unknowns", f"{record.n_unknowns}", ""),
        ("redundancy", f"{record.redundancy}", ""),
        ("sigma0", sigma0, "" if record.planned else accepted),
        ("", verdict.explanation, ""),
        *(("", line, "bad" if suspects(record) else "") for line in single_tests(record)),
        *(("snooping", line, "") for line in snooping_lines(record)),
    ]


def _remarks(record: AdjustmentRecord) -> Facts:
    return [
        *(("note", line.removeprefix("Note: "), "") for line in notes(record)),
        *(("warning", line.removeprefix("Warning: "), "") for line in warnings(record, MOST_WARNINGS)),
    ]
