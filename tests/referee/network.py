"""A network as the referee sees it: points, observations, set-ups, and its unknowns where they start."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from referee.earth import MEAN_RADIUS, Frame, System, norm

TINY = 1e-30
ALIKE = 1e-5  # of the largest: what a motion that others make up leaves of itself
READ_ALONG = {"DX": 0, "DY": 1, "DZ": 2}
AXES = {"X": 0, "Y": 1, "Z": 2, "x": 0, "y": 1, "z": 2}
TURNS, DIRECTIONS = ("turn",), ("axis",)
DISTANCES, ANGLES = ("Dist", "DistHz"), ("Hz", "Zen", "Azim", "Angle", "Alpha", "Beta", "Lat", "Lon")
FROM_NORTH, ABSOLUTE = ("Azim",), ("Px", "Py", "Pz", "GeoX", "GeoY", "GeoZ", "Height", "Lat", "Lon")


@dataclass
class Point:
    """A point: where it is, what is said of it, where the iterations start.

    `given` are coordinates in the system of the points; `sigmas` are NaN for free and 0 for held ones.
    """

    name: str
    true: np.ndarray
    given: np.ndarray
    sigmas: np.ndarray
    deflection: tuple | None = None
    start: np.ndarray | None = None
    is_unplaced: bool = False  # its coordinates are not in the files


@dataclass
class Setup:
    """An instrument on a point: VERT, FIX, BASC, or GRID (along the axes of the frame's origin)."""

    origin: str
    orientation: str


@dataclass
class Observation:
    """An observation; `group` and `axis` name what shares unknowns, `members` and `weights` a barycentre."""

    kind: str
    a: str
    b: str
    value: float
    sigma: float
    relative: float = 0.0
    hi: float = 0.0
    ht: float = 0.0
    setup: int = -1
    backsight: str = ""
    group: str = ""
    axis: str = ""
    instrument: str = ""
    members: tuple = ()
    weights: tuple = ()


@dataclass
class Network:
    """All of it. `clusters` are (rows of observations, covariance); `known` (coordinates, covariance)."""

    frame: Frame
    system: System
    points: list
    observations: list
    setups: list = field(default_factory=list)
    clusters: list = field(default_factory=list)
    known: tuple | None = None
    refraction: float = 0.12
    estimate: frozenset = frozenset()
    inner: tuple | None = None  # names of datum points, () for all; None: the known coordinates
    tilts: dict | None = None  # true axes of instruments that may tilt, by number of the set-up

    @cached_property
    def names(self):
        return {point.name: row for row, point in enumerate(self.points)}

    @cached_property
    def is_deflected(self):
        return any(point.deflection is not None for point in self.points)

    @cached_property
    def given(self):
        return np.array([point.given for point in self.points])

    def datum_rows(self, unknowns):
        """Numbers of the unknowns that carry a datum of its own."""
        chosen = self.inner or tuple(self.names)
        return [unknowns.at["point", name].start + k for name in chosen for k in range(3)]

    def loose(self, unknowns, jacobian, white, hold):
        """Unknowns, with their equations -> (3n, d) motions that these do not determine where they are now.

        Which ones, say the equations given here (docs/statistics.md).
        """
        fields = loose_motions(self, unknowns, (jacobian, hold), white)
        return lambda now, *_: fields(now.points())

    def orientation(self, setup):
        """Of a set-up, after the rule that what nothing turns is along the vertical."""
        turning = any(o.setup == setup and o.kind in ("Hz", "DX", "DY", "Alpha") for o in self.observations)
        word = self.setups[setup].orientation
        return word if turning or word == "GRID" else "FIX"


def loose_motions(network, unknowns, seen_by, white):
    """Coordinates (n, 3) -> (3n, d) similarities of the network that are free or loose; instruments follow.

    An equation sees curvature only of a motion where that is a thousandth, or the size of the network over
    the radius of the Earth, of what it sees of its points, or less. A motion of which all equations see
    curvature only is loose where its standard deviation is beyond a hundredth of the size.
    """
    n, xyz = 3 * len(network.points), unknowns.points()
    middle = xyz.mean(axis=0)
    extent = 2 * np.linalg.norm(xyz - middle, axis=1).max()
    hold = seen_by[1][:, :n]
    kept = np.eye(n) - np.linalg.pinv(hold, rcond=1e-9) @ hold if len(hold) else np.eye(n)

    def basic(places):
        arms = (places - middle) / extent
        columns = [np.tile(axis, (len(places), 1)) for axis in np.eye(3)]
        columns += [np.cross(axis, arms) for axis in np.eye(3)] + [arms]
        return kept @ np.column_stack([c.ravel() for c in columns])

    u, s, vt = np.linalg.svd(basic(xyz), False)
    apart = s > ALIKE * s[0]
    points, made_of = u[:, apart] * np.sqrt(len(xyz)), vt[apart].T / s[apart] * np.sqrt(len(xyz))
    others = -np.linalg.lstsq(white[:, n:], white[:, :n] @ points, rcond=1e-12)[0]
    motions = np.vstack([points, others])
    alone = [np.maximum(np.linalg.norm(part[:, :n], axis=1), 1e-300)[:, None] for part in seen_by]
    shares = np.vstack([part @ motions / size for part, size in zip(seen_by, alone, strict=True)])
    modes = np.linalg.svd(shares)[2].T
    seen = np.abs(shares @ modes).max(axis=0)
    curved = modes[:, seen <= max(1e-3, 2 * extent / MEAN_RADIUS)]
    _, weights, turned = np.linalg.svd(least(white, points @ curved, hold), full_matrices=False)
    shares = (made_of @ curved @ turned.T)[:, weights * 0.01 * extent < 1.0]
    return lambda places: basic(places) @ shares


def least(white, points, hold):
    """(m, k) the least that rows see where points (3n, k) move on the whole, all unknowns as they like.

    What rows (h, 3n) hold stays.

    What the points do has a mean product of 1 with one motion, of 0 with the others.
    """
    n, k = points.shape
    if not k:
        return white[:, :0]
    k += len(hold)
    rest = np.zeros((white.shape[1], white.shape[1] - k))
    rest[:n, : n - k] = np.linalg.svd(np.vstack([points.T, hold]))[2][k:].T
    rest[n:, n - k :] = np.eye(len(rest) - n)
    rows, free = white[:, :n] @ points, white @ rest
    scale = np.maximum(np.linalg.norm(free, axis=0), 1e-300)
    return rows - free @ (np.linalg.lstsq(free / scale, rows, rcond=1e-12)[0] / scale[:, None])


class Unknowns:
    """The layout of the unknowns of a network, and their values; rotations and axes are turned about 0."""

    def __init__(self, network, is_true=False):
        self.network, self.at, self.values = network, {}, np.zeros(0)
        self.bases = {}
        start = [p.true if is_true or p.start is None else p.start for p in network.points]
        for point, xyz in zip(network.points, start, strict=True):
            self.add(("point", point.name), xyz)
        for number in range(len(network.setups)):
            if network.orientation(number) in ("VERT", "BASC"):
                self.add(("turn", number), np.zeros(3 if network.orientation(number) == "BASC" else 1))
        for o in network.observations:
            for key, value in self._shared(o):
                if key not in self.at:
                    self.add(key, value)

    def add(self, key, values):
        """A part of this name, where it starts."""
        values = np.atleast_1d(values)
        self.at[key] = slice(len(self.values), len(self.values) + len(values))
        self.values = np.concatenate([self.values, values])

    def _shared(self, o):
        """Unknowns that an observation shares with others, and where they start."""
        names, wanted = self.network.names, self.network.estimate
        place = lambda name: self.values[self.at["point", name]]  # noqa: E731
        if o.kind == "EqualDist":
            yield ("value", o.group), norm(place(o.b) - place(o.a)).real
        elif o.kind == "EqualDH":
            frame = self.network.frame
            yield ("value", o.group), np.real(frame.geodetic(place(o.b))[2] - frame.geodetic(place(o.a))[2])
        elif o.kind in ("AxisRadius", "AxisPlane"):
            self._axis(o.axis)
            normal = self.bases[o.axis][0]
            arm = place(o.b) - place(o.a)
            yield ("axis", o.axis), np.zeros(2)
            yield ("shift", o.group), arm @ normal
            yield ("radius", o.group), np.linalg.norm(arm - (arm @ normal) * normal)
        elif o.kind in DISTANCES and (o.group or not wanted.isdisjoint(("constant", "scale"))):
            if o.group and "frame-scale" in wanted:
                yield ("frame-scale", o.group), 0.0
            elif not o.group:
                for part in ("constant", "scale"):
                    if part in wanted:
                        yield (part, o.instrument), 0.0
        elif o.kind == "Zen" and "refraction" in wanted and self._is_plumb(o):
            yield ("refraction", o.instrument), self.network.refraction
        elif o.kind in READ_ALONG and "frame-scale" in wanted:
            yield ("frame-scale", o.setup), 0.0
        assert o.b in names or o.members

    def _is_plumb(self, o):
        return self.network.orientation(o.setup) != "BASC"

    def _axis(self, name):
        """Normal of an axis where it starts, through the positions of one of its targets, and two across."""
        if name in self.bases:
            return
        rows = [o for o in self.network.observations if o.axis == name and o.kind == "AxisRadius"]
        groups = {o.group for o in rows}
        best = np.zeros(3)
        for group in groups:
            xyz = np.array([self.values[self.at["point", o.b]] for o in rows if o.group == group])
            for i in range(len(xyz)):
                for j in range(i):
                    normal = np.cross(xyz[i] - xyz[0], xyz[j] - xyz[0])
                    best = normal if norm(normal).real > norm(best).real else best
        self.bases[name] = with_two_across(best)

    def take(self, step):
        """Moves by a step; turns are absorbed in the rotations and axes, which are 0 again."""
        self.values = self.values + step
        for key, part in self.at.items():
            if key[0] in TURNS and key[-1] in self.bases:
                self.bases[key[-1]] = rotation(self.values[part]) @ self.bases[key[-1]]
                self.values[part] = 0
            elif key[0] in DIRECTIONS:
                base = self.bases[key[1]]
                moved = base[0] + self.values[part] @ base[1:]
                self.bases[key[1]], self.values[part] = with_two_across(moved), 0

    def points(self):
        """(n, 3) coordinates in the frame."""
        return self.values[: 3 * len(self.network.points)].reshape(-1, 3)


def with_two_across(direction):
    """(3, 3) a unit direction, and two at right angles to it and to each other."""
    unit = np.asarray(direction) / np.linalg.norm(direction)
    return np.concatenate([unit[None], np.linalg.svd(unit[None])[2][1:]])


def rotation(w):
    """Right-handed rotation about w (3,), by its length."""
    angle = np.linalg.norm(w)
    if angle == 0:
        return np.eye(3)
    k = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]]) / angle
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def readings(rows):
    """Of the rows of a free set-up: (observation, vector or direction read) for each target that has one."""
    found = []
    for target in dict.fromkeys(o.b for o in rows):
        of = {o.kind: o for o in rows if o.b == target}
        if {"DX", "DY", "DZ"} <= set(of):
            found.append((of["DX"], np.array([of[kind].value for kind in ("DX", "DY", "DZ")])))
        elif {"Hz", "Zen"} <= set(of):
            hz, zen = of["Hz"].value, of["Zen"].value
            found.append(
                (of["Hz"], np.array([np.sin(zen) * np.sin(hz), np.sin(zen) * np.cos(hz), np.cos(zen)]))
            )
        elif {"Alpha", "Beta"} <= set(of):
            al, be = of["Alpha"].value, of["Beta"].value
            found.append(
                (of["Alpha"], np.array([np.cos(be) * np.cos(al), np.cos(be) * np.sin(al), np.sin(be)]))
            )
    return found
