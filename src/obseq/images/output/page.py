"""The page of an adjusted block: one page for networks and blocks, made of the record of the block."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from obseq.images.output.arrays import BlockArrays, arrays_of, suspected_measures
from obseq.images.output.block_record import BundleRecord
from obseq.images.output.page_charts import cameras, frames
from obseq.images.output.page_findings import findings
from obseq.images.output.page_instruments import INSTRUMENTS
from obseq.images.output.page_plan import plan
from obseq.images.output.page_tables import TABLES, names_of, tables
from obseq.report.findings import NOT_JUDGED
from obseq.report.head import (
    UNCHECKED,
    UNEXPLAINED,
    WORDS,
    Card,
    Head,
    Level,
    Page,
    Place,
    Section,
    Verdict,
    about,
    convergence,
    counted,
    joined,
    misfit,
    page_of,
    redundancy_card,
    sigma0_card,
    strip,
    to_check,
)
from obseq.report.page import document
from obseq.report.result_columns import write_columns
from obseq.report.result_file import write_json
from obseq.report.said import name, small
from obseq.report.summary import Outcome, listing
from obseq.report.tables.units import METRIC, significant
from obseq.writing import Content


def page(record: BundleRecord) -> str:
    """The report of a block as an HTML document that loads nothing."""
    return document(shown(record))


def shown(record: BundleRecord) -> Page:
    """All that the page of a block shows."""
    block, names = arrays_of(record), names_of(record)
    return page_of(_head(record, block), names, plan(record, block), tables(record))


def outcome(record: BundleRecord) -> Outcome:
    """A block as reports tell it."""
    made = partial(tables, record)
    return Outcome(_head(record, arrays_of(record)), names_of(record), METRIC, tuple(TABLES), made)


def text(record: BundleRecord) -> str:
    """The listing of a block: every finding, fact and table."""
    return listing(outcome(record))


def contents(record: BundleRecord) -> dict[str, Callable[[], Content]]:
    """What makes the files of a block, by the names of the formats of results."""
    return {
        "json": lambda: partial(write_json, record=record),
        "html": lambda: page(record),
        "text": lambda: text(record),
        "npz": lambda: partial(write_columns, record=record),
    }


def _head(record: BundleRecord, block: BlockArrays) -> Head:
    lists = findings(record)
    return Head(
        "block",
        "Image block",
        about("Image block", record.run),
        record.run.identifier,
        {"length": "m", "angle": "gon"},
        _verdict(record),
        tuple(_cards(record, block)),
        lists,
        tuple(_sections(record, block)),
        None if record.reliability is None else record.reliability.critical,
        lists[0].items[0].to if lists and lists[0].title == "Suspected errors" else None,
    )


def _verdict(record: BundleRecord) -> Verdict:
    control = sum(point.kind == "control" for point in record.points)
    detail = joined(
        [
            f"{counted(len(record.images), 'image')}, {counted(len(record.cameras), 'camera')}",
            f"{control} control and {len(record.points) - control} tie points",
            f"redundancy {record.redundancy}",
            ("" if record.converged else "NOT CONVERGED after ")
            + counted(len(record.iterations), "iteration"),
        ]
    )
    return Verdict(*_judged(record), detail)


def _judged(record: BundleRecord) -> tuple[Level, str]:
    """Level and sentence of what decides: the first of these that holds."""
    diagnosis, test = record.diagnosis, record.global_test
    if not record.converged:
        return "bad", f"Not usable: {name(record.stopped)}."
    count = 0 if diagnosis is None else len(diagnosis.accused)
    if count:
        return "bad", to_check(count)
    if diagnosis is not None and diagnosis.status in ("undecided", "unexplained"):
        return "bad", UNEXPLAINED
    if any(item.is_off for item in record.check_points):
        return "bad", "Not usable yet: check points are farther off than chance lets them be."
    if record.rejected_shares:
        return (
            "bad",
            f"Not usable yet: most residuals of {name(record.rejected_shares[0].text)} are rejected.",
        )
    if record.weak:
        weak = record.weak.rstrip(".")
        return "warn", f"Adjusted without precisions: {name(weak)}."
    if record.failures:
        return "warn", NOT_JUDGED
    if not record.is_complete:
        return "warn", "Usable, but not all of it took part: see the findings."
    if test is not None and not test.passed:
        return "warn", misfit(test)
    if record.redundancy <= 0:
        return "warn", UNCHECKED
    return "ok", "The block is sound: residuals fit the sigmas, and no error is suspected."


def _cards(record: BundleRecord, block: BlockArrays) -> Iterator[Card]:
    yield _sigma0(record)
    lengths = np.linalg.norm(block.residuals, axis=1)
    rms = float(np.sqrt(np.mean(block.residuals**2))) if lengths.size else 0.0
    given = f"px rms; {float(np.median(block.sigmas)):.2g} given" if lengths.size else "px"
    yield Card(
        "image residuals",
        f"{rms:.3g}",
        given,
        None,
        strip(lengths.tolist()),
        f"{lengths.size} image points, per coordinate",
        Place("measures"),
    )
    if record.reliability is not None:
        yield from _tests(record, record.reliability.critical)
    if block.covariances is not None and len(record.points):
        sigmas = np.sqrt(np.clip(np.diagonal(block.covariances, axis1=1, axis2=2).max(axis=1), 0.0, None))
        worst = int(np.argmax(sigmas))
        yield Card(
            "weakest point",
            small(float(sigmas[worst])),
            "",
            None,
            strip(sigmas.tolist()),
            f"{name(record.points[worst].name)}, its worst coordinate",
            Place(point=worst),
        )
    parts = None
    if record.reliability is not None:
        parts = [*record.measures.values("redundancy_x"), *record.measures.values("redundancy_y")]
    yield redundancy_card(record.redundancy, record.n_observations, parts, "measures")


def _sigma0(record: BundleRecord) -> Card:
    test = record.global_test
    if test is None:
        return Card("sigma0", significant(record.sigma0, 4), note=name(untested(record)))
    note, diagnosis = "", record.diagnosis
    if diagnosis is not None and diagnosis.accused and diagnosis.sigma0 is not None:
        note = f"{diagnosis.sigma0:.3g} without the suspected errors"
    return sigma0_card(test, note)


def untested(record: BundleRecord) -> str:
    """Why sigma0 is not tested, and what says in its place whether the sigmas are right."""
    if record.redundancy <= 0:
        return "not tested: no redundancy, nothing checks the result"
    if record.reliability is None:
        return "not tested: robust weights"
    spread = record.reliability.largest.spread
    return f"not tested: robust weights; most residuals are {spread:.3g} times what the sigmas say"


def _tests(record: BundleRecord, limit: float) -> Iterator[Card]:
    assert record.reliability is not None
    w = np.column_stack([record.measures.numbers("w_x"), record.measures.numbers("w_y")])
    worst = np.abs(np.nan_to_num(w)).max(axis=1)
    if len(worst):
        row = int(np.argmax(worst))
        beyond = record.reliability.beyond
        tag = ("warn", f"{beyond} beyond") if beyond else ("ok", "none beyond")
        measure = record.measures[row]
        note = f"{measure.image} \u00b7 {measure.point}"
        yield Card(
            "largest w",
            f"{worst[row]:.2f}",
            f"limit {limit:.2f}",
            tag,
            strip(worst.tolist(), limit),
            name(note),
            Place("measures", row=row),
        )


def _sections(record: BundleRecord, block: BlockArrays) -> Iterator[Section]:
    marked = suspected_measures(record)
    drawn, whole = tuple(frames(record, block, marked)), len(record.images)
    some = f"The {len(drawn)} of {whole} images with the largest residuals; the table of images has all."
    yield Section("frames", "Image residuals", drawn, note=some if len(drawn) < whole else "")
    yield Section("calibration", "Calibration", tuple(cameras(record, block, marked)), tables=("parameters",))
    if any((record.rigid_blocks, record.clinometers, record.antennas, record.shutters)):
        yield Section("instruments", "Instruments", tables=INSTRUMENTS)
    charts = []
    if record.reliability is not None:
        charts = [{"kind": kind, "table": "measures", "column": "w"} for kind in ("histogram", "normal")]
    yield Section("quality", "Quality", (*charts, convergence(record.iterations)))
    yield Section("provenance", "Provenance", facts=tuple(_facts(record)), words=WORDS)


def _facts(record: BundleRecord) -> Iterator[tuple[str, str]]:
    yield "run", f"{record.run.identifier}, {record.run.created}"
    yield "versions", ", ".join(f"{package} {version}" for package, version in record.run.versions.items())
    yield "precisions", record.precision
    yield (
        "equations",
        f"{record.n_observations}, unknowns {record.n_unknowns}, redundancy {record.redundancy}",
    )
    yield "sums of squares", ", ".join(f"{kind} {value:.6g}" for kind, value in record.squares.items())
    if record.frame:
        yield "frame", name(record.frame)
    yield "stopped", name(record.stopped)
