"""The complete text listing: every point, station and observation."""

from collections.abc import Iterator

from obseq.arguments import expecting, instance
from obseq.printable import printable
from obseq.records.adjustment import AdjustmentRecord
from obseq.report import rows
from obseq.report.basis import basis, how_it_ended, kinds
from obseq.report.quality import quality_tables, single_tests, snooping_lines, vector_table, worst_vectors
from obseq.report.summary import (
    gross_errors,
    left_out,
    notes,
    tested,
    warnings,
)
from obseq.report.table import lines_of, wrapped
from obseq.report.units import significant
from obseq.report.verdict import Verdict, worst_constraints_first


@expecting(record=instance(AdjustmentRecord))
def listing(record: AdjustmentRecord) -> str:
    """The listing, in the units of the record's reports (metres and gon unless the files have others)."""
    tables = [rows.frame_table(record, record.points)]
    if record.points_crs != record.frame:
        tables.append(rows.crs_table(record, record.points))
    tables.append(rows.station_table(record))
    tables.append(
        rows.observation_table(record, "Observations, in the order of the files", record.observations)
    )
    if record.reliability:
        tables.append(rows.judged_table(record))
    if record.joint:
        title = "Vectors and positions by their test T, with the estimate of their errors"
        tables.append(vector_table(record, title, worst_vectors(record)))
    if record.types:
        title = "Statistics by type: normalised residuals, the largest standardised one, factor of the sigmas"
        tables.append(rows.statistics_table(title, "type", record.types))
    if record.setups:
        tables.append(rows.statistics_table("Statistics by station", "from", record.setups))
    if any(point.known or point.moved or point.inner for point in record.points):
        tables.append(rows.moved_table(record))
    if record.undetermined:
        tables.append(rows.motion_table(record.undetermined))
    known = worst_constraints_first(record)
    if known:
        title = "Known coordinates, the worst normalised residual first"
        tables.append(rows.constraint_table(record, title, known))
    tables += quality_tables(record)
    parts = (_head(record), warnings(record, len(record.warnings)), notes(record))
    heads = ["\n".join(wrapped(part)) for part in parts]
    sections = [*heads, *("\n".join(lines_of(table)) for table in tables)]
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
