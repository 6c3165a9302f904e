"""The dense adjustment: Gauss-Newton on exact derivatives, and all that follows from its normal equations."""

from dataclasses import dataclass, replace

import numpy as np
from referee.equations import Equations
from referee.network import ABSOLUTE, FROM_NORTH, TINY, Unknowns

TOLERANCE = 1e-6  # of sigma0, for the length of the last step in standard deviations
SMALL = 1e-2  # of sigma0: steps below it that shrink no more are the rounding of geocentric coordinates
SINGULAR = 1e-9  # of the largest singular value of the scaled design
MOST = 40


class UndeterminedError(Exception):
    """The observations do not determine the network."""


@dataclass
class Adjusted:
    """What the referee says: all of the final solution, precisions a priori."""

    names: dict
    xyz: np.ndarray
    spread: np.ndarray  # (u, r) whose products with itself are the covariances of all unknowns
    residuals: np.ndarray
    redundancy: np.ndarray
    standardised: np.ndarray
    sigma0: float
    variance_factor: float
    freedom: int
    iterations: int
    unknowns: Unknowns

    def covariance(self, rows):
        """(k, k) of some unknowns."""
        return self.spread[rows] @ self.spread[rows].T


def linearised(network, unknowns, equations=Equations):
    """Residuals (n,), Jacobian (n, u), covariance (n, n); then value and Jacobian of what is held."""
    size = len(unknowns.values)
    at = equations(network, unknowns, unknowns.values + 1j * TINY * np.eye(size))
    parts, sigmas = at.observed()
    correlated = {} if network.known is None else {key: k for k, key in enumerate(network.known[0])}
    held, known = [], []
    for point in network.points:
        for component in range(3):
            if point.sigmas[component] == 0:
                held.append(at.coordinate(point.name, component))
            elif point.sigmas[component] > 0:
                parts.append(at.coordinate(point.name, component))
                sigmas.append(point.sigmas[component])
                known.append((point.name, component))
    whole = np.array(parts).T
    covariance = np.diag(np.square(sigmas))
    for members, block in network.clusters:
        covariance[np.ix_(members, members)] = block
    if correlated:
        chosen = [len(network.observations) + known.index(key) for key in network.known[0]]
        covariance[np.ix_(chosen, chosen)] = network.known[1]
    holding = np.array(held).T if held else np.zeros((size, 0), complex)
    return (
        whole[0].real,
        whole.imag.T / TINY,
        covariance,
        holding[0].real,
        holding.imag.T / TINY,
    )


def adjust(network, equations=Equations, unknowns=Unknowns, polish=2):
    """Adjusts; of a free network from where it starts, that being its datum."""
    unknowns = unknowns(network)
    equations(network, unknowns).orient()
    reference, iterations, left, length = unknowns.values.copy(), 0, polish, np.inf
    while iterations <= MOST and np.isfinite(unknowns.values).all():
        v, jacobian, covariance, c, hold = linearised(network, unknowns, equations)
        root = np.linalg.cholesky(covariance)
        white, misfit = np.linalg.solve(root, jacobian), np.linalg.solve(root, v)
        basis, kernel, step = solved(network, white, misfit, c, hold)
        rank = basis.shape[1]
        freedom = len(v) - rank
        scale = np.sqrt(misfit @ misfit / freedom) if freedom else 1.0
        before, length = length, np.linalg.norm(white @ step)
        is_rounding = length < SMALL * scale and length > before / 2
        if left < polish or length <= TOLERANCE * scale or is_rounding:
            if left == 0:
                return _result(network, unknowns, (v, root, white, basis, kernel), iterations + 1)
            left -= 1
        else:
            iterations += 1
        unknowns.take(settled(network, unknowns, step, kernel, reference))
    raise UndeterminedError("the iterations of the referee do not end")


def solved(network, white, misfit, c, hold):
    """(u, r) basis of what moves, (u, d) kernel that the datum takes, and the step."""
    size = white.shape[1]
    scales = 1.0 / np.maximum(np.linalg.norm(np.vstack([white, hold]), axis=0), 1e-300)
    moving, step = np.eye(size), np.zeros(size)
    if len(c):
        scaled = hold * scales
        _, s, vt = np.linalg.svd(scaled)
        rank = int((s > 1e-12 * s[0]).sum())
        step = -np.linalg.pinv(scaled) @ c
        moving = vt[rank:].T
    u, s, vt = np.linalg.svd((white * scales) @ moving, full_matrices=False)
    kept = s > SINGULAR * s[0]
    missing = moving.shape[1] - int(kept.sum())
    if missing and network.inner is None:
        raise UndeterminedError(f"{missing} motions are free")
    y = -(u[:, kept].T @ (misfit + white @ (scales * step))) / s[kept]
    step = scales * (step + moving @ (vt[kept].T @ y))
    basis = scales[:, None] * (moving @ (vt[kept].T / s[kept]))
    full = np.linalg.svd((white * scales) @ moving)[2]
    kernel = scales[:, None] * (moving @ full[int(kept.sum()) :].T)
    return basis, kernel, step


def settled(network, unknowns, step, kernel, reference):
    """The step that ends on the datum: least movement of its points from the reference."""
    if not kernel.shape[1]:
        return step
    rows = network.datum_rows(unknowns)
    away = (unknowns.values + step)[rows] - reference[rows]
    return step - kernel @ np.linalg.lstsq(kernel[rows], away, rcond=None)[0]


def _result(network, unknowns, parts, iterations):
    v, root, white, basis, kernel = parts
    n = len(network.observations)
    hat = white @ basis
    free = np.eye(len(v)) - hat @ hat.T
    inverse = np.linalg.inv(root)
    misfit = inverse @ v
    pv, pqp = inverse.T @ misfit, inverse.T @ free @ inverse
    redundancy = np.diag(root @ free @ inverse).copy()
    with np.errstate(invalid="ignore", divide="ignore"):
        standardised = pv / np.sqrt(np.diag(pqp))
    move = np.eye(len(unknowns.values))
    if kernel.shape[1]:
        rows = network.datum_rows(unknowns)
        move[:, rows] -= kernel @ np.linalg.pinv(kernel[rows])
    freedom = len(v) - basis.shape[1]
    own = float(misfit[:n] @ misfit[:n])
    return Adjusted(
        network.names,
        unknowns.points(),
        move @ basis,
        v,
        redundancy,
        standardised,
        np.sqrt(own / freedom) if freedom else np.nan,
        float(misfit @ misfit) / freedom if freedom else np.nan,
        freedom,
        iterations,
        unknowns,
    )


def freed(network, xyz, dropped=FROM_NORTH):
    """The network on inner constraints from places: known coordinates and some kinds have no part."""
    points = [
        replace(p, start=place, sigmas=np.where(p.sigmas == 0, 0.0, np.nan))
        for p, place in zip(network.points, xyz, strict=True)
    ]
    rows = [k for k, o in enumerate(network.observations) if o.kind not in dropped]
    number = {row: k for k, row in enumerate(rows)}
    clusters = [
        ([number[row] for row in members], block)
        for members, block in network.clusters
        if members[0] in number
    ]
    kept = [network.observations[row] for row in rows]
    return replace(
        network, points=points, observations=kept, clusters=clusters, known=None, inner=network.inner or ()
    )


def inner_covariance(network, found):
    """(3n, 3n) of all points as if nothing were known of any; None where something is held exactly."""
    if any((p.sigmas == 0).any() for p in network.points):
        return None
    free = freed(network, found.xyz, FROM_NORTH + ABSOLUTE)
    unknowns = Unknowns(free)
    for key, part in unknowns.at.items():
        unknowns.values[part] = found.unknowns.values[found.unknowns.at[key]]
    unknowns.bases |= found.unknowns.bases
    v, jacobian, covariance, c, hold = linearised(free, unknowns)
    root = np.linalg.cholesky(covariance)
    white = np.linalg.solve(root, jacobian)
    basis, kernel, _ = solved(free, white, np.linalg.solve(root, v), c, hold)
    found = _result(free, unknowns, (v, root, white, basis, kernel), 0)
    return found.covariance(np.arange(3 * len(free.points)))
