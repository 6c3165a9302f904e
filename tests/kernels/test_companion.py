"""Rows that two threads evaluate: the same digits whoever takes which, at whatever moment."""

import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import obseq
from obseq.kernels import derivatives, shared_rows
from obseq.kernels.companion import Companion, Trend, companion
from obseq.kernels.layout import LANES
from obseq.kernels.tiles import aligned_tiles

SETTINGS = obseq.Calculator.values.__globals__


@pytest.fixture(autouse=True)
def two_processors(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SETTINGS, "processors", lambda: 2)


@pytest.fixture
def always(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever is faster."""
    monkeypatch.setattr(Trend, "shares", lambda _: True)


def evaluated(formula: obseq.Calculator, n: int, threaded: int, monkeypatch) -> list[np.ndarray]:
    """Values, and values with derivatives, of rows that two threads share from so many on."""
    monkeypatch.setitem(SETTINGS, "THREADED_ROWS", threaded)
    rows = derivatives.draw(formula.kernel, n, np.random.default_rng(n))
    return [formula.values(*rows), *formula.values_and_jacobian(*rows)]


@pytest.mark.parametrize("streamed", [0, 1 << 60])
@pytest.mark.parametrize("n", [LANES - 1, 2000, 9001])
@pytest.mark.parametrize("name", ["Dist2DCons", "TopoHz", "TopoSubFrame", "BlocRigid_RE"])
def test_two_threads_give_what_one_gives(name: str, n: int, streamed: int, monkeypatch, always) -> None:
    formula = obseq.calculator(name)
    alone = evaluated(formula, n, 1 << 60, monkeypatch)
    monkeypatch.setitem(SETTINGS, "QUICK_ROWS", 0)
    monkeypatch.setitem(SETTINGS, "STREAMED_BYTES", streamed)
    for _ in range(5):
        for found, expected in zip(evaluated(formula, n, 1, monkeypatch), alone, strict=True):
            np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("streams", [False, True])
def test_the_helper_alone_evaluates_every_row_once(streams: bool) -> None:
    formula, n, chunk = obseq.calculator("TopoHz"), 3 * 512 + 77, 512
    kernel, (u, o) = formula.kernel, derivatives.draw(formula.kernel, n, np.random.default_rng(3))
    values, jacobian = formula.values_and_jacobian(u, o)
    found, derived = np.zeros_like(values), np.zeros((n, len(formula.unknowns)))
    tiles = aligned_tiles(kernel.rows, 1, kernel.constant_rows)
    rows, board = np.empty((LANES if streams else 0, derived.shape[1])), shared_rows.new_board(0)
    address = kernel.value_and_jacobian_address
    shared_rows.offer(board, chunk, address, kernel.rows, u, o, found, derived, tiles, rows)
    assert shared_rows.help_with_rows(board, 1) == 4
    np.testing.assert_array_equal(found, values)
    np.testing.assert_array_equal(derived, jacobian.reshape(n, -1))
    found[:] = 7.0
    assert shared_rows.help_with_rows(board, 1) == 0
    assert (found == 7.0).all()


def test_what_is_taken_is_left_to_who_took_it() -> None:
    """The helper takes the last chunks only, where the caller has taken the first."""
    formula, n = obseq.calculator("Dist3D"), 4 * LANES
    kernel, (u, o) = formula.kernel, derivatives.draw(formula.kernel, n, np.random.default_rng(4))
    values, derived = np.zeros((n, 1)), np.zeros((n, 6))
    board, tiles, rows = shared_rows.new_board(0), aligned_tiles(kernel.rows, 1), np.empty((0, 6))
    address = kernel.value_and_jacobian_address
    shared_rows.offer(board, LANES, address, kernel.rows, u, o, values, derived, tiles, rows)
    board[shared_rows.LEFT] = 3
    assert shared_rows.help_with_rows(board, 1) == 3
    assert (values[:LANES] == 0.0).all()
    np.testing.assert_array_equal(values[LANES:], formula.values(u, o)[LANES:])


def test_several_threads_at_once_get_what_is_theirs(monkeypatch: pytest.MonkeyPatch, always) -> None:
    """One has the companion; the others evaluate alone."""
    formulas = [obseq.calculator(name) for name in ("TopoHz", "Dist3D", "TopoZen")]
    expected = [evaluated(formula, 9000, 1 << 60, monkeypatch) for formula in formulas]
    with ThreadPoolExecutor(3) as pool:
        for _ in range(5):
            found = list(pool.map(lambda each: evaluated(each, 9000, 1, monkeypatch), formulas))
            for some, others in zip(found, expected, strict=True):
                for one, other in zip(some, others, strict=True):
                    np.testing.assert_array_equal(one, other)


def test_an_interruption_waits_for_what_the_other_has_taken(monkeypatch, always) -> None:
    written: list[int] = []

    def interrupted(board: np.ndarray, *_: object) -> None:
        def finish() -> None:
            written.append(1)
            board[shared_rows.AT_WORK] = 0

        board[shared_rows.AT_WORK] = 1
        threading.Timer(0.02, finish).start()
        raise KeyboardInterrupt

    formula, whole, helper = obseq.calculator("Dist3D"), shared_rows.share_rows, companion()
    expected = evaluated(formula, 9000, 1 << 60, monkeypatch)
    assert helper is not None
    monkeypatch.setattr(shared_rows, "share_rows", interrupted)
    with pytest.raises(KeyboardInterrupt):
        evaluated(formula, 9000, 1, monkeypatch)
    assert written == [1]
    monkeypatch.setattr(shared_rows, "share_rows", whole)
    assert helper._is_free.acquire(blocking=False)
    helper._is_free.release()
    for found, other in zip(evaluated(formula, 9000, 1, monkeypatch), expected, strict=True):
        np.testing.assert_array_equal(found, other)


def test_without_its_thread_the_caller_does_all_the_work() -> None:
    helper, formula, n = Companion(), obseq.calculator("Dist3D"), 3000
    helper.end()
    kernel, (u, o) = formula.kernel, derivatives.draw(formula.kernel, n, np.random.default_rng(6))
    values, derived = np.zeros((n, 1)), np.zeros((n, 6))

    def new_tiles() -> np.ndarray:
        return aligned_tiles(kernel.rows, 2)

    arrays, scratch = (u, o, values, derived), (new_tiles(), np.empty((0, 6)))
    assert helper._share(kernel.value_and_jacobian_address, kernel.rows, arrays, scratch, new_tiles)
    np.testing.assert_array_equal(values, formula.values(u, o))


WHOLE = """
import os, sys, threading
import numpy as np
import obseq
settings = obseq.Calculator.values.__globals__
settings["processors"] = lambda: 2
formula = obseq.calculator("Dist3D")
u, o = np.random.default_rng(1).uniform(1.0, 2.0, (20000, 6)), np.ones((20000, 1))
expected = np.linalg.norm(u[:, 3:] - u[:, :3], axis=1) - 1.0
def right():
    return np.allclose(formula.values(u, o)[:, 0], expected, atol=1e-14)
assert right() and right()
if hasattr(os, "fork"):
    child = os.fork()
    if not child:
        sys.exit(0 if right() and right() and right() and threading.active_count() == 2 else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
assert right()
print("done")
"""


def test_copies_of_a_process_have_companions_of_their_own_and_processes_end() -> None:
    ended = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", WHOLE],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "done\n", "")


def shared(trend: Trend, count: int, alone: float, together: float) -> list[bool]:
    """Which of so many evaluations are shared, where they take so long."""
    found = []
    for _ in range(count):
        found.append(trend.shares())
        trend.note(found[-1], together if found[-1] else alone)
    return found


def test_what_is_faster_is_done_again() -> None:
    """Alone twice at first, and every 64th time."""
    assert shared(Trend(), 130, 2.0, 1.0) == [k > 2 and k % 64 != 0 for k in range(1, 131)]


def test_what_is_slower_together_is_done_alone_each_time_for_longer() -> None:
    """Four attempts, then 4, 12 and 28 evaluations alone, beside the 64th; then it has become faster."""
    trend = Trend()
    expected = [False] * 2 + [True] * 4 + [False] * 4 + [True] * 4 + [False] * 12 + [True] * 4
    assert shared(trend, 30, 1.0, 2.0) == expected
    assert shared(trend, 33, 1.0, 2.0) == [False] * 28 + [True] * 4 + [False]
    assert shared(trend, 80, 1.0, 0.5)[-10:] == [True] * 10


def test_a_first_evaluation_that_takes_long_is_no_measure() -> None:
    trend = Trend()
    shared(trend, 1, 1e6, 2.0)
    assert shared(trend, 10, 1.0, 2.0)[-5:] == [False] * 4 + [True]


def test_where_the_other_thread_helps_somebody_else_the_caller_is_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    formula, helper = obseq.calculator("TopoZen"), companion()
    expected = evaluated(formula, 9000, 1 << 60, monkeypatch)
    assert helper is not None
    with helper._is_free:
        for _ in range(4):
            for found, other in zip(evaluated(formula, 9000, 1, monkeypatch), expected, strict=True):
                np.testing.assert_array_equal(found, other)
