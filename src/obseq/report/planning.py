"""The summary of a plan: how it was checked, where it is weak, and what one more observation would bring."""

from collections.abc import Iterator, Sequence

from obseq.arguments import TEXTS, expecting, instance
from obseq.printable import printable
from obseq.records.plan import DrawsRecord, PlanRecord
from obseq.report.content import numbers_of
from obseq.report.content_plan import plan_tables
from obseq.report.result_file import text_of
from obseq.report.summary import left_out, notes, warnings
from obseq.report.units import units_of
from obseq.report.writer import Writer

MOST_WARNINGS = 3


@expecting(record=instance(PlanRecord), written=TEXTS)
def plan_summary(record: PlanRecord, written: Sequence[str] = ()) -> str:
    """The summary of a plan.

    Args:
        record: The plan.
        written: Names of the files where the results were written.
    """
    rows = numbers_of(record.adjustment)
    writer = Writer(list(rows), units_of(record.adjustment))
    sections = (
        _counts(record),
        *(writer.lines(table) for table in plan_tables(record, rows)),
        () if record.weakest_observations else ("Every observation is well controlled by the others.",),
        draws_told(record.draws),
        warnings(record.adjustment, MOST_WARNINGS),
        notes(record.adjustment),
        [f"written: {', '.join(written)}"] if written else [],
    )
    texts = ("\n".join(section) for section in sections)
    return printable("\n\n".join(text for text in texts if text) + "\n")


def plan_json(record: PlanRecord) -> str:
    """The text of the file of a plan: valid JSON, floats exact."""
    return text_of(record)


def _counts(record: PlanRecord) -> Iterator[str]:
    planned = record.adjustment
    yield f"{len(planned.points)} points, {len(planned.stations)} stations, planned"
    yield from left_out(planned)
    yield f"  observations {planned.n_observations:>8}"
    yield f"  constraints  {planned.n_constraints:>8}   coordinates given with a sigma"
    yield f"  unknowns     {planned.n_unknowns:>8}"
    yield f"  redundancy   {planned.redundancy:>8}"


def draws_told(draws: DrawsRecord | None) -> Iterator[str]:
    """What adjustments of drawn observations say of the prediction."""
    if draws is None:
        return
    verdict = "agree with the prediction" if draws.agrees else "DO NOT AGREE with the prediction"
    yield f"{draws.draws} adjustments of drawn observations {verdict}"
    yield f"  squared errors over predicted ones  {draws.ratio:.4f}  (1 is expected)"
    yield (
        f"  worst point {draws.worst_point}: {draws.worst_ratio:.4f}, probability among all points "
        f"{draws.p_value:.3g}"
    )
    if draws.sigma0 is not None:
        yield f"  sigma0 {draws.sigma0:.4f}  (1 is expected)"
    if draws.failed:
        yield f"  {draws.failed} did not converge and do not count"
