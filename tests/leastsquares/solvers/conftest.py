"""Matrices as adjustments make them, small enough to be inverted densely; the solvers to try on them."""

from importlib.util import find_spec
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.linalg import block_diag


def normal_matrix(jacobian: sp.csr_array, prior: float = 0.0) -> np.ndarray:
    """J'J + prior * I as a dense matrix."""
    normal = (jacobian.T @ jacobian).toarray()
    return normal + prior * np.eye(len(normal))


def levelling(edges: np.ndarray, n: int) -> sp.csr_array:
    """Jacobian of height differences between the ends of the edges (m, 2)."""
    m = len(edges)
    rows = np.repeat(np.arange(m), 2)
    return sp.csr_array((np.tile([-1.0, 1.0], m), (rows, edges.ravel())), shape=(m, n))


def chain(n: int) -> np.ndarray:
    """Levelling line of n bench marks whose first one is held."""
    edges = np.column_stack([np.arange(n - 1), np.arange(1, n)])
    matrix = normal_matrix(levelling(edges, n))
    matrix[0, 0] += 1.0
    return matrix


def network(n_points: int, seed: int = 0, radius: float = 0.35) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 2) of the unit square and the pairs (m, 2) of those that are close."""
    generator = np.random.default_rng(seed)
    points = generator.uniform(size=(n_points, 2))
    i, j = np.triu_indices(n_points, 1)
    near = np.hypot(*(points[i] - points[j]).T) < radius
    return points, np.column_stack([i[near], j[near]])


def trilateration(points: np.ndarray, pairs: np.ndarray) -> sp.csr_array:
    """Jacobian of plane distances; its kernel is two translations and one rotation where it is rigid."""
    m, n = len(pairs), len(points)
    difference = points[pairs[:, 1]] - points[pairs[:, 0]]
    unit = difference / np.linalg.norm(difference, axis=1)[:, None]
    columns = np.column_stack([2 * pairs[:, 0], 2 * pairs[:, 0] + 1, 2 * pairs[:, 1], 2 * pairs[:, 1] + 1])
    data = np.column_stack([-unit, unit])
    return sp.csr_array((data.ravel(), (np.repeat(np.arange(m), 4), columns.ravel())), shape=(m, 2 * n))


def plane_motions(points: np.ndarray) -> np.ndarray:
    """(2 n, 3) the kernel of a trilateration: two translations, one rotation."""
    centred = points - points.mean(axis=0)
    x, y = np.eye(2)[0], np.eye(2)[1]
    turned = np.column_stack([-centred[:, 1], centred[:, 0]])
    return np.column_stack([np.tile(x, len(points)), np.tile(y, len(points)), turned.ravel()])


def fading(n: int, share: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A singular matrix and the vector of its kernel, which fades from each unknown to the next."""
    generator = np.random.default_rng(seed)
    vector = np.cumprod(np.r_[1.0, share * generator.uniform(0.8, 1.2, n - 1)])
    rows, k = np.zeros((n - 1, n)), np.arange(n - 1)
    rows[k, k], rows[k, k + 1] = vector[1:], -vector[:-1]
    rows /= np.linalg.norm(rows, axis=1)[:, None]
    mixed = np.linalg.qr(generator.normal(size=(3 * n, n - 1)))[0] @ rows
    return mixed.T @ mixed, vector


def survey(n_points: int, seed: int = 0) -> np.ndarray:
    """Normal matrix of points (3 unknowns) seen from 4 stations (1 more unknown each), points first."""
    generator = np.random.default_rng(seed)
    points = generator.uniform(size=(n_points, 2))
    stations = np.arange(0, n_points, 4)
    data, rows, columns = [], [], []
    for target in range(n_points):
        distance = np.hypot(*(points[stations] - points[target]).T)
        for k in np.argsort(distance)[1:5]:
            unknowns = [*(3 * stations[k] + np.arange(3)), *(3 * target + np.arange(3)), 3 * n_points + k]
            for _ in range(3):
                row = len(data)
                data.append(generator.normal(size=7))
                rows.append(np.full(7, row))
                columns.append(unknowns)
    size = 3 * n_points + len(stations)
    jacobian = sp.csr_array(
        (np.concatenate(data), (np.concatenate(rows), np.concatenate(columns))), shape=(len(data), size)
    )
    return normal_matrix(jacobian, 1e-3)


def arrow(n: int, head: int, first: bool) -> np.ndarray:
    """Diagonal matrix bordered by a few full rows, first or last."""
    generator = np.random.default_rng(n)
    matrix = np.diag(generator.uniform(1.0, 2.0, n)) * n
    border = slice(0, head) if first else slice(n - head, n)
    matrix[border] = generator.uniform(-1.0, 1.0, (head, n))
    matrix[border] += np.diag(np.full(n, 2.0 * n))[border]
    matrix[:, border] = matrix[border].T
    block = matrix[border, border]
    matrix[border, border] = (block + block.T) / 2.0
    return matrix


def dense(n: int) -> np.ndarray:
    """Full positive definite matrix."""
    square = np.random.default_rng(n).normal(size=(n, n))
    return square @ square.T + n * np.eye(n)


def blocks(*matrices: np.ndarray) -> np.ndarray:
    """Disconnected parts, their unknowns shuffled together."""
    matrix = block_diag(*matrices)
    order = np.random.default_rng(5).permutation(len(matrix))
    return matrix[np.ix_(order, order)]


REGULAR = {
    "one unknown": np.array([[4.0]]),
    "diagonal": np.diag(np.arange(1.0, 30.0)),
    "two unknowns": np.array([[2.0, -1.0], [-1.0, 2.0]]),
    "chain": chain(60),
    "arrow first": arrow(50, 3, first=True),
    "arrow last": arrow(50, 3, first=False),
    "dense": dense(70),
    "survey": survey(80),
    "network": normal_matrix(trilateration(*network(60)), 1e-2),
    "disconnected": blocks(chain(20), survey(12), dense(9), np.array([[3.0]]), chain(3)),
}

OPTIONAL = {"pardiso": "pypardiso", "cholmod": "sksparse"}
SOLVERS = (
    "dense",
    "supernodal",
    "superlu",
    *(name for name, module in OPTIONAL.items() if find_spec(module) is not None),
)


@pytest.fixture(params=REGULAR)
def regular(request: pytest.FixtureRequest) -> np.ndarray:
    """A positive definite matrix, each kind in turn."""
    return REGULAR[request.param].copy()


@pytest.fixture(params=SOLVERS)
def solver_name(request: pytest.FixtureRequest) -> str:
    """A solver, each in turn, the optional ones where they are installed."""
    return request.param


@pytest.fixture
def build() -> SimpleNamespace:
    """The functions that make matrices."""
    return SimpleNamespace(
        chain=chain,
        dense=dense,
        fading=fading,
        levelling=levelling,
        network=network,
        normal_matrix=normal_matrix,
        plane_motions=plane_motions,
        survey=survey,
        trilateration=trilateration,
        blocks=blocks,
    )
