"""The dense adjustment: Gauss-Newton on exact derivatives, and all that follows from its normal equations."""

from dataclasses import dataclass, replace

import numpy as np
from referee.equations import Equations
from referee.network import ABSOLUTE, FROM_NORTH, TINY, Unknowns

TOLERANCE = 1e-6  # of sigma0, for the length of the last step in standard deviations
SMALL = 1e-2  # of sigma0: steps below it that shrink no more are the rounding of geocentric coordinates
SINGULAR = 1e-9  # of the largest singular value of the scaled design
MOST = 60


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
    length: float = 0.0  # of the last step, in standard deviations a priori: what rounding leaves uncertain

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


def adjust(network, equations=Equations, unknowns=Unknowns, polish=2, tilts=None):
    """Adjusts; of a free network from where it starts, that being its datum.

    Instruments that may tilt start as their first readings say, or by `tilts`: axes by number of the set-up.
    """
    unknowns = unknowns(network)
    equations(network, unknowns).orient()
    unknowns.bases |= tilts or {}
    reference, iterations, left, length = unknowns.values.copy(), 0, polish, np.inf
    loose = loose_of(network, unknowns, equations)
    while iterations <= MOST and np.isfinite(unknowns.values).all():
        parts = linearised(network, unknowns, equations)
        design = Design(*with_datum(network, unknowns, reference, loose, *parts))
        basis, step = design.solved()
        before, length = length, np.linalg.norm(design.white @ step)
        freedom = len(design.v) - basis.shape[1]
        scale = np.linalg.norm(design.misfit) / np.sqrt(freedom) if freedom else 1.0
        is_rounding = length < SMALL * scale and length > 0.9 * before
        if left < polish or length <= TOLERANCE * scale or is_rounding:
            if left == 0:
                return replace(result(network, unknowns, design, basis, iterations + 1), length=length)
            left -= 1
        else:
            iterations += 1
        unknowns.take(step)
    raise UndeterminedError("the iterations of the referee do not end")


@dataclass
class Design:
    """Linear equations J dx = -v with a covariance, and H dx = -c, which hold exactly."""

    v: np.ndarray
    jacobian: np.ndarray
    covariance: np.ndarray
    c: np.ndarray
    hold: np.ndarray

    def __post_init__(self):
        self.root = np.linalg.cholesky(self.covariance)
        self.white = np.linalg.solve(self.root, self.jacobian)
        self.misfit = np.linalg.solve(self.root, self.v)

    def solved(self):
        """(u, r) basis of what moves, whose products with itself are the covariances, and the step."""
        scales = 1.0 / np.maximum(np.linalg.norm(np.vstack([self.white, self.hold]), axis=0), 1e-300)
        moving, step = np.eye(len(scales)), np.zeros(len(scales))
        if len(self.c):
            scaled = self.hold * scales
            _, s, vt = np.linalg.svd(scaled)
            moving, step = vt[int((s > 1e-12 * s[0]).sum()) :].T, -np.linalg.pinv(scaled) @ self.c
        u, s, vt = np.linalg.svd((self.white * scales) @ moving, full_matrices=False)
        if len(s) < moving.shape[1] or not (s > SINGULAR * s.max(initial=0.0)).all():
            raise UndeterminedError("motions are free")
        y = -(u.T @ (self.misfit + self.white @ (scales * step))) / s
        return scales[:, None] * (moving @ (vt.T / s)), scales * (step + moving @ (vt.T @ y))


def loose_of(network, unknowns, equations=Equations):
    """The motions of a free network, decided where it is: that is its reference; None with known points."""
    if network.inner is None:
        return None
    _, jacobian, covariance, _, hold = linearised(network, unknowns, equations)
    return network.loose(unknowns, jacobian, whitened(jacobian, covariance), hold)


def whitened(jacobian, covariance):
    """Rows over the root of their covariance."""
    return np.linalg.solve(np.linalg.cholesky(covariance), jacobian)


def with_datum(network, unknowns, reference, loose, v, jacobian, covariance, c, hold):
    """The equations, and of a free network that its datum moves as little as can be from a reference."""
    if loose is None:
        return v, jacobian, covariance, c, hold
    rows, moves = network.datum_rows(unknowns), loose(unknowns, whitened(jacobian, covariance), hold)
    datum = np.zeros((moves.shape[1], len(unknowns.values)))
    datum[:, rows] = moves[rows].T
    away = np.zeros(len(reference))
    away[rows] = (unknowns.values - reference)[rows]
    return v, jacobian, covariance, np.concatenate([c, datum @ away]), np.vstack([hold, datum])


def result(network, unknowns, design, basis, iterations):
    """Everything at the solution."""
    n, white, v, inverse = len(network.observations), design.white, design.v, np.linalg.inv(design.root)
    hat = white @ basis
    free = np.eye(len(v)) - hat @ hat.T
    pv, pqp = inverse.T @ design.misfit, inverse.T @ free @ inverse
    with np.errstate(invalid="ignore", divide="ignore"):
        standardised = pv / np.sqrt(np.diag(pqp))
    freedom, own = len(v) - basis.shape[1], float(design.misfit[:n] @ design.misfit[:n])
    return Adjusted(
        names=network.names,
        xyz=unknowns.points(),
        spread=basis,
        residuals=v,
        redundancy=np.diag(design.root @ free @ inverse).copy(),
        standardised=standardised,
        sigma0=np.sqrt(own / freedom) if freedom else np.nan,
        variance_factor=float(design.misfit @ design.misfit) / freedom if freedom else np.nan,
        freedom=freedom,
        iterations=iterations,
        unknowns=unknowns,
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
    loose = loose_of(free, unknowns)
    parts = with_datum(free, unknowns, unknowns.values, loose, *linearised(free, unknowns))
    design = Design(*parts)
    found = result(free, unknowns, design, design.solved()[0], 0)
    return found.covariance(np.arange(3 * len(free.points)))
