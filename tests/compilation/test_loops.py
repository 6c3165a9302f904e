"""Compiled loops called from Python: what they take, what they refuse, and when they are compiled."""

import subprocess
import sys
from pathlib import Path
from threading import Thread

import numpy as np
import pytest
from probes import Pair, first_of_pair, scaled_sum

from obseq.compilation import compiled
from obseq.compilation.signatures import signature_of


def test_numbers_and_arrays_of_any_kind_of_number() -> None:
    x = np.arange(5.0)
    assert scaled_sum(x, 3, True, 2.0) == 3 * 2.0 * 10.0
    assert scaled_sum(x, np.int64(3), np.bool_(True), np.float32(2.0)) == 60.0
    assert scaled_sum(x, 3, False, 2.0) == 10.0
    assert scaled_sum(np.empty(0), 3, True, 2.0) == 0.0


def test_named_tuples_are_taken_as_they_are() -> None:
    pair = Pair(np.arange(3.0), np.arange(6.0).reshape(2, 3), 7)
    assert first_of_pair(pair) == 0.0 + 5.0 + 7.0


@pytest.mark.parametrize(
    ("array", "found"),
    [
        ([1.0], "not list"),
        (None, "not NoneType"),
        (np.arange(3), "of int64 with 1 dimensions"),
        (np.ones((2, 2)), "of float64 with 2 dimensions"),
        (np.ones(8)[::2], "not contiguous"),
        (np.ones(3, dtype=">f8"), "of >f8 with 1"),
        (np.ma.array([1.0]), "MaskedArray of float64"),
    ],
)
def test_other_arrays_are_refused_by_name(array: object, found: str) -> None:
    with pytest.raises(TypeError, match=rf"scaled_sum: x: float64\[:\] is wanted.*{found}"):
        scaled_sum(array, 3, True, 2.0)


def test_wrong_numbers_are_refused() -> None:
    with pytest.raises(TypeError):
        scaled_sum(np.ones(2), 1.5, True, 2.0)
    with pytest.raises(TypeError, match="4 arguments"):
        scaled_sum(np.ones(2), "3", True)


def test_annotations_that_machine_code_does_not_know_are_refused() -> None:
    def returns_an_array(x: "FloatArray") -> "FloatArray":  # noqa: F821
        return x

    with pytest.raises(TypeError, match="returns int, float or None"):
        signature_of(returns_an_array)

    def plain(x) -> None:  # type: ignore[no-untyped-def]
        pass

    with pytest.raises(TypeError, match="plain: x: None is not what a loop can be given"):
        signature_of(plain)


def test_what_a_loop_may_name() -> None:
    place = Path(__file__)

    def names_a_path() -> int:
        return len(place.name)

    with pytest.raises(TypeError, match="place: compiled functions may name constants"):
        _ = compiled(names_a_path).digest


def test_the_first_call_may_come_from_several_threads() -> None:
    results: list[float] = []
    loop = compiled(scaled_sum.python)
    threads = [Thread(target=lambda: results.append(loop(np.ones(4), 1, True, 0.5))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == [2.0] * 4


def test_nothing_loads_a_compiler_before_a_loop_is_called() -> None:
    script = (
        "import importlib, sys, obseq\n"
        "for room in ('kernels.tiles', 'kernels.functions', 'leastsquares.loops.accumulation', 'survey',"
        " 'leastsquares.loops.schur_complement', 'leastsquares.solvers.cholesky', 'leastsquares'):\n"
        "    importlib.import_module('obseq.' + room)\n"
        "obseq.calculator('TopoHz')\n"
        "print(sorted({'numba', 'llvmlite'} & sys.modules.keys()))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
