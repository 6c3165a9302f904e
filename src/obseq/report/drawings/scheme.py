"""The scheme of a levelling: points without a plan, placed by the lines between them.

Two points are as far apart as the height differences that lead from one to the other are uncertain: the
variance of a line grows with its length. Stress majorization (Gansner, Koren, North, 2004) places up to
`MOST_EXACT` points, the distances to a few points (landmarks) the others (de Silva, Tenenbaum, 2004).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.graphs import parts

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from obseq.arrays import FloatArray, IntArray
    from obseq.records.adjustment import AdjustmentRecord

LEVELLED = frozenset({"DH", "Height", "Pz", "EqualDH"})
"""Types of observations that say nothing of the plan."""
MOST_EXACT = 400
LANDMARKS = 40
ROUNDS = 60

Places = dict[str, tuple[float, float]]


def scheme(record: AdjustmentRecord) -> Places | None:
    """A place for each point of a levelling whose plan is not known; None where there is a plan."""
    lines = [row for row in record.observations if row.active]
    if not lines or any(row.type not in LEVELLED for row in lines) or _has_plan(record):
        return None
    rows = {point.name: k for k, point in enumerate(record.points)}
    joined = [row for row in lines if row.origin in rows and row.target in rows and row.origin != row.target]
    if not joined:
        return None
    ends = np.array([[rows[row.origin], rows[row.target]] for row in joined])
    places = _placed(ends, _lengths(np.array([row.sigma for row in joined])), len(rows))
    return dict(zip(rows, map(tuple, places.tolist()), strict=True))


def _has_plan(record: AdjustmentRecord) -> bool:
    """Whether most points have a place of their own."""
    places = {(round(x, 3), round(y, 3)) for x, y in filter(None, (point.plan for point in record.points))}
    return len(places) > 0.5 * len(record.points) and len(record.points) > 1


def _lengths(sigmas: FloatArray) -> FloatArray:
    """(n,) lengths of lines by their variances, the usual one being 1; none so short that nobody sees it."""
    return np.asarray(np.clip(np.square(sigmas / np.median(sigmas)), 0.3, 5.0))


def _placed(ends: IntArray, lengths: FloatArray, n: int) -> FloatArray:
    """(n, 2) places of points, part by part of what hangs together, the parts beside each other."""
    from scipy.sparse import csr_array

    graph = csr_array((lengths, (ends[:, 0], ends[:, 1])), shape=(n, n))
    graph = graph.maximum(graph.T)
    labels, places, left = parts(n, ends[:, 0], ends[:, 1]), np.zeros((n, 2)), 0.0
    for label in range(labels.max(initial=-1) + 1):
        rows = np.flatnonzero(labels == label)
        part = _lying(_part(graph[rows][:, rows]))
        places[rows] = part - part.min(axis=0) + (left, 0.0)
        left += float(np.ptp(part[:, 0])) + 1.0
    return places


def _lying(places: FloatArray) -> FloatArray:
    """(n, 2) the places, turned so that they are wider than tall."""
    centred = places - places.mean(axis=0)
    return np.asarray(centred @ np.linalg.svd(centred, full_matrices=False)[2].T)


def _part(graph: csr_array) -> FloatArray:
    """(n, 2) places of points that hang together."""
    from scipy.sparse.csgraph import dijkstra

    n = graph.shape[0]
    if n < 3:
        return np.array([[0.0, 0.0], [1.0, 0.0]])[:n]
    chosen = np.arange(n) if n <= MOST_EXACT else np.linspace(0, n - 1, LANDMARKS).astype(np.intp)
    ways = dijkstra(graph, directed=False, indices=chosen)
    places = _by_landmarks(ways, chosen)
    return _majorized(places, ways) if n <= MOST_EXACT else places


def _by_landmarks(ways: FloatArray, chosen: IntArray) -> FloatArray:
    """(n, 2) places by the distances (k, n) to k points: classical scaling of these, then trilateration."""
    squares = np.square(ways)
    among = squares[:, chosen]
    centred = among - among.mean(axis=0) - among.mean(axis=1)[:, None] + among.mean()
    values, vectors = np.linalg.eigh(-0.5 * centred)
    roots = np.sqrt(np.maximum(values[-2:], 1e-9))
    return np.asarray(-0.5 * (squares - among.mean(axis=1)[:, None]).T @ (vectors[:, -2:] / roots))


def _majorized(places: FloatArray, ways: FloatArray) -> FloatArray:
    """(n, 2) places whose distances come closer to the ways (n, n), weighted by their inverse squares."""
    n = len(places)
    places = places + 0.05 * np.random.default_rng(1).standard_normal((n, 2))
    np.fill_diagonal(ways, 1.0)
    weights = ways**-2.0
    np.fill_diagonal(weights, 0.0)
    laplacian = np.diag(weights.sum(axis=1)) - weights
    inverse = np.linalg.pinv(laplacian, hermitian=True)
    for _ in range(ROUNDS):
        apart = np.linalg.norm(places[:, None] - places[None], axis=2)
        pulls = weights * ways / np.maximum(apart, 1e-9)
        np.fill_diagonal(pulls, 0.0)
        places = inverse @ (pulls.sum(axis=1)[:, None] * places - pulls @ places)
    return np.asarray(places)
