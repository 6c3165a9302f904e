"""Fill-reducing orders of elimination."""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError, SolverUnavailableError
from obseq.leastsquares.solvers.graph import peel

if TYPE_CHECKING:
    from obseq.arrays import IntArray
    from obseq.leastsquares.solvers.graph import Graph, Grouping

ORDERINGS = ("metis", "minimum-degree", "natural")


def resolve_ordering(name: str) -> str:
    """The ordering meant: "auto" is "metis" where pymetis is installed, else "minimum-degree".

    Raises:
        InputError: there is no such ordering.
        SolverUnavailableError: "metis" is asked for and pymetis is not installed.
    """
    has_metis = find_spec("pymetis") is not None
    if name == "auto":
        return "metis" if has_metis else "minimum-degree"
    if name not in ORDERINGS:
        raise InputError(f"there is no ordering {name!r}; choose one of: auto, {', '.join(ORDERINGS)}")
    if name == "metis" and not has_metis:
        raise SolverUnavailableError("metis", "pymetis")
    return name


def elimination_order(grouping: Grouping, ordering: str) -> IntArray:
    """(n_vertices,) vertices in the order of their elimination, the vertex kept for the end last."""
    graph = grouping.graph
    if ordering == "natural":
        return np.arange(graph.n)
    kept_out = np.arange(graph.n - 1, graph.n) if grouping.has_last else np.empty(0, dtype=np.int64)
    peeled, remaining, rest = peel(graph, kept_out)
    inner = (by_metis if ordering == "metis" else by_minimum_degree)(rest)
    return np.concatenate([peeled, remaining[inner], kept_out])


def by_metis(graph: Graph) -> IntArray:
    """Nested dissection, vertices weighted by their number of unknowns."""
    if len(graph.neighbours) == 0:
        return np.arange(graph.n)
    import pymetis

    integer = pymetis.zero_copy_dtype()
    adjacency = pymetis.CSRAdjacency(graph.start.astype(integer), graph.neighbours.astype(integer))
    order, _ = pymetis.nested_dissection(adjacency=adjacency, vweights=graph.weights.astype(integer))
    return np.asarray(order, dtype=np.int64)


def by_minimum_degree(graph: Graph) -> IntArray:
    """SuperLU's multiple minimum degree, by way of an incomplete factorisation that drops everything."""
    if len(graph.neighbours) == 0:
        return np.arange(graph.n)
    from scipy.sparse import csc_array, eye_array
    from scipy.sparse.linalg import spilu

    off_diagonal = csc_array((np.full(len(graph.neighbours), 1e-3), graph.neighbours, graph.start))
    dominant = csc_array(off_diagonal + 1e6 * eye_array(graph.n))
    incomplete = spilu(dominant, permc_spec="MMD_AT_PLUS_A", drop_tol=1.0, fill_factor=1.0)
    return np.argsort(incomplete.perm_c).astype(np.int64)
