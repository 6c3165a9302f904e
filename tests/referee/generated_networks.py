"""Random mixed networks, from a seed: places, systems, sizes, kinds of observations, points and datums."""

from dataclasses import dataclass

import numpy as np
from referee.earth import WGS84, Frame, Ground, System, euler, tangent
from referee.network import ANGLES, Equations, Network, Observation, Point, Setup, Unknowns, rotation

ARC_SECOND = np.pi / 648000
BESSEL = Ground(6377397.155, 0.006674372230614, (674.374, 15.056, 405.346))
SWISS = (
    "+proj=somerc +lat_0=46.95240555555556 +lon_0=7.439583333333333 +k_0=1 +x_0=2600000 +y_0=1200000 "
    "+ellps=bessel"
)
LAMBERT = "+proj=lcc +lat_0=46.5 +lon_0=3 +lat_1=49 +lat_2=44 +x_0=700000 +y_0=6600000 +ellps=GRS80"
POLAR = "+proj=stere +lat_0=90 +lat_ts=90 +lon_0=0 +k=0.994 +x_0=2000000 +y_0=2000000 +ellps=WGS84"
DIALECTS = ("obs", "table", "comp3d")


@dataclass(frozen=True)
class Case:
    """A network, and how its files are written."""

    seed: int
    dialect: str
    network: Network
    unit: str  # of angles in its files
    place: str


def from_plan(projection, ellipsoid):
    """Steps of PROJ from a projection to geocentric axes."""
    return f"+step +inv {projection} +step +proj=cart +ellps={ellipsoid}"


def placed(random, dialect):
    """A frame and the system of the points, somewhere; and a word for where."""
    where = random.choice(["plane", "pole", "pole", "anywhere", "anywhere", "date line", "map", "rigid"])
    if dialect == "comp3d":
        return _comp3d_place(random, where)
    if where == "plane":
        frame = Frame("Local", "plane")
        return frame, System("Local", frame), where
    if where == "map":
        return _on_a_map(random)
    latitude = float(np.sign(random.uniform(-1, 1)) * random.uniform(88, 90 - 1e-4))
    if where != "pole":
        latitude = float(random.uniform(-75, 75))
    longitude = float(
        random.uniform(-180, 180) if where != "date line" else random.choice([179.9999, -179.9999])
    )
    frame = tangent(longitude, latitude, float(random.choice([0.0, 350.0])))
    if where == "rigid":
        return (*_rigid(random, frame), where)
    if random.random() < 0.5:
        return frame, System("EPSG:4326", frame, "degrees"), where
    if where == "pole" and latitude > 0 and random.random() < 0.5:
        return frame, System("EPSG:5041", frame, from_plan(POLAR, "WGS84")), where
    return frame, System(frame.definition, frame), where


def _rigid(random, near):
    """A frame without verticals."""
    if random.random() < 0.4:
        frame = Frame("GeoC", "rigid")
        return frame, System("GeoC", frame)
    angles = random.uniform(-3, 3, 3).tolist()
    definition = "LEuc*" + "*".join(repr(float(x)) for x in (*near.T, *angles))
    frame = Frame(definition, "rigid", euler(*angles), near.T)
    return frame, System(definition, frame)


def _on_a_map(random):
    word = random.choice(["Lambert", "UTM", "Swiss"])
    if word == "Swiss":
        frame = tangent(float(random.uniform(6.5, 9.5)), float(random.uniform(46, 47.4)), 450.0, BESSEL)
        shift = "+step +proj=helmert +x=674.374 +y=15.056 +z=405.346"
        definition = f"{SWISS} +towgs84=674.374,15.056,405.346,0,0,0,0 +units=m +no_defs"
        return frame, System(definition, frame, f"{from_plan(SWISS, 'bessel')} {shift}"), word
    frame = tangent(float(random.uniform(1, 5)), float(random.uniform(44, 49)), 100.0)
    if word == "Lambert":
        return frame, System("EPSG:2154", frame, from_plan(LAMBERT, "WGS84")), word
    return frame, System("EPSG:32631", frame, from_plan("+proj=utm +zone=31 +ellps=WGS84", "WGS84")), word


def _comp3d_place(random, where):
    """A project of Comp3D: a stereographic plane around its centre, or a map."""
    if where in ("map", "anywhere"):
        frame, system, word = _on_a_map(random)
        while word == "Swiss":
            frame, system, word = _on_a_map(random)
        centre = np.round(np.real(system.coordinates(np.zeros(3)))[:2]).tolist()
    else:
        latitude = float(
            random.uniform(-75, 75) if where != "pole" else random.choice([-1, 1]) * random.uniform(88, 90)
        )
        centre = random.choice([[0.0, 0.0], [5000.0, -3000.0]]).tolist()
        projection = f"+proj=sterea +lat_0={latitude!r} +lon_0=0 +k_0=1 +x_0={centre[0]!r} +y_0={centre[1]!r}"
        system, word = (
            System(projection, None, from_plan(f"{projection} +ellps=WGS84", "WGS84")),
            f"local {where}",
        )
    earth = np.array(system._proj.transform(*centre, 0.0))
    longitude, latitude, _ = np.real(WGS84.geodetic(earth))
    origin = tangent(float(np.degrees(longitude)), float(np.degrees(latitude)), 0.0)
    frame = Frame(f"RTL*{centre[0]!r}*{centre[1]!r}*0*{system.definition}", "tangent", origin.R, origin.T)
    return frame, System(system.definition, frame, system.to_earth), word


class Maker:
    """Makes one network."""

    def __init__(self, seed):
        self.random = random = np.random.default_rng([seed, 36])
        self.seed, self.dialect = seed, str(random.choice(DIALECTS))
        self.frame, self.system, self.place = placed(random, self.dialect)
        self.size = float(10 ** random.uniform(1, random.choice([3, 3, 3, 3, 4, 5])))
        self.angle = float(10 ** random.uniform(-5.3, -4.2))
        self.length = float(10 ** random.uniform(-3.7, -2.3))
        self.n = int(random.integers(4, 10))
        self.has_heights = self.frame.kind != "rigid" and random.random() < 0.5
        self.has_relative = random.random() < 0.3
        self.is_sparse = random.random() < 0.1  # approximate coordinates are not given
        self.is_weak = random.random() < 0.15  # one known point and an azimuth hold it
        self.names = [f"P{k}" for k in range(self.n)]
        self.xyz = {name: self.place_one() for name in self.names}
        self.setups, self.observations, self.clusters = [], [], []
        self.kinds = {}

    def place_one(self):
        """A point on gentle ground, near the origin of the frame."""
        r = self.random
        away = 0.0 if r.random() < 0.9 else self.size
        flat = np.array(
            [*(r.uniform(-0.5, 0.5, 2) * self.size + away), r.uniform(-0.1, 0.1) * min(self.size, 800)]
        )
        if self.frame.kind != "rigid":
            return flat
        if not hasattr(self, "_up"):
            near = tangent(float(r.uniform(-180, 180)), float(r.uniform(-75, 75)), 200.0)
            near = near if self.frame.definition == "GeoC" else tangent(*self._middle())
            self._up = near
        return (self._up.earth(flat) - self.frame.T) @ self.frame.R

    def _middle(self):
        longitude, latitude, height = np.real(WGS84.geodetic(self.frame.T))
        return float(np.degrees(longitude)), float(np.degrees(latitude)), float(height)

    def add(self, kind, a, b, sigma, **more):
        """An observation, whose value comes later."""
        heights = {}
        if self.has_heights and kind not in UNRAISED and self.dialect != "comp3d":
            heights = {"hi": 0.0 if a == b else self.height(), "ht": self.height()}
        if self.has_relative and kind in ("Hz", "Zen", "Dist") and "relative" not in more:
            more["relative"] = 1e-3 if kind in ANGLES else 2e-6
        self.observations.append(Observation(kind, a, b, 0.0, float(sigma), **heights | more))

    def height(self):
        """Of an instrument or a target."""
        return float(np.round(self.random.uniform(0, 2), 3))

    def others(self, name, most=None):
        """Other points in any order."""
        names = [other for other in self.random.permutation(self.names).tolist() if other != name]
        return names[: most or self.n]

    def station(self, name, orientation):
        """A set-up that reads directions, zenith angles and distances, or components."""
        r = self.random
        self.setups.append(Setup(name, orientation))
        number = len(self.setups) - 1
        vectors = r.random() < 0.25 and self.dialect != "comp3d"
        instrument = str(r.choice(["TS1", "TS2"])) if self.dialect != "comp3d" else ""
        for target in self.others(name, int(r.integers(3, self.n + 1))):
            if vectors:
                for kind in ("DX", "DY", "DZ"):
                    self.add(kind, name, target, self.length, setup=number)
                continue
            self.add("Hz", name, target, self.angle, setup=number)
            if r.random() < 0.85 or orientation == "BASC":
                self.add("Zen", name, target, 1.5 * self.angle, setup=number, instrument=instrument)
            if r.random() < 0.8:
                self.add("Dist", name, target, self.length, instrument=instrument)

    def simple(self):
        """Observations without an instrument."""
        r, pick = self.random, lambda: self.random.permutation(self.names)[:2].tolist()
        for _ in range(int(r.integers(1, self.n))):
            self.add("DH", *pick(), self.length / 2)
        if r.random() < 0.4 and self.frame.definition != "GeoC":
            self.add("DistHz0", *pick(), self.length)
        if r.random() < 0.4 and self.frame.kind != "rigid" and self.dialect != "comp3d":
            self.add("DistHz", *pick(), self.length, instrument="TS1")
        if (r.random() < 0.4 or self.is_weak) and self.frame.kind != "rigid":
            a, b = pick()
            self.setups.append(Setup(a, "FIX"))
            self.add("Azim", a, b, self.angle, setup=len(self.setups) - 1)

    def partial(self):
        """Points of which the height alone, or the plan alone, is sought."""
        r = self.random
        for word, count in (("height", int(r.integers(0, 3))), ("plan", int(r.integers(0, 2)))):
            for k in range(count):
                name = f"{word}{k}"
                self.xyz[name] = self.place_one()
                if word == "height":
                    self.kinds[name] = str(r.choice(["0 0 -", "0 0 s"]))
                    for a in self.others(name, 2):
                        self.add("DH", *r.permutation([a, name]).tolist(), self.length)
                    continue
                self.kinds[name] = str(r.choice(["- - 0", "s s 0"]))
                for setup in [k for k, s in enumerate(self.setups) if s.orientation == "VERT"][:3]:
                    self.add("Hz", self.setups[setup].origin, name, self.angle, setup=setup)
                    last = max(
                        (row for row, o in enumerate(self.observations[:-1]) if o.setup == setup), default=-2
                    )
                    self.observations.insert(last + 1, self.observations.pop())
                self.add("DistHz0", self.names[0], name, self.length)

    def tabled(self):
        """What tables alone can say."""
        r = self.random
        everywhere = self.frame.kind != "plane"
        for _ in range(int(r.integers(0, 5))):
            a, b, c = r.permutation(self.names)[:3].tolist()
            word = str(r.choice(["L", "V", "Geo", "P", "Height", "LatLon", "Chord", "Angle", "Bary"]))
            if word in ("L", "V", "Geo", "P") and (everywhere or word in "LP"):
                at = (b, b) if word in ("Geo", "P") else (a, b)
                axes = "xyz" if word == "P" else "XYZ"
                for axis in axes:
                    self.add(word + axis, *at, self.length)
                self.cluster(3)
            elif word == "Angle" and self.frame.kind != "rigid":
                self.add("Angle", a, b, 2 * self.angle, backsight=c)
            elif word in ("Height", "Chord") and everywhere:
                self.add(word, *((b, b) if word == "Height" else (a, b)), self.length)
            elif word == "LatLon" and self.frame.kind == "tangent" and self.place != "pole":
                for kind in ("Lat", "Lon"):
                    self.add(kind, b, b, 3 * self.length / 6.4e6)
            elif word == "Bary":
                self.barycentre(a, (b, c))

    def cluster(self, k, always=False):
        """Correlates the last k observations, mostly."""
        if always or self.random.random() < 0.8:
            rows = list(range(len(self.observations) - k, len(self.observations)))
            root = np.diag([self.observations[row].sigma for row in rows])
            mixed = np.eye(k) + 0.4 * self.random.uniform(-1, 1, (k, k))
            block = root @ mixed @ mixed.T @ root
            for row, variance in zip(rows, np.diag(block), strict=True):
                self.observations[row].sigma = float(np.sqrt(variance))
            self.clusters.append((rows, block))

    def barycentre(self, name, members):
        weights = tuple(self.random.integers(1, 4, len(members)).astype(float).tolist())
        for axis in "XYZ":
            self.add(f"Bary{axis}", name, "", self.length, members=tuple(members), weights=weights)

    def comp3d(self):
        """What only projects of Comp3D have: sub-frames, axes, vectors, equalities, grid components."""
        r = self.random
        for _ in range(int(r.integers(0, 3))):
            name, plumb = str(r.choice(self.names)), r.random() < 0.5
            self.setups.append(Setup(name, "VERT" if plumb else "BASC"))
            number, polar, group = len(self.setups) - 1, r.random() < 0.5, f"polar{len(self.setups)}"
            for target in self.others(name, int(r.integers(3, 6))):
                kinds = ("Alpha", "Beta", "Dist") if polar else ("DX", "DY", "DZ")
                ht = 1.5 if self.has_heights else 0.0
                for kind in kinds:
                    more = {"group": group} if kind == "Dist" else {"setup": number}
                    self.add(
                        kind,
                        name,
                        target,
                        self.angle if kind in ANGLES else self.length,
                        ht=ht,
                        relative=0.0,
                        **more,
                    )
        if r.random() < 0.3:
            self.turning()
        if r.random() < 0.4:
            a, b = r.permutation(self.names)[:2].tolist()
            self.setups.append(Setup(a, "GRID"))
            for kind in ("DX", "DY"):
                self.add(kind, a, b, self.length, setup=len(self.setups) - 1)
        if r.random() < 0.4 and not self.place.startswith("local"):
            for target in self.others(str(r.choice(self.names)), 2):
                a = next(name for name in self.names if name != target)
                for axis in "XYZ":
                    self.add(f"V{axis}", a, target, self.length)
                self.cluster(3, always=True)
        for kind in ("EqualDist", "EqualDH"):
            if r.random() < 0.3:
                self.equal(kind)

    def turning(self):
        """Targets on circles about an axis through a new point, each seen from an old one."""
        r, group = self.random, f"axis{len(self.names)}"
        n = r.normal(size=3)
        n /= np.linalg.norm(n)
        across = np.linalg.svd(n[None])[2][1:]
        centre, origin = self.place_one() + 3.0, f"O{len(self.names)}"
        self.names.append(origin)
        self.xyz[origin] = centre
        for target in range(int(r.integers(1, 3))):
            radius, shift = r.uniform(2, 6), r.uniform(-3, 3)
            for position in range(int(r.integers(4, 6))):
                angle = position * 1.2 + r.uniform(-0.2, 0.2)
                name = f"T{target}{position}"
                self.names.append(name)
                arm = radius * (np.cos(angle) * across[0] + np.sin(angle) * across[1])
                noise = r.normal(0, self.length, 3)
                self.xyz[name] = centre + shift * n + arm + noise
                for kind in ("AxisRadius", "AxisPlane"):
                    self.add(kind, origin, name, self.length, group=f"{group}/{target}", axis=group)
                for a in self.others(name, 2)[:2]:
                    self.polar(a, name)
        foot = f"F{len(self.names)}"
        self.names.append(foot)
        self.xyz[foot] = centre + 4 * across[0]
        self.polar(self.names[0], foot)
        self.polar(self.names[1], foot)
        self.add("AxisFoot", origin, foot, 0.001, axis=group)

    def polar(self, a, b):
        """A small set-up of its own that determines a point."""
        self.setups.append(Setup(a, "VERT"))
        number = len(self.setups) - 1
        for target in dict.fromkeys((b, *self.others(a, 2))):
            self.add("Hz", a, target, self.angle, setup=number)
            self.add("Zen", a, target, self.angle, setup=number)
            self.add("Dist", a, target, self.length)

    def equal(self, kind):
        """Two or three pairs of new points whose distances, or rises, are equal but for their sigma."""
        r, group = self.random, kind + str(len(self.names))
        step = r.uniform(-1, 1, 3) * (5, 5, 1)
        for k in range(int(r.integers(2, 4))):
            pair = [f"{kind[5:7]}{k}a", f"{kind[5:7]}{k}b"]
            first = self.place_one()
            turn = (
                np.linalg.norm(step) * np.array([np.sin(k), np.cos(k), 0.1]) if kind == "EqualDist" else step
            )
            up = np.real(self.frame.normals(first))[2]
            last = first + turn
            if kind == "EqualDH":
                rise = np.real(self.frame.geodetic(last)[2] - self.frame.geodetic(first)[2])
                last = last + (step[2] - rise) * up
            if kind == "EqualDist":
                last = first + turn / np.linalg.norm(turn) * np.linalg.norm(step)
            for name, xyz in zip(pair, (first, last + r.normal(0, self.length) * up), strict=True):
                self.names.append(name)
                self.xyz[name] = xyz
                self.polar(self.names[int(r.integers(0, 3))], name)
            self.add(kind, *pair, self.length, group=group)

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

    def made(self):
        """The network, with values and starts."""
        if self.frame.kind != "rigid" and self.random.random() < 0.08:
            self.levelling()
        else:
            self.measure()
        return self.finished()

    def levelling(self):
        """A loop through points of known plan, and shortcuts."""
        r, n = self.random, self.n
        for name in self.names:
            self.kinds[name] = "0 0 -" if self.kinds else "0 0 s"
        pairs = [(k, (k + 1) % n) for k in range(n)]
        pairs += [r.permutation(n)[:2].tolist() for _ in range(int(r.integers(0, n)))]
        for a, b in pairs:
            self.add("DH", self.names[a], self.names[b], self.length / 5)

    def measure(self):
        """All kinds of observations."""
        r = self.random
        words = ["VERT", "VERT", "VERT", "FIX", "BASC"] if self.frame.kind != "rigid" else ["FIX", "BASC"]
        if self.dialect == "comp3d":
            words = ["VERT"]
        for name in self.names[: int(r.integers(2, self.n))]:
            self.station(name, str(r.choice(words)))
        self.simple()
        if self.frame.kind != "rigid" and r.random() < 0.3:
            self.partial()
        if self.dialect != "obs":
            self.tabled() if self.dialect == "table" else self.comp3d()

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
        """Starts free coordinates away from the truth, by what a map would say."""
        far = 0.01 * min(self.size, 300.0) * float(self.random.uniform(0, 1))
        for p in network.points:
            free = np.isnan(p.sigmas)
            metres = network.system.metres(p.true)
            p.given = p.given + free * self.random.normal(0, far, 3) * (1, 1, 0.3) / metres
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


UNRAISED = (
    "DistHz0",
    "Angle",
    "Chord",
    "BaryX",
    "BaryY",
    "BaryZ",
    "Lat",
    "Lon",
    "LX",
    "LY",
    "LZ",
    "Px",
    "Py",
    "Pz",
    "AxisRadius",
    "AxisPlane",
    "AxisFoot",
    "EqualDH",
    "EqualDist",
    "VX",
    "VY",
    "VZ",
    "GeoX",
    "GeoY",
    "GeoZ",
)


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
