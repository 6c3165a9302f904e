"""Pools of threads end with their block, and an interruption stays one."""

import os
import subprocess
import sys
import threading
import time

import pytest

from obseq.cached import cached_property
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


FORKS = """
import os, sys, threading, time
from importlib.resources import files
from obseq.survey import Network

folder = str(files("obseq.survey") / "data")

def adjust():
    Network.read(folder + "/demo.obs", folder + "/demo.cor", points_crs="IGNF:LAMB93").adjust()

def work():
    while not is_over.is_set():
        adjust()

adjust()  # what another thread imports, no process that is forked meanwhile can import
is_over, children = threading.Event(), []
thread = threading.Thread(target=work)
thread.start()
for number in range(30):
    time.sleep(0.003 * (number % 7))
    children.append(os.fork())
    if not children[-1]:
        adjust()
        os._exit(0)
is_over.set()
thread.join()
end, waiting = time.monotonic() + 60.0, set(children)
while waiting and time.monotonic() < end:
    waiting -= {child for child in waiting if os.waitpid(child, os.WNOHANG)[0]}
    time.sleep(0.01)
for child in waiting:
    os.kill(child, 9)
os._exit(3 if waiting else 0)
"""


@pytest.mark.slow
def test_a_process_that_is_forked_while_another_thread_adjusts_can_adjust() -> None:
    """With the locks of Python 3.11's cached properties, one in eight waits for ever."""
    assert subprocess.run([sys.executable, "-W", "ignore", "-c", FORKS], check=False).returncode == 0


def test_a_property_is_computed_once_and_holds_no_lock() -> None:
    inside = []

    class Square:
        side = 3

        @cached_property
        def area(self) -> int:
            inside.append(self)
            if len(inside) == 1:  # another thread is not kept waiting by this one
                with thread_pool(1) as pool:
                    assert pool.submit(lambda: Square().area).result(timeout=10.0) == 9
            return self.side**2

    square = Square()
    assert square.area == square.area == 9 and len(inside) == 2
