"""Fill-reducing orders of elimination."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np

from obseq.arrays import IntArray
from obseq.errors import InputError, SolverUnavailableError
from obseq.leastsquares.solvers.graph import Graph, Grouping, peel
from obseq.leastsquares.solvers.minimum_degree import least_degree_first

ORDERINGS = ("metis", "minimum-degree", "natural")

FEW = 2000
"""Up to so many unknowns, or vertices, an order of ours is found sooner than a library is loaded; the factor
has 0.65 to 1.1 times the entries that PyMETIS gives it, of surveys, levelling nets and strips."""


def checked_ordering(name: str) -> str:
    """The name of an ordering, or "auto".

    Raises:
        InputError: there is no such ordering.
        SolverUnavailableError: "metis" is asked for and pymetis is not installed.
    """
    if name not in ("auto", *ORDERINGS):
        raise InputError(f"there is no ordering {name!r}; choose one of: auto, {', '.join(ORDERINGS)}")
    if name == "metis" and not _has_metis():
        raise SolverUnavailableError("metis", "pymetis")
    return name


def resolve_ordering(name: str, n: int) -> str:
    """The ordering meant for n unknowns: "auto" is "metis" for many of them where pymetis is installed."""
    if name != "auto":
        return name
    return "metis" if n > FEW and _has_metis() else "minimum-degree"


def _has_metis() -> bool:
    return find_spec("pymetis") is not None


def elimination_order(grouping: Grouping, ordering: str) -> IntArray:
    """(n_vertices,) vertices in the order of their elimination, those kept for the end last."""
    graph = grouping.graph
    if ordering == "natural":
        return np.arange(graph.n)
    kept_out = np.arange(graph.n - grouping.n_last, graph.n)
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
    weights, options = graph.weights.astype(integer), pymetis.Options(compress=0)  # vertices are merged
    order, _ = pymetis.nested_dissection(adjacency=adjacency, vweights=weights, options=options)
    return np.asarray(order, dtype=np.int64)


def by_minimum_degree(graph: Graph) -> IntArray:
    """Vertices of least degree first: of a large graph, by SuperLU's multiple minimum degree.

    It comes by way of an incomplete factorisation that drops everything.
    """
    if len(graph.neighbours) == 0:
        return np.arange(graph.n)
    if graph.n <= FEW:
        return least_degree_first(graph)
    from scipy.sparse import csc_array, eye_array
    from scipy.sparse.linalg import spilu

    off_diagonal = csc_array((np.full(len(graph.neighbours), 1e-3), graph.neighbours, graph.start))
    dominant = csc_array(off_diagonal + 1e6 * eye_array(graph.n))
    incomplete = spilu(dominant, permc_spec="MMD_AT_PLUS_A", drop_tol=1.0, fill_factor=1.0)
    return np.argsort(incomplete.perm_c).astype(np.int64)
