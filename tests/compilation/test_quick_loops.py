"""Loops that Python calls as builtins: what they take, what they leave alone, and what they return."""

import gc
import sys
from threading import Thread
from typing import Any

import numpy as np
import pytest
from probes import Doubling, double_all, double_record

from obseq.compilation import loops

pytestmark = pytest.mark.skipif(not loops.HAS_BUILTINS, reason="objects have another layout in this Python")


@pytest.fixture(scope="module")
def double() -> Any:
    return double_all.builtin


def test_the_last_array_is_returned_when_it_is_done(double: Any) -> None:
    x, doubled = np.arange(5.0), np.empty(5)
    assert double(x, doubled) is doubled
    np.testing.assert_array_equal(doubled, 2.0 * x)
    assert double.__name__ == "double_all"


def _read_only() -> np.ndarray:
    array = np.zeros(3)
    array.flags.writeable = False
    return array


@pytest.mark.parametrize(
    "doubled",
    [
        [0.0] * 3,
        None,
        np.zeros(4),
        np.zeros(3, np.int64),
        np.zeros((3, 1)),
        np.zeros(6)[::2],
        np.zeros(3, ">f8"),
        np.ma.zeros(3),
        _read_only(),
    ],
    ids=["list", "nothing", "length", "type", "dimensions", "gaps", "order", "subclass", "read only"],
)
def test_other_arrays_are_left_alone(double: Any, doubled: Any) -> None:
    x, before = np.ones(3), str(doubled)
    assert double(x, doubled) is x
    assert str(doubled) == before


def test_a_wrong_number_of_arguments_is_an_error(double: Any) -> None:
    for arguments in ((), (np.ones(3),), (np.ones(3),) * 3):
        with pytest.raises(SystemError):
            double(*arguments)


def test_a_usual_call_works_with_records_too() -> None:
    record = Doubling(np.arange(5.0), np.zeros(5))
    assert double_record(record) == 0
    np.testing.assert_array_equal(record.doubled, 2.0 * record.x)


def test_a_usual_call_tells_what_is_wrong() -> None:
    with pytest.raises(TypeError, match=r"double_all: doubled: float64\[:\] is wanted.*read only"):
        double_all(np.zeros(3), _read_only())
    with pytest.raises(TypeError, match=r"record\.doubled.* not ndarray of int64"):
        double_record(Doubling(np.zeros(3), np.zeros(3, np.int64)))
    with pytest.raises(TypeError, match="takes 2 arguments"):
        double_all(np.zeros(3))  # type: ignore[call-arg]
    with pytest.raises(RuntimeError, match="did nothing"):
        double_all(np.zeros(3), np.zeros(4))


def test_references_are_counted(double: Any) -> None:
    x, doubled = np.ones(3), np.empty(3)
    gc.collect()
    before = [sys.getrefcount(array) for array in (x, doubled, np.ndarray)]
    for _ in range(100):
        double(x, doubled)
        double(x, x[:2])
    assert [sys.getrefcount(array) for array in (x, doubled, np.ndarray)] == before


def test_several_threads_may_call_it(double: Any) -> None:
    places = [np.empty(3) for _ in range(4)]
    threads = [Thread(target=double, args=(np.full(3, float(k)), place)) for k, place in enumerate(places)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    np.testing.assert_array_equal(places, [[2.0 * k] * 3 for k in range(4)])
