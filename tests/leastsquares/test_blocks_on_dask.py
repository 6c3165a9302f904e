"""Blocks on Dask: workers that die in each phase, a client that dies and is taken up."""

import os
import signal
import subprocess
import sys
from concurrent.futures import Executor
from pathlib import Path

import numpy as np
import pytest
from test_blocks import in_blocks

distributed = pytest.importorskip("distributed", reason="Dask is not installed (obseq[dask])")
pytestmark = pytest.mark.slow

CLIENT = """
import sys
sys.path.insert(0, sys.argv[1])
from distributed import Client
from test_blocks import in_blocks
from test_blocks_on_dask import Counting

in_blocks(client=Counting(Client(sys.argv[2])), work=sys.argv[3])
"""
"""A client that says so at each task."""


class Counting(Executor):
    """Says what it gives a client."""

    def __init__(self, client):
        self.client = client
        self._executor = client.get_executor(pure=False)

    def submit(self, function, /, *arguments, **_):
        sys.stdout.write(f"{arguments[1].__name__}\n")
        sys.stdout.flush()
        return self._executor.submit(function, *arguments)


class KillsAWorker(Counting):
    """Kills a worker that has begun with the first task of each kind; another one is there."""

    def __init__(self, client, *kinds):
        super().__init__(client)
        self._kinds = set(kinds)

    def submit(self, function, /, *arguments, **_):
        kills = arguments[1].__name__ in self._kinds
        if kills:  # on a busy machine the one that was killed before is not back at once, or never
            self.client.wait_for_workers(2, timeout=120)
        future = self._executor.submit(function, *arguments)
        if kills:
            self._kinds.remove(arguments[1].__name__)
            os.kill(next(iter(self.client.run(os.getpid).values())), signal.SIGKILL)
        return future


@pytest.fixture(scope="module")
def client():
    """A local cluster of two processes, which sees the modules of the tests."""
    here = str(Path(__file__).parent)
    os.environ["PYTHONPATH"] = os.pathsep.join([here, os.environ.get("PYTHONPATH", "")])
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


@pytest.fixture(scope="module")
def expected():
    """What one process gives."""
    found, values = in_blocks()
    return found.cofactors.values, values


def check(expected, **settings):
    """Blocks give the same to the last digit."""
    found, values = in_blocks(**settings)
    assert found.converged
    assert np.array_equal(values, expected[1])
    assert np.array_equal(found.cofactors.values, expected[0])


def test_a_plain_client_and_the_address_of_a_scheduler(client, expected, tmp_path):
    check(expected, client=client, work=tmp_path)
    check(expected, client=client.cluster.scheduler_address)
    assert not list(tmp_path.iterdir())


def test_workers_of_this_machine(expected):
    check(expected, client=2, memory="2GB")


def test_workers_that_die_in_each_phase_change_nothing(client, expected):
    dying = KillsAWorker(client, "prepare", "eliminate", "reduce", "expand", "invert")
    check(expected, client=dying)
    assert not dying._kinds


def test_a_client_that_dies_is_taken_up(client, expected, tmp_path):
    here, address = str(Path(__file__).parent), client.cluster.scheduler_address
    command = [sys.executable, "-c", CLIENT, here, address, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as other:
        while other.stdout.readline() != "expand\n":
            assert other.poll() is None
        other.kill()
    check(expected, client=client, work=tmp_path, resume=True)
    assert not list(tmp_path.iterdir())
