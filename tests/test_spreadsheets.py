"""Tables that a spreadsheet opens: no cell is computed, and what was written is read again."""

import ast
import csv
from pathlib import Path

import pytest
from sources import nodes

import obseq
from obseq.cli.main import main
from obseq.spreadsheets import cell_of, csv_text, text_in

FORMULAS = ("=HYPERLINK(1)", "+A1", "-A1", "@SUM(A1)", " =1+1", "'=1", "''@x", "=1,2", '="a"')
HARMLESS = ("A1", "-12.5e3", "'", "'A", "", "a=b", "1-2", "P é")


@pytest.mark.parametrize("text", FORMULAS)
def test_a_formula_is_a_text_and_comes_back(text):
    assert cell_of(text) == f"'{text}" and text_in(cell_of(text)) == text
    (row,) = csv.reader(csv_text([(text, 1.5)]).splitlines())
    assert row == [f"'{text}", "1.5"]


@pytest.mark.parametrize("text", HARMLESS)
def test_what_is_no_formula_stays(text):
    assert cell_of(text) == text_in(text) == text


def test_what_cannot_be_printed_is_an_escape():
    assert cell_of("a\x1b[2J\t\r") == "a\\x1b[2J\\t\\r"


def test_names_of_points_are_neutral_in_exports_and_come_back(tmp_path, capsys):
    places = {"-A": (0, 0, 0), "=B": (100, 0, 1), "+C1": (0, 100, 2), "@D": (60, 50, 3)}
    known = "".join(f"1 {name} {x} {y} {z} 0.01 0.01 0.01\n" for name, (x, y, z) in places.items())
    (tmp_path / "n.cor").write_text(known)
    (tmp_path / "n.obs").write_text("3 -A =B 100 0.01\n3 -A +C1 100 0.01\n3 -A @D 78.1 1\n")
    read = ["--obs", str(tmp_path / "n.obs"), "--cor", str(tmp_path / "n.cor")]
    out = [str(tmp_path / name) for name in ("n.csv", "n.obs.csv", "back.cor", "back.obs")]
    assert main(["convert", *read, "--to", *out[:2]]) == 0
    for line in (tmp_path / "n.csv").read_text().splitlines() + (
        tmp_path / "n.obs.csv"
    ).read_text().splitlines():
        for cell in next(csv.reader([line])):
            assert cell[:1] not in "=+-@" or not cell or float(cell) is not None
    assert main(["convert", *out[:2], "--to", *out[2:]]) == 0
    names = [line.split()[1] for line in (tmp_path / "back.cor").read_text().splitlines()]
    assert names == list(places)


def test_tables_are_written_in_one_place():
    """Whoever writes names in CSV asks `spreadsheets`."""
    package = Path(obseq.__file__).parent
    rooms = ("cli", "formats", "images", "project", "reading", "report", "survey", "targets")
    wrong = [
        f"{path.relative_to(package)}:{node.lineno}"
        for room in rooms
        for path in sorted((package / room).rglob("*.py"))
        for node in nodes(path, ast.Attribute)
        if isinstance(node.value, ast.Name)
        and (node.value.id, node.attr) in {("csv", "writer"), ("csv", "DictWriter")}
    ]
    assert wrong == []
