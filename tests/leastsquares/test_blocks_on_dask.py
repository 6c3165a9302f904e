"""Helmert blocks on Dask: a worker that dies, a client that dies, and the run after it."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from test_helmert import network

from obseq.leastsquares import solve_in_blocks

distributed = pytest.importorskip("distributed", reason="Dask is not installed (obseq[dask])")
pytestmark = pytest.mark.slow

CLIENT = """
import sys
sys.path.insert(0, sys.argv[1])
from distributed import Client
from test_helmert import network
from obseq.leastsquares import solve_in_blocks

class Telling(Client):
    def submit(self, *arguments, **options):
        print("submitted", flush=True)
        return super().submit(*arguments, **options)

solve_in_blocks(network(8)[0], 2, Telling(sys.argv[2]), folder=sys.argv[3])
"""
"""A client that says so at each task."""


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


def check(client, tmp_path):
    """Blocks on the cluster give what one machine gives, and leave nothing."""
    whole, points, _ = network(8)
    system, *_ = network(8)
    expected = whole.solve(covariance=True)
    found = solve_in_blocks(system, 2, client, folder=tmp_path)
    assert found.converged
    assert found.sigma0 == pytest.approx(expected.sigma0, rel=1e-9)
    assert np.abs(system.values(points) - whole.values(points)).max() < 1e-9
    assert np.allclose(found.variances, expected.cofactors.variances(), rtol=1e-8, atol=0.0)


def test_a_plain_client_gives_what_one_machine_gives(client, tmp_path):
    check(client, tmp_path)
    assert not list(tmp_path.iterdir())


class KillsAWorker:
    """Sends the tasks of a client on, and kills a worker when those of some numbers have begun."""

    def __init__(self, client, *at):
        self._client, self._at, self._sent = client, at, 0

    def submit(self, function, *arguments):
        self._sent += 1
        future = self._client.submit(function, *arguments)
        if self._sent in self._at:
            os.kill(next(iter(self._client.run(os.getpid).values())), signal.SIGKILL)
        return future


def test_workers_that_die_change_nothing(client, tmp_path):
    """In leaves, in nodes above them, and in the next iteration."""
    check(KillsAWorker(client, 1, 6, 10), tmp_path)


def test_a_client_that_dies_leaves_nothing_to_the_next(client, tmp_path):
    here, address = str(Path(__file__).parent), client.cluster.scheduler_address
    command = [sys.executable, "-c", CLIENT, here, address, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as other:
        for _ in range(6):
            assert other.stdout.readline() == "submitted\n"
        other.kill()
    check(client, tmp_path)
