"""Rows of cells under a line of names: separators, padding, remarks that are told."""

import pytest

from obseq.errors import InputError
from obseq.reading.tables import Table


def table(folder, text):
    (folder / "t.csv").write_text(text)
    return Table.read(folder / "t.csv")


@pytest.mark.parametrize(
    "text",
    [
        "a,b\n1,x y\n",
        "A;B\n1;x y\n",
        "a\tb\n1\tx y\n",
        "sep=;\na;b\n1;x y\n",
        'a,b,\n1,"x y",\n,,\n',
        "a b\n\n1 xy\n",
    ],
)
def test_what_separates_cells_is_told_by_the_names(tmp_path, text):
    found = table(tmp_path, text)
    assert found.columns == ("a", "b")
    assert found.texts("a") == ["1"]
    assert found.texts("b")[0].replace(" ", "") == "xy"


def test_remarks_that_look_like_rows_are_told(tmp_path, logged):
    """A remark of two words is none of three columns; two lines are rows, or were."""
    found = table(tmp_path, "# by hand\nname,x,y\nA,1,2\n#B,3,4\n# note here\n#C,5,6\nD,7,8\n")
    assert found.texts("name") == ["A", "D"]
    assert found.lines == (3, 7)
    (told,) = [record.getMessage() for record in logged]
    assert "2 rows that begin with # are left out as remarks: line 4 is the first" in told


def test_decimal_commas_are_recognised(tmp_path):
    with pytest.raises(InputError, match=r"t\.csv:2: 3 cells for 2 columns; the comma separates cells"):
        table(tmp_path, "a,b\n1,2,5\n")


def test_a_name_with_a_line_end_in_it_is_told(tmp_path):
    with pytest.raises(InputError, match=r"t\.csv:2: .*a quote is open at the end of the line"):
        table(tmp_path, 'type,a,b\nDist,"P\nQ",1\n')


@pytest.mark.parametrize("text", ["1_000", "\u0661\u0662", "0x10", "1e400"])
def test_numbers_are_written_in_digits_of_ascii(tmp_path, text):
    with pytest.raises(InputError, match=r"t\.csv:2: b is .*which is no finite number"):
        table(tmp_path, f"a,b\nA,{text}\n").numbers("b")


@pytest.mark.parametrize("hidden", ["\0", "\u200b", "\u00a0"])
def test_a_cell_that_holds_what_nobody_sees_is_refused(tmp_path, hidden):
    with pytest.raises(InputError, match=r"t\.csv:2: a cell holds .*which nobody sees"):
        table(tmp_path, f"a,b\nA{hidden}B,1\n")
