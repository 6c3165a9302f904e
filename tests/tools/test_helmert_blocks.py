"""A network in Helmert blocks is the network at once, also when a worker has lost its leaves."""

import importlib
import pickle
from concurrent.futures import Future
from pathlib import Path

import numpy as np
import pytest

TOOLS = Path(__file__).parents[2] / "tools" / "benchmarks"


class Here:
    """An executor that does the work at once; it may forget all leaves before each task."""

    def __init__(self, leaves, is_forgetful):
        self.leaves, self.is_forgetful = leaves, is_forgetful

    def submit(self, function, *arguments):
        if self.is_forgetful:
            self.leaves.clear()
        future = Future()
        future.set_result(function(*arguments))
        return future


@pytest.mark.parametrize("is_forgetful", [False, True])
def test_blocks_give_what_one_machine_gives(tmp_path, monkeypatch, capsys, is_forgetful):
    monkeypatch.syspath_prepend(TOOLS)
    tools = importlib.import_module("helmert_blocks")
    leaves = importlib.import_module("helmert_leaves")
    system = importlib.import_module("bench_network").survey(300, 1)
    parts, home = tools.cut(system, 2)
    assert all(np.count_nonzero(home == node) for node in range(1, 8))
    files = [tmp_path / f"{k}.part" for k in range(4)]
    for file, part in zip(files, parts, strict=True):
        file.write_bytes(pickle.dumps(part))
    tree = tools.Tree([str(file) for file in files], home, Here(leaves.LEAVES, is_forgetful))
    costs = [tree.iterate()[0] for _ in range(3)]
    values, variances = tree.answers(len(home))
    first = system.equations().assemble().cost
    expected, of_expected = tools.adjusted_alone(system, 3)
    assert costs[0] == pytest.approx(first, rel=1e-12)
    assert np.abs(values - expected).max() < 1e-10
    assert np.allclose(variances, of_expected, rtol=1e-10, atol=0.0)
