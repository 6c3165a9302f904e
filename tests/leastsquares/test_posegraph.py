"""Classic pose graphs from a chordal start, against the minima of posegraph-dev."""

import json

import numpy as np
import pytest
from posegraph import adjusted, chordal_start, read_graph


@pytest.mark.slow
@pytest.mark.parametrize("name", ["INTEL.g2o", "M3500.g2o", "parking-garage.g2o"])
def test_minimum_of_a_pose_graph(shared_data, name):
    folder = shared_data / "posegraph-dev"
    expected = json.loads((folder / "expected.json").read_text())["graphs"][name]
    graph = read_graph(folder / name)
    assert (len(graph.translations), len(graph.starts)) == (expected["poses"], expected["edges"])
    result = adjusted(graph, *chordal_start(graph), max_iterations=50)
    assert result.converged
    assert result.redundancy == expected["dof"]
    assert result.cost == pytest.approx(expected["chi2"], rel=1e-6)


@pytest.mark.slow
def test_cost_at_the_poses_of_the_file(shared_data):
    folder = shared_data / "posegraph-dev"
    graph = read_graph(folder / "parking-garage.g2o")
    result = adjusted(graph, graph.translations, graph.rotations, max_iterations=1)
    expected = json.loads((folder / "expected.json").read_text())["graphs"]["parking-garage.g2o"]
    assert result.iterations[0].cost == pytest.approx(expected["chi2_file"], rel=1e-7)
    assert np.isfinite(result.cost)
