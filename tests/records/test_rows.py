"""Lists of records as columns and back: every kind of field, with and without values."""

import msgspec
import numpy as np
import pytest

from obseq.errors import InputError
from obseq.records.columns import Texts, fields_of, names_of
from obseq.records.record import Record, from_plain, to_plain
from obseq.records.rows import Rows, hold_as_columns


class Part(Record, frozen=True):
    size: float
    name: str


class Item(Record, frozen=True):
    label: str = msgspec.field(name="called")
    value: float
    count: int
    is_used: bool
    known: float | None = None
    place: int | None = None
    is_good: bool | None = None
    near: str | None = None
    moved: tuple[float | None, ...] | None = None
    part: Part | None = None


class Whole(Record, frozen=True, omit_defaults=False):
    items: Rows[Item]
    more: Rows[Item] | None = None

    def __post_init__(self) -> None:
        hold_as_columns(self)


ITEMS = (
    Item("a", -0.0, 3, True, 1.5, 7, False, "b", (1.0, None, 2.0), Part(2.0, "p")),
    Item("b", 1e300, -4, False),
    Item("a", 5e-324, 2**53 + 1, True, 0.1 + 0.2, -1, True, "", (None, None, None), Part(-1.0, "")),
)
NAMES = [
    "called", "value", "count", "is_used", "known", "place", "is_good", "near",
    "moved", "moved.there", "part.size", "part.name", "part.there",
]  # fmt: skip


def columns(rows: Rows[Item]) -> Rows[Item]:
    """The same list, of which only the columns are known."""
    return Rows.of(Item, dict(rows.columns), len(rows))


def test_every_kind_of_field_comes_back_to_the_bit() -> None:
    given = Rows(Item, ITEMS)
    assert list(names_of(fields_of(Item))) == NAMES
    found = columns(given)
    assert list(found) == list(ITEMS)
    assert str(found[0].value) == "-0.0"
    assert [found[k] for k in (0, 1, 2, -1)] == [*ITEMS, ITEMS[-1]]
    with pytest.raises(IndexError):
        found[3]


def test_rows_equal_tuples_of_the_same_records_and_no_others() -> None:
    found = columns(Rows(Item, ITEMS))
    assert found == ITEMS
    assert found != ITEMS[:2]
    assert found != (*ITEMS[:2], msgspec.structs.replace(ITEMS[2], place=None))


def test_columns_by_either_name_of_a_field() -> None:
    for rows in (Rows(Item, ITEMS), columns(Rows(Item, ITEMS))):
        assert rows.texts("label").codes.tolist() == rows.texts("called").codes.tolist() == [0, 1, 0]
        np.testing.assert_array_equal(rows.numbers("known"), [1.5, np.nan, 0.1 + 0.2])
        np.testing.assert_array_equal(rows.numbers("place"), [7, np.nan, -1])
        np.testing.assert_array_equal(rows.numbers("part.size"), [2.0, np.nan, -1.0])
        assert rows.truths("is_good").tolist() == [False, False, True]
        assert rows.values("is_good") == [False, None, True]
        assert rows.values("moved") == [(1.0, None, 2.0), None, (None, None, None)]
        assert rows.values("near") == ["b", None, ""]
        assert rows.values("part") == [Part(2.0, "p"), None, Part(-1.0, "")]


def test_some_rows_know_the_list_they_were_taken_from() -> None:
    for rows in (Rows(Item, ITEMS), columns(Rows(Item, ITEMS))):
        some = rows.take([2, 0])
        assert list(some) == [ITEMS[2], ITEMS[0]]
        assert some.whole is rows
        assert rows[::-1] == tuple(reversed(ITEMS))
        assert list(rows.take([])) == []


def test_lists_one_after_the_other_have_one_table_of_texts() -> None:
    parts = [columns(Rows(Item, ITEMS[:1])), Rows(Item), columns(Rows(Item, ITEMS[1:]))]
    found = Rows.joined(Item, parts)
    assert found == ITEMS
    assert found.texts("called").names == ["a", "b"]
    assert len(Rows.joined(Item, [Rows(Item)])) == 0


def test_a_column_that_one_of_the_lists_lacks_is_filled_with_what_its_records_have() -> None:
    few = columns(Rows(Item, ITEMS[1:2])).without(*NAMES[4:])
    assert Rows.joined(Item, [few, columns(Rows(Item, ITEMS[2:]))]) == ITEMS[1:]


def test_changed_and_missing_columns() -> None:
    found = columns(Rows(Item, ITEMS)).changed({"value": np.array([1.0, 2.0, 3.0])})
    assert [row.value for row in found] == [1.0, 2.0, 3.0]
    less = found.without("part", "near", "moved")
    assert (less[0].part, less[0].near, less[0].moved, less[0].place) == (None, None, None, 7)
    with pytest.raises(InputError, match="the column count is missing"):
        found.without("count")[0]


def test_records_hold_tuples_as_rows_and_read_them_from_files() -> None:
    made = Whole(ITEMS)  # type: ignore[arg-type]
    assert isinstance(made.items, Rows)
    assert from_plain(Whole, to_plain(made), "x") == made
    assert from_plain(Whole, to_plain(msgspec.structs.replace(made, more=made.items)), "x").more == ITEMS
    with pytest.raises(InputError, match=r"x: items\[1\].value: Expected `float`"):
        from_plain(Whole, {"items": [to_plain(ITEMS[0]), to_plain(ITEMS[1]) | {"value": "2"}]}, "x")


def test_texts_are_codes() -> None:
    found = Rows.of(Part, {"size": np.ones(2), "name": Texts(np.array([1, 0], np.int32), ["x", "y"])}, 2)
    assert list(found) == [Part(1.0, "y"), Part(1.0, "x")]
