"""Grouping of unknowns, peeling of graphs, orders of elimination."""

import numpy as np
import pytest

from obseq.leastsquares.solvers import SymmetricPattern
from obseq.leastsquares.solvers import ordering as orderings
from obseq.leastsquares.solvers.graph import Graph, group_indistinguishable, peel
from obseq.leastsquares.solvers.minimum_degree import least_degree_first
from obseq.leastsquares.solvers.ordering import by_metis, by_minimum_degree, elimination_order

NOBODY = np.empty(0, dtype=np.int64)


def graph_of(edges, n):
    """The graph of these edges, each vertex of weight 1."""
    both = np.vstack([edges, np.fliplr(edges)]) if len(edges) else np.empty((0, 2), dtype=np.int64)
    both = both[np.argsort(both[:, 0], kind="stable")]
    start = np.concatenate([[0], np.cumsum(np.bincount(both[:, 0], minlength=n))])
    return Graph(start, both[:, 1].astype(np.int64), np.ones(n, dtype=np.int64))


def test_unknowns_of_a_point_become_one_vertex(build):
    pattern, _ = SymmetricPattern.of(build.survey(40))
    grouping = group_indistinguishable(pattern, NOBODY)
    for point in range(40):
        assert len(set(grouping.vertex[3 * point : 3 * point + 3])) == 1
    assert grouping.graph.weights.sum() == pattern.n
    assert grouping.graph.n <= 50


def test_the_first_unknown_tells_its_neighbours_from_those_of_others():
    path = np.eye(3) + np.eye(3, k=1) + np.eye(3, k=-1)
    assert len(group_indistinguishable(SymmetricPattern.of(path)[0], NOBODY).graph.weights) == 3


def test_unconnected_unknowns_are_not_merged():
    grouping = group_indistinguishable(SymmetricPattern.of(np.eye(5))[0], NOBODY)
    np.testing.assert_array_equal(grouping.vertex, np.arange(5))


def test_unknowns_to_be_last_are_vertices_of_their_own_after_all_others(build):
    pattern, _ = SymmetricPattern.of(build.survey(40))
    last = np.array([0, 7, 100])  # 0 and 7 leave the other unknowns of their points
    grouping = group_indistinguishable(pattern, last)
    n = grouping.graph.n
    assert grouping.n_last == 3
    assert grouping.vertex[last].tolist() == [n - 3, n - 2, n - 1]
    assert grouping.graph.weights[-3:].tolist() == [1, 1, 1]
    assert grouping.vertex[1] == grouping.vertex[2]
    assert grouping.graph.weights.sum() == pattern.n


def test_a_tree_is_peeled_whole():
    edges = np.array([[0, 1], [1, 2], [1, 3], [3, 4], [3, 5]])
    eliminated, remaining, rest = peel(graph_of(edges, 6), NOBODY)
    assert sorted(eliminated) == list(range(6))
    assert len(remaining) == rest.n == 0


def test_chains_between_junctions_become_edges():
    """Four junctions, all joined by lines of three vertices but 0 and 1, which are joined directly."""
    edges, following = [[0, 1]], 4
    for a, b in ((0, 2), (0, 3), (1, 2), (1, 3), (2, 3)):
        edges += [
            [a, following],
            [following, following + 1],
            [following + 1, following + 2],
            [following + 2, b],
        ]
        following += 3
    eliminated, remaining, rest = peel(graph_of(np.array(edges), following), NOBODY)
    assert sorted(eliminated) == list(range(4, following))
    np.testing.assert_array_equal(remaining, range(4))
    np.testing.assert_array_equal(np.diff(rest.start), [3, 3, 3, 3])


@pytest.mark.parametrize("n", [3, 4, 9])
def test_a_ring_is_peeled(n):
    ring = np.column_stack([np.arange(n), np.roll(np.arange(n), -1)])
    eliminated, remaining, _ = peel(graph_of(ring, n), NOBODY)
    assert sorted([*eliminated, *remaining]) == list(range(n))
    assert len(eliminated) >= n - 1


def test_vertices_kept_out_stay_out():
    edges = np.array([[0, 1], [1, 2], [2, 3]])
    eliminated, remaining, _ = peel(graph_of(edges, 4), np.array([3]))
    assert sorted([*eliminated, *remaining]) == [0, 1, 2]


@pytest.mark.parametrize("order", [by_metis, by_minimum_degree])
def test_orders_are_permutations(order, build):
    graph = group_indistinguishable(SymmetricPattern.of(build.survey(200))[0], NOBODY).graph
    np.testing.assert_array_equal(np.sort(order(graph)), np.arange(graph.n))
    np.testing.assert_array_equal(order(graph_of([], 3)), np.arange(3))


def test_large_graphs_are_ordered_by_superlu(build, monkeypatch):
    graph = group_indistinguishable(SymmetricPattern.of(build.survey(200))[0], NOBODY).graph
    monkeypatch.setattr(orderings, "FEW", graph.n - 1)
    np.testing.assert_array_equal(np.sort(by_minimum_degree(graph)), np.arange(graph.n))


def least_degree_by_sets(graph):
    """The same rule, by Python's sets: of equal degrees the vertex of least number."""
    near = {v: set(graph.neighbours[graph.start[v] : graph.start[v + 1]].tolist()) for v in range(graph.n)}
    order = []
    while near:
        v = min(near, key=lambda vertex: (len(near[vertex]), vertex))
        for u in near[v]:
            near[u] |= near[v]
            near[u] -= {u, v}
        del near[v]
        order.append(v)
    return order


@pytest.mark.parametrize("n", [3, 63, 64, 65, 200])
def test_least_degrees_come_first(n):
    random = np.random.default_rng(n)
    first, second = np.triu_indices(n, 1)
    some = random.random(len(first)) < 3.0 / n
    graph = graph_of(np.column_stack([first[some], second[some]]), n)
    np.testing.assert_array_equal(least_degree_first(graph), least_degree_by_sets(graph))


def test_a_line_is_eliminated_from_its_end(build):
    grouping = group_indistinguishable(SymmetricPattern.of(build.chain(6))[0], NOBODY)
    order = elimination_order(grouping, "metis")
    assert np.all(np.abs(np.diff(order)) == 1)
