"""Relative orientation of two images from five or more common points, calibrated.

Five pairs of rays determine up to ten essential matrices (Nister, 2004). E = x E1 + y E2 + z E3 + E4 spans
what the five epipolar equations leave; det E = 0 and 2 E E'E - trace(E E') E = 0 are ten cubic equations in
x, y, z, solved by the eigenvectors of the multiplication by x (Stewenius, Engels and Nister, 2006).
"""

from __future__ import annotations

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.geometry import RigidMotion

SAMPLE = 5
POWERS1 = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0))
POWERS2 = ((2, 0, 0), (1, 1, 0), (0, 2, 0), (1, 0, 1), (0, 1, 1), (0, 0, 2), *POWERS1)
POWERS3 = (
    (3, 0, 0), (2, 1, 0), (1, 2, 0), (0, 3, 0), (2, 0, 1),
    (1, 1, 1), (0, 2, 1), (1, 0, 2), (0, 1, 2), (0, 0, 3),
    *POWERS2,
)  # fmt: skip
TIMES_X = tuple(POWERS3.index((i + 1, j, k)) for i, j, k in POWERS2[:6])
"""Where x times a monomial of degree 2 is among those of degree 3."""


@dataclass(frozen=True, eq=False)
class RelativeOrientation:
    """The second camera seen from the first, the base being one.

    Attributes:
        pose: of the second camera in the frame of the first.
        is_used: (n,) pairs of rays that agree with it.
        score: weighted mean angle of the rays to their epipolar planes, radians.
    """

    pose: RigidMotion
    is_used: BoolArray
    score: float


def relative_orientation(
    first: FloatArray, second: FloatArray, samples: int = 300, seed: int = 0, tolerance: float = 2e-3
) -> RelativeOrientation:
    """The relative orientation of two cameras from unit rays (n, 3) to the same points.

    Args:
        first: rays in the frame of the first camera.
        second: rays in the frame of the second.
        samples: of five pairs each, that are tried.
        seed: of their choice.
        tolerance: radians; pairs that miss by more are gross errors.

    Raises:
        InputError: there are fewer than five pairs, or no camera has the points in front.
    """
    n = len(first)
    if n < SAMPLE:
        raise InputError(f"a relative orientation takes {SAMPLE} common points, not {n}")
    rng = np.random.default_rng(seed)
    chosen = np.argsort(rng.random((samples, n)), axis=1)[:, :SAMPLE] if n > SAMPLE else np.arange(n)[None]
    matrices = essential_matrices(first[chosen], second[chosen])
    if not len(matrices):
        raise InputError("no relative orientation fits five of the common points")
    errors = epipolar_angles(matrices, first, second)
    weights = 1.0 + np.cos(np.pi * (np.arange(n) + 0.5) / n)
    scores = np.sort(errors, axis=1) @ weights / weights.sum()
    for best in np.argsort(scores)[:10]:
        used = errors[best] <= tolerance
        pose, n_front = _in_front(matrices[best], first[used], second[used])
        if used.sum() >= SAMPLE and n_front > 0.75 * used.sum():
            return RelativeOrientation(pose, used, float(scores[best]))
    raise InputError("no relative orientation has the common points in front of both cameras")


def essential_matrices(first: FloatArray, second: FloatArray) -> FloatArray:
    """(k, 3, 3) essential matrices, x1' E x2 = 0, of samples of five pairs of rays (m, 5, 3)."""
    rows = (first[:, :, :, None] * second[:, :, None, :]).reshape(-1, SAMPLE, 9)
    basis = np.linalg.svd(rows)[2][:, SAMPLE:].reshape(-1, 4, 3, 3)
    entries = np.moveaxis(basis, 1, -1)  # (m, 3, 3, 4): each entry a polynomial of degree 1
    equations = _cubics(entries)
    left, right = equations[:, :, :10], equations[:, :, 10:]
    sound = np.abs(np.linalg.det(left / np.abs(left).max(axis=(1, 2), keepdims=True))) > 0.0
    reduced = np.linalg.solve(left[sound], right[sound])
    action = np.zeros((len(reduced), 10, 10))
    action[:, :6] = -reduced[:, TIMES_X]
    action[:, 6, 0] = action[:, 7, 1] = action[:, 8, 3] = action[:, 9, 6] = 1.0
    values, vectors = np.linalg.eig(action)
    sample, column = np.nonzero(np.abs(values.imag) <= 1e-8 * (1.0 + np.abs(values)))
    found = vectors[sample, :, column].real
    with np.errstate(divide="ignore", invalid="ignore"):
        xyz = np.column_stack([found[:, 6:9] / found[:, 9:], np.ones(len(found))])
    matrices = np.einsum("ka,kaij->kij", xyz, basis[np.flatnonzero(sound)[sample]])
    return np.asarray(matrices[np.isfinite(matrices).all(axis=(1, 2))])


def _table(first: tuple[tuple[int, ...], ...], second: tuple[tuple[int, ...], ...], to) -> IntArray:  # type: ignore[no-untyped-def]
    """Where the product of two monomials is among those of `to`."""
    return np.array([[to.index(tuple(np.add(a, b))) for b in second] for a in first])


TABLE11 = _table(POWERS1, POWERS1, POWERS2)
TABLE21 = _table(POWERS2, POWERS1, POWERS3)


def _product(p: FloatArray, q: FloatArray, table: IntArray, size: int) -> FloatArray:
    """Products of polynomials (..., i) and (..., j) in the monomials of a table, (..., size)."""
    result = np.zeros((*np.broadcast_shapes(p.shape[:-1], q.shape[:-1]), size))
    for i, j in np.ndindex(table.shape):
        result[..., table[i, j]] += p[..., i] * q[..., j]
    return result


def _cubics(entries: FloatArray) -> FloatArray:
    """(m, 10, 20) the equations of an essential matrix with polynomial entries (m, 3, 3, 4)."""
    gram = _product(entries[:, :, None, :, :], entries[:, None, :, :, :], TABLE11, 10).sum(axis=3)
    gram -= 0.5 * np.eye(3)[None, :, :, None] * np.trace(gram, axis1=1, axis2=2)[:, None, None, :]
    nine = _product(gram[:, :, :, None, :], entries[:, None, :, :, :], TABLE21, 20).sum(axis=2)
    a, b, c = entries[:, 0], entries[:, 1], entries[:, 2]
    shifted = [np.roll(row, -k, axis=1) for row in (b, c) for k in (1, 2)]
    minors = _product(shifted[0], shifted[3], TABLE11, 10) - _product(shifted[1], shifted[2], TABLE11, 10)
    determinant = _product(minors, a, TABLE21, 20).sum(axis=1)
    return np.concatenate([nine.reshape(-1, 9, 20), determinant[:, None]], axis=1)


def epipolar_angles(matrices: FloatArray, first: FloatArray, second: FloatArray) -> FloatArray:
    """(k, n) larger of the angles of two rays to their epipolar planes, for matrices (k, 3, 3)."""
    normals1, normals2 = second @ np.swapaxes(matrices, 1, 2), first @ matrices
    gap = np.abs(np.einsum("ni,kni->kn", first, normals1))
    least = np.minimum(*(np.einsum("kni,kni->kn", normals, normals) for normals in (normals1, normals2)))
    with np.errstate(divide="ignore", invalid="ignore"):
        angles = gap / np.sqrt(least)
    return np.asarray(np.nan_to_num(angles, nan=np.pi, posinf=np.pi))


def _in_front(matrix: FloatArray, first: FloatArray, second: FloatArray) -> tuple[RigidMotion, int]:
    """The one of the four poses of an essential matrix that has most points in front of both cameras."""
    u, _, vt = np.linalg.svd(matrix)
    u, vt = u * np.sign(np.linalg.det(u)), vt * np.sign(np.linalg.det(vt))
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    poses = [RigidMotion(sign * u[:, 2], u @ w @ vt) for w in (turn, turn.T) for sign in (1.0, -1.0)]
    counts = [int(np.count_nonzero((depths(pose, first, second) > 0.0).all(axis=0))) for pose in poses]
    best = int(np.argmax(counts))
    return poses[best], counts[best]


def depths(pose: RigidMotion, first: FloatArray, second: FloatArray) -> FloatArray:
    """(2, n) distances along two rays to the points where they are closest."""
    turned = second @ pose.rotation.T
    c = np.sum(first * turned, axis=1)
    a, b = first @ pose.centre, turned @ pose.centre
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.nan_to_num(np.stack([a - c * b, a * c - b]) / (1.0 - c * c)))
