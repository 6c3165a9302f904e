"""Blocks on Dask: workers that die in each phase, a client that dies and is taken up."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from test_blocks import in_blocks

from obseq.errors import InputError
from obseq.leastsquares.blocks import workers

dask = pytest.importorskip("dask", reason="Dask is not installed (obseq[dask])")
distributed = pytest.importorskip("distributed", reason="Dask is not installed (obseq[dask])")
pytestmark = pytest.mark.slow

CLIENT = """
import sys
sys.path.insert(0, sys.argv[1])
from distributed import Client
from test_blocks import in_blocks
from test_blocks_on_dask import counted

counted()
in_blocks(client=Client(sys.argv[2]), work=sys.argv[3])
"""
"""A client that says what it gives away."""
PHASES = ("prepare", "eliminate", "reduce", "expand", "invert")


def counted():
    """From now on what is given to workers is printed."""
    submit = workers.Workers.submit

    def told(self, function, *arguments):
        sys.stdout.write(f"{arguments[1].__name__}\n")
        sys.stdout.flush()
        return submit(self, function, *arguments)

    workers.Workers.submit = told


def kill(client, count):
    """Kills some of the workers of this machine."""
    for process in list(client.run(os.getpid, on_error="ignore").values())[:count]:
        os.kill(process, signal.SIGKILL)


@pytest.fixture
def killing(monkeypatch, request):
    """Kills workers that have begun with the first task of each kind; gives the kinds that are left."""
    submit, left = workers.Workers.submit, set(PHASES)

    def begun(self, function, *arguments):
        future = submit(self, function, *arguments)
        if arguments[1].__name__ in left:
            left.remove(arguments[1].__name__)
            kill(self._client, request.param)
        return future

    monkeypatch.setattr(workers.Workers, "submit", begun)
    return left


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


@pytest.mark.parametrize("killing", [1, 2], indirect=True)
def test_workers_that_die_in_each_phase_change_nothing(expected, killing, monkeypatch):
    monkeypatch.setattr(workers, "PATIENCE", 5.0)
    # Those killed are given up at once, and take what they began with them, time and again.
    rough = {"distributed.deploy.lost-worker-timeout": "100ms", "distributed.scheduler.allowed-failures": 100}
    with dask.config.set(rough):
        check(expected, client=2)
    assert not killing


def test_a_part_that_ends_each_worker_is_told():
    with dask.config.set({"distributed.scheduler.allowed-failures": 0}):
        given = workers.Workers(1, None)
    with pytest.raises(InputError, match=r"a part was lost with who treated it \(KilledWorker\)"):
        given.result(given.submit(os._exit, 1))
    given.close()


def test_an_executor_of_dask_is_refused(client):
    with pytest.raises(InputError, match="give the Dask client in place of its executor"):
        in_blocks(client=client.get_executor())


def test_a_client_that_dies_is_taken_up(client, expected, tmp_path):
    here, address = str(Path(__file__).parent), client.cluster.scheduler_address
    command = [sys.executable, "-c", CLIENT, here, address, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as other:
        while other.stdout.readline() != "expand\n":
            assert other.poll() is None
        other.kill()
    check(expected, client=client, work=tmp_path, resume=True)
    assert not list(tmp_path.iterdir())
