"""The complete text listing: every point, station and observation."""

from collections.abc import Iterator

from obseq.arguments import expecting, instance
from obseq.printable import printable
from obseq.records.adjustment import AdjustmentRecord
from obseq.report.basis import basis, how_it_ended, kinds
from obseq.report.content import numbers_of, tables
from obseq.report.quality import single_tests, snooping_lines
from obseq.report.spared import spared
from obseq.report.summary import gross_errors, left_out, notes, tested, warnings
from obseq.report.units import significant, units_of
from obseq.report.verdict import Verdict
from obseq.report.writer import Writer, wrapped


@expecting(record=instance(AdjustmentRecord))
def listing(record: AdjustmentRecord) -> str:
    """The listing, in the units of the record's reports (metres and gon unless the files have others).

    Its tables are those of the page; observations and points are in the order of the files.
    """
    given = spared(record)
    rows = numbers_of(given)
    writer = Writer(list(rows), units_of(record))
    parts = (_head(record), warnings(record, len(record.warnings)), notes(record))
    heads = ["\n".join(wrapped(part)) for part in parts]
    sections = [*heads, *("\n".join(writer.lines(table)) for table in tables(given, rows))]
    return printable("\n\n".join(section for section in sections if section) + "\n")


def _head(record: AdjustmentRecord) -> Iterator[str]:
    if record.title:
        yield record.title
    yield f"Adjustment of {len(record.points)} points: {how_it_ended(record)}"
    yield from gross_errors(record, len(record.gross_errors))
    yield from left_out(record)
    yield from (f"  {name:<14}{text}" for name, text in basis(record))
    yield f"  observations  {record.n_observations} ({kinds(record)})"
    yield f"  constraints   {record.n_constraints}"
    yield f"  unknowns      {record.n_unknowns}"
    yield f"  redundancy    {record.redundancy}"
    yield f"  sigma0        {significant(record.sigma0)}"
    yield f"  {tested(record)}"
    yield f"  {Verdict(record).explanation}"
    yield from (f"  {line}" for line in single_tests(record))
    yield from snooping_lines(record)
    yield ""
    yield "  iteration  sigma0 at its start  largest step"
    for number, row in enumerate(record.iterations, start=1):
        yield f"  {number:>9}  {significant(row.sigma0):>19}  {significant(row.max_step):>12}"
