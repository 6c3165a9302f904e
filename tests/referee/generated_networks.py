"""Random mixed networks, from a seed: places, systems, sizes, kinds of observations, points and datums."""

from dataclasses import dataclass

import numpy as np
from referee.equations import Equations
from referee.network import Network, Point, Unknowns, rotation
from referee.surveyor import Surveyor

ARC_SECOND = np.pi / 648000


@dataclass(frozen=True)
class Case:
    """A network, and how its files are written."""

    seed: int
    dialect: str
    network: Network
    unit: str  # of angles in its files
    place: str


class Maker(Surveyor):
    """Gives what was measured values, and points what is known of them."""

    def made(self):
        """The network, with values and starts."""
        if self.frame.kind != "rigid" and self.random.random() < 0.08:
            self.levelling()
        else:
            self.measure()
        return self.finished()

    def points(self):
        """Points with what is known of them; the first ones hold the network."""
        r, may = self.random, self.frame.kind == "tangent" and self.dialect != "table"
        deflected = may and r.random() < 0.3
        found, spread = [], 10 ** r.uniform(-4, -2)
        for k, name in enumerate(self.xyz):
            given = self.kinds.get(name, "- - -")
            if name not in self.kinds and (k < (1 if self.is_weak else 3) or r.random() < 0.1):
                given = "s s s" if k < 2 else str(r.choice(["s s s", "s s -", "- - s", "0 0 0"]))
                if self.dialect == "table" and r.random() < 0.2:
                    at = int(r.integers(0, 3))
                    given = " ".join("0" if axis == at else word for axis, word in enumerate(given.split()))
            drawn = {"0": 0.0, "-": np.nan}
            sigmas = [drawn.get(w, float(np.round(spread * r.uniform(0.5, 2), 6))) for w in given.split()]
            deflection = tuple((np.round(r.normal(0, 10, 2), 2) * ARC_SECOND).tolist()) if deflected else None
            found.append(Point(name, self.xyz[name], np.zeros(3), np.array(sigmas), deflection))
        return found

    def finished(self):
        """The network of what was observed."""
        r = self.random
        seen = {name for o in self.observations for name in (o.a, o.b, o.backsight, *o.members)}
        self.xyz = {name: xyz for name, xyz in self.xyz.items() if name in seen}
        self.names = [name for name in self.names if name in seen]
        network = Network(
            self.frame,
            self.system,
            self.points(),
            self.observations,
            self.setups,
            self.clusters,
            refraction=float(r.choice([0.12, 0.12, 0.0, 0.2])),
            estimate=self.estimated(),
        )
        self.observe(network)
        self.start(network)
        if self.dialect == "comp3d" and r.random() < 0.2:
            network.known = self.correlated_points(network)
        if r.random() < 0.25 and not any((p.sigmas == 0).any() for p in network.points):
            network.inner = () if r.random() < 0.6 else tuple(self.names[: max(3, self.n - 2)])
        unit = str(r.choice(["rad", "gon", "deg"] if self.dialect != "obs" else ["gon"]))
        return Case(self.seed, self.dialect, network, unit, self.place)

    def estimated(self):
        r, kinds = self.random, {o.kind for o in self.observations}
        if self.dialect == "comp3d" or r.random() < 0.7:
            return frozenset()
        possible = [w for w, kind in (("constant", "Dist"), ("scale", "Dist")) if kind in kinds]
        if any(o.kind == "Zen" and self.setups[o.setup].orientation != "BASC" for o in self.observations):
            possible.append("refraction")
        if "DX" in kinds:
            possible.append("frame-scale")
        return frozenset(word for word in possible if r.random() < 0.5)

    def observe(self, network):
        """Gives observations and known coordinates values: true ones and errors of their sigmas."""
        r = self.random
        unknowns = _true_unknowns(network, r)
        network.tilts = {key: axes for key, axes in unknowns.bases.items() if isinstance(key, int)}
        at = Equations(network, unknowns, unknowns.values[None].astype(complex))
        errors = np.array([r.normal(0, at.sigma(o)) for o in network.observations])
        for rows, block in network.clusters:
            errors[rows] = np.linalg.cholesky(block) @ r.normal(size=len(rows))
        for o, error in zip(network.observations, errors.tolist(), strict=True):
            if o.kind.startswith(("Axis", "Equal")):
                continue
            value = float(np.real(at.residual(o)[0])) + error
            o.value = value % (2 * np.pi) if o.kind in ("Hz", "Azim", "Angle") else value
        for p in network.points:
            exact = np.real(network.system.coordinates(p.true))
            metres = network.system.metres(p.true)
            sigmas = np.nan_to_num(p.sigmas)
            p.given = exact + r.normal(size=3) * sigmas / metres
        network.__dict__.pop("given", None)

    def start(self, network):
        """Starts free coordinates away from the truth, by a share of the distance to the nearest point."""
        share = 0.1 * float(self.random.uniform(0, 1))
        xyz = np.array([p.true for p in network.points])
        apart = np.linalg.norm(xyz[:, None] - xyz, axis=2) + 1e9 * np.eye(len(xyz))
        nearest = np.minimum(apart.min(axis=1), 30.0)
        for p, near in zip(network.points, nearest.tolist(), strict=True):
            free = np.isnan(p.sigmas)
            metres = network.system.metres(p.true)
            p.given = p.given + free * self.random.normal(0, share * near, 3) * (1, 1, 0.3) / metres
            p.start = network.system.placed(p.given[None])[0]
            p.is_unplaced = self.is_sparse and free.all() and p.deflection is None
        network.__dict__.pop("given", None)

    def correlated_points(self, network):
        keys = [(p.name, k) for p in network.points for k in range(3) if p.sigmas[k] > 0]
        if len(keys) < 2:
            return None
        root = np.diag([network.points[network.names[name]].sigmas[k] for name, k in keys])
        mixed = np.eye(len(keys)) + 0.3 * self.random.uniform(-1, 1, (len(keys), len(keys))) / len(keys)
        return keys, root @ mixed @ mixed.T @ root


def _true_unknowns(network, random):
    """The unknowns at the truth, orientations drawn."""
    unknowns = Unknowns(network, is_true=True)
    for key, part in unknowns.at.items():
        if key[0] == "turn" and part.stop - part.start == 3:
            unknowns.bases[key[1]] = rotation(random.uniform(-1, 1, 3) * 1.5)
        elif key[0] == "turn":
            unknowns.values[part] = random.uniform(-3, 3)
    return unknowns


def case(seed):
    """The network of a seed."""
    return Maker(seed).made()


def held_case(seed):
    """The network of a seed on inner constraints, coordinates of it held; None where that cannot be said.

    Where the seed holds none, one coordinate of the first point. A point is not held as a whole.
    """
    made = case(seed)
    network, held = made.network, np.array([p.sigmas == 0 for p in made.network.points])
    if made.dialect != "table" or held.all(axis=1).any():
        return None
    if not held.any():
        point, axis = network.points[0], seed % 3
        point.sigmas[axis] = 0.0
        point.given[axis] = np.real(network.system.coordinates(point.true))[axis]
        point.start, point.is_unplaced = network.system.placed(point.given[None])[0], False
        network.__dict__.pop("given", None)
    network.inner = ()
    return made
