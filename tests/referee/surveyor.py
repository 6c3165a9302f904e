"""A surveyor who measures whatever a dialect of files can say, at random."""

import numpy as np
from referee.earth import WGS84, tangent
from referee.network import ANGLES, Observation, Setup
from referee.places import placed

DIALECTS = ("obs", "table", "comp3d")
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


class Surveyor:
    """Points and observations of one network, without values."""

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
