"""Pools of threads end with their block, and an interruption stays one."""

import os
import threading
import time

import pytest

from obseq.pools import processors, thread_pool


@pytest.mark.skipif(
    not hasattr(os, "sched_setaffinity"), reason="processes cannot be kept to a processor here"
)
def test_processors_are_those_of_the_process():
    everywhere = os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, {min(everywhere)})
        assert processors() == 1
    finally:
        os.sched_setaffinity(0, everywhere)
    assert processors() == len(everywhere)


def test_work_is_done_by_threads_of_the_pool():
    with thread_pool(2) as pool:
        names = set(pool.map(lambda _: threading.current_thread().name, range(4)))
    assert all(name.startswith("obseq-") for name in names)


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_no_thread_outlives_the_block_not_even_one_that_the_pool_has_forgotten(error):
    ended = []

    def slow():
        time.sleep(0.05)
        ended.append(True)

    with pytest.raises(error), thread_pool(1) as pool:
        pool.submit(slow)
        pool._threads.clear()  # as after an interruption while it started
        raise error
    assert ended == [True]


def test_what_python_makes_of_an_interruption_while_a_thread_starts():
    with pytest.raises(KeyboardInterrupt), thread_pool(1):
        try:
            raise KeyboardInterrupt
        finally:
            raise RuntimeError("release unlocked lock")


def test_other_errors_stay_what_they_are():
    with pytest.raises(RuntimeError, match="something else"), thread_pool(1):
        raise RuntimeError("something else")
