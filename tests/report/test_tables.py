"""Every table in every unit: text, page, CSV and JSON agree to the digit."""

import csv
import io
import itertools
import sys
from importlib.resources import files
from pathlib import Path

import browsing
import pytest
from msgspec import structs

from obseq.images.output.block_record import BlockLeftOutRecord, BundleRecord
from obseq.images.output.instruments import (
    ClinometerRecord,
    ExposureRecord,
    PairRecord,
    PlaceRecord,
    RigidRecord,
)
from obseq.images.output.page import shown as shown_block
from obseq.images.output.page_tables import TABLES as OF_BLOCKS
from obseq.images.output.record import record_of
from obseq.records.adjustment import AdjustmentRecord, JointTestRecord, VarianceComponentRecord
from obseq.records.record import from_plain, to_plain
from obseq.records.shown_units import ANGLES, METRES, ShownUnits
from obseq.report import compared, planned
from obseq.report.head import Page
from obseq.report.page import adjustment_page, document
from obseq.report.tables.content import TABLES as OF_NETWORKS
from obseq.report.tables.content_plan import PLAN_TABLES
from obseq.report.tables.units import MIXED, Scale, Sexagesimal, Units, fixed, significant
from obseq.report.writer import Writer
from obseq.survey import Datum, Network, Quality, compare, plan, simulate

EVERYTHING = Quality(relative=True, ellipsoids=True, effects=True, inner=True)
DECLARED = {
    "adjustment": "observations vectors points known stations by-type by-station ellipsoids relative "
    "components",
    "free": "undetermined",
    "plan": "weakest weak gains",
    "comparison": "displacements",
    "block": "measures points images parameters check-points rigid pairs exposures clinometers readings "
    "antennas positions shutters tests without",
}
"""Tables that each page has: all that there are."""
LEVER, TURN = (0.123456789, -1.5, 2.0000004), (1.25e-4, -0.0003141592, 0.0)
CARRIED = RigidRecord(
    "rig",
    "left",
    (
        PlaceRecord("left", LEVER, (1.0, 0.0, 0.0, 0.0), None),
        PlaceRecord("right", LEVER, (0.6, 0.8, 0.0, 0.0), (1e-4, 2e-4, 3.5e-4, 1e-5, 2e-5, 0.0)),
    ),
    (PairRecord("left", "right", 0.00123, 0.00045),),
    (ExposureRecord("left", "right", "e1", LEVER, TURN, 0.001, 1e-4),),
)
TILTED = ClinometerRecord(
    "boussole", (0.1, 0.2, 0.97), (0.5, 1.0, 0.0, 0.0), ("a", "b"), (2e-5, -3.5e-4), 3e-4
)
"""What few blocks have: made up, as the vectors are; only how they are written counts."""
CHOSEN = (
    "const [lengths, angles] = arguments; Object.assign(settings, { lengths, angles, language: 'en' });"
    "return Object.fromEntries([...page.tables].map(([id, table]) => {"
    "  table.order = null; table.setFilter(''); return [id, table.csv()]; }))"
)
"""The tables of a page as the CSV that it saves, in some units."""
CELLS = (
    "const [lengths, angles] = arguments; Object.assign(settings, { lengths, angles, language: 'en' });"
    "return Object.fromEntries([...page.tables].map(([id, table]) => [id, table.content.columns.map("
    "  (column) => Array.from({ length: table.size }, (_, row) => String(table.text(column, row))))]))"
)
"""The cells that a page shows of its tables, column by column, in some units."""


def demo() -> Network:
    data = files("obseq.survey") / "data"
    return Network.read(str(data / "demo.obs"), str(data / "demo.cor"), points_crs="IGNF:LAMB93")


def again(record: AdjustmentRecord) -> AdjustmentRecord:
    """The record as its JSON gives it back."""
    return AdjustmentRecord.from_dict(to_plain(record))


@pytest.fixture(scope="module")
def shown() -> dict[str, Page]:
    """The pages of results of each kind, from their JSON."""
    sys.path.insert(0, str(Path(__file__).parents[1] / "images"))
    import flights

    sys.path.pop(0)
    network = demo()
    record = network.adjust(quality=EVERYTHING).record("demo")
    component = VarianceComponentRecord("Dist", 1.44, 0.3, 1.2, 2.0, True)
    vectors = tuple(
        JointTestRecord(
            f"vector PtA -> {name}", "v.obs", line, (), T, 3, 12.625, 0.0055, (T / 1e3, -0.0125, 0.0)
        )
        for line, (name, T) in enumerate((("PtB", 15.125), ("PtC", 0.5)), 7)
    )
    record = structs.replace(record, variance_components=(component,), joint=vectors)
    epochs = [simulate(network, seed=seed).adjust() for seed in (1, 2)]
    block = record_of(flights.flight(n_points=200, noise=0.4).block.solve())
    lost = (BlockLeftOutRecord("tie point", "t9999", "it has 1 ray; a free point takes 2"),)
    block = structs.replace(block, rigid_blocks=(CARRIED,), clinometers=(TILTED,), left_out=lost)
    return {
        "adjustment": adjustment_page(again(record)),
        "free": adjustment_page(again(network.adjust(datum=Datum("inner")).record())),
        "plan": planned.shown(plan(network).record()),
        "comparison": compared.shown(compare(*epochs).record()),
        "block": shown_block(from_plain(BundleRecord, to_plain(block), "the record")),
    }


def test_no_table_is_forgotten() -> None:
    there = {name for names in DECLARED.values() for name in names.split()}
    assert there == {*OF_NETWORKS, *PLAN_TABLES, *OF_BLOCKS, "displacements"}


@pytest.mark.parametrize("kind", DECLARED)
def test_text_page_csv_and_json_agree_to_the_digit(kind, shown, browser, tmp_path) -> None:
    page, path = shown[kind], tmp_path / f"{kind}.html"
    assert {table["id"] for table in page.tables} >= set(DECLARED[kind].split())
    path.write_text(document(page), encoding="utf-8")
    browsing.opened(browser, path)
    for lengths, angles in zip(itertools.cycle(METRES), ANGLES, strict=False):
        writer = Writer(page.names, Units(ShownUnits(lengths, angles)))
        files_of, cells_of = (browser.execute_script(script, lengths, angles) for script in (CHOSEN, CELLS))
        for table in page.tables:
            what = (table["id"], lengths, angles)
            cells = [writer.cells(table, column) for column in table["columns"]]
            assert cells_of[table["id"]] == cells, what
            assert list(rows(files_of[table["id"]])) == list(rows(writer.csv(table))), what
            printed = list(writer.printed(table, range(len(cells[0]))))
            assert all(part.cells in cells for part in printed if part.title != "file"), what
            lines = " ".join(writer.lines(table)).split()
            assert set(" ".join(itertools.chain(*(part.cells for part in printed))).split()) <= set(lines), (
                what
            )


def rows(text: str) -> list[list[str]]:
    return list(csv.reader(io.StringIO(text)))


@pytest.mark.parametrize(
    "value", [0.125, -0.125, 2.5, 12.345, 1e-9, -0.0004, 1234567.891, 0.00012345, 99999.5]
)
def test_ties_and_sizes_are_written_alike(value, shown, browser, tmp_path) -> None:
    path = tmp_path / "a.html"
    path.write_text(document(shown["comparison"]), encoding="utf-8")
    browsing.opened(browser, path)
    scripts = "return [fixed(arguments[0], 2), significant(arguments[0], 4), sexagesimal(arguments[0])]"
    seconds = Sexagesimal("dms", 1.0, 2).number(value)
    assert browser.execute_script(scripts, value) == [fixed(value, 2), significant(value, 4), seconds]


def test_many_numbers_are_written_as_one_is() -> None:
    values = [None, float("nan"), 0.125, -0.125, -0.004, 12.345, *(0.01 * k - 2.0 for k in range(500))]
    scale = Scale("mm", 1.0, 2)
    assert scale.numbers(values) == list(map(scale.number, values))


def test_numbers_of_mixed_columns_have_their_unit_beside_them(shown) -> None:
    table = shown["adjustment"].tables[0]
    assert {column["quantity"] for column in table["columns"]} >= set(MIXED)
    head, first, *_ = rows(Writer(shown["adjustment"].names, Units(ShownUnits())).csv(table))
    assert head[5:9] == ["observed", "unit of observed", "sigma", "unit of sigma"]
    assert float(first[7]) > 0.0 and first[8] in ("mm", "mgon")
