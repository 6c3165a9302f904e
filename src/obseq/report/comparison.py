"""The summary of two epochs: what has moved, how far, and how sure that is."""

from collections.abc import Iterator, Sequence

from obseq.arguments import TEXTS, expecting, instance
from obseq.printable import listed, printable
from obseq.records.comparison import ComparisonRecord, TestRecord
from obseq.report import units
from obseq.report.content_comparison import displacements
from obseq.report.result_file import text_of
from obseq.report.writer import Writer
from obseq.spreadsheets import csv_text

MOST_POINTS = 20
MOST_NAMES = 8
MOST_OBSTACLES = 5
KEYS = (
    "point", "verdict", "east", "north", "up", "s east", "s north", "s up", "length", "test", "limit",
)  # fmt: skip
"""Columns of displacements on the terminal."""
KNOWN = "known points"
DATUMS = {KNOWN: "the known points that have stayed, by what the observations alone say"}


@expecting(record=instance(ComparisonRecord), written=TEXTS)
def comparison_summary(
    record: ComparisonRecord, written: Sequence[str] = (), most: int | None = MOST_POINTS
) -> str:
    """The summary of a comparison.

    Args:
        record: The comparison.
        written: Names of the files where the results were written.
        most: How many points are listed; None: all.
    """
    sections = (
        _verdict(record),
        _table(record, most),
        _rest(record, most),
        _sigma0(record),
        [f"written: {', '.join(written)}"] if written else [],
    )
    texts = ("\n".join(section) for section in sections)
    return printable("\n\n".join(text for text in texts if text) + "\n")


def comparison_json(record: ComparisonRecord) -> str:
    """The text of the file of a comparison: valid JSON, floats exact."""
    return text_of(record)


def comparison_csv(record: ComparisonRecord) -> str:
    """The displacements as a table, metres, one point per line; no verdict where there are obstacles."""
    header = (
        "point,x,y,z,east,north,up,s_east,s_north,s_up,statistic,limit,p_value,p_all,significant,reference"
    )
    rows = [header.split(",")]
    for row in record.displacements:
        numbers = (row.x, row.y, row.z, row.east, row.north, row.up, row.s_east, row.s_north, row.s_up)
        test = (row.test.statistic, row.test.limit, row.test.p_value) if row.test else ("", "", "")
        cells = [row.point, *("" if number is None else repr(number) for number in numbers), *map(str, test)]
        verdict = "" if record.obstacles else str(int(row.is_significant))
        overall = "" if row.overall is None else repr(row.overall)
        rows.append([*cells, overall, verdict, str(int(row.is_reference))])
    return csv_text(rows)


def _verdict(record: ComparisonRecord) -> Iterator[str]:
    yield from _grounds(record)
    if record.obstacles:
        return
    common = len(record.displacements)
    yield f"{common} common points; datum: {DATUMS.get(record.datum, record.datum)}"
    kind = "known" if record.datum == KNOWN else "reference"
    if record.moved:
        yield f"  {kind} points that have MOVED, the worst first: {', '.join(record.moved)}"
    if record.undecided:
        also = " too" if record.moved else ""
        names = ", ".join(record.undecided)
        yield f"  one or more of the {kind} points {names} MOVED{also}, and nothing tells which"
    others = f"the other {kind} points" if record.moved or record.undecided else f"the {kind} points"
    which = "the points together" if record.datum == "as adjusted" else others
    state = "have stayed" if record.congruence.passed else "have MOVED"
    yield f"  {which} {state}: {_tested(record.congruence)}"
    yield from (f"  {text}" for text in movements(record))


def movements(record: ComparisonRecord) -> Iterator[str]:
    """What has moved, all points judged together; and what only its own test tells."""
    tested = sum(row.overall is not None for row in record.displacements)
    moved = [row for row in record.displacements if row.is_significant]
    marginal = [row.point for row in record.displacements if row.is_marginal]
    small = units.Units(record.units).small_length
    if len(moved) == 1:
        yield f"{moved[0].point} has moved by {small.text(moved[0].length)}"
    elif moved:
        names = listed([row.point for row in moved], MOST_NAMES)
        yield f"{len(moved)} of {tested} points have moved: {names}"
    else:
        yield f"none of {tested} points has moved significantly"
    if marginal:
        expected = f"{record.level * tested:.1f} of {tested} are by chance"
        yield f"just above the limit of its own test: {listed(marginal, MOST_NAMES)} ({expected})"


def _grounds(record: ComparisonRecord) -> Iterator[str]:
    """What forbids a verdict, or what it rests on."""
    obstacles = record.obstacles
    if obstacles:
        yield "NO VERDICT on movements:"
        yield from (f"  {text}" for text in obstacles[:MOST_OBSTACLES])
        if len(obstacles) > MOST_OBSTACLES:
            yield f"  and {len(obstacles) - MOST_OBSTACLES} more; the files of --out have them"
        yield "The displacements below carry these errors."
    else:
        yield from (f"Warning: {text}" for text in record.reservations)


def _tested(test: TestRecord) -> str:
    return (
        f"statistic {test.statistic:.3f}, limit {test.limit:.3f} with {test.freedom} degrees of freedom, "
        f"probability {test.p_value:.3g}"
    )


def _table(record: ComparisonRecord, most: int | None) -> Iterator[str]:
    writer = Writer([row.point for row in record.displacements], units.Units(record.units))
    rows = range(len(record.displacements))[:most]
    title = f"Displacements, second epoch minus first, tested at {100 * record.level:g} %"
    yield from writer.lines(displacements(record), rows, KEYS, title)


def _rest(record: ComparisonRecord, most: int | None) -> Iterator[str]:
    more = len(record.displacements) - (len(record.displacements) if most is None else most)
    if more > 0:
        yield f"and {more} more points; the files of --out have them"
    for which, names in (("first", record.only_first), ("second", record.only_second)):
        if names:
            yield f"only in the {which} epoch: {listed(names, MOST_NAMES)}"


def _sigma0(record: ComparisonRecord) -> Iterator[str]:
    if record.sigma0 is None:
        yield "The given sigmas are trusted."
    else:
        yield f"sigma0 of both epochs {record.sigma0:.5g}, redundancy {record.redundancy}"
    test = record.same_precision
    if test is not None and not test.passed:
        yield (
            f"Warning: the epochs differ in precision (ratio of variance factors {test.statistic:.3f}, "
            f"limit {test.limit:.3f})"
        )
