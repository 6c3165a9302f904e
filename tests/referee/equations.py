"""Residuals of a network, observation by observation, as the definitions say them.

All are computed minus observed, in metres and radians. A "row" of unknowns is one state of the whole network:
residuals are evaluated for many rows at once, of which each moves one unknown by 1e-30 i.
"""

import numpy as np
from referee.earth import atan2, dot, norm, turned, wrapped
from referee.network import ANGLES, AXES, READ_ALONG, readings


def about_north_and_east(eta, xi):
    """The axes of the plumb line from east, north, up: Comp3D's rotation of a deflection."""
    (se, ce), (sx, cx) = (np.sin(eta), np.cos(eta)), (np.sin(xi), np.cos(xi))
    return np.array([[ce, 0, -se], [0, 1, 0], [se, 0, ce]]) @ np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])


class Equations:
    """Residuals and sigmas of a network at rows (m, n) of unknowns."""

    def __init__(self, network, unknowns, rows=None):
        self.net, self.unknowns = network, unknowns
        self.rows = unknowns.values[None] if rows is None else rows
        self._plumbs = {}

    def point(self, name):
        return self.rows[:, self.unknowns.at["point", name]]

    def own(self, *key):
        """(m,) the value of an unknown of one number."""
        return self.rows[:, self.unknowns.at[key]][:, 0]

    def plumb(self, name):
        """(m, 3, 3) rows east, north, up along the plumb line of a point."""
        if name not in self._plumbs:
            axes = self.net.frame.verticals(self.point(name))
            deflection = self.net.points[self.net.names[name]].deflection
            self._plumbs[name] = axes if deflection is None else about_north_and_east(*deflection) @ axes
        return self._plumbs[name]

    def sight(self, o):
        """(m, 3) from instrument to target."""
        sight = self.point(o.b) - self.point(o.a)
        if o.ht:
            sight = sight + o.ht * self.plumb(o.b)[..., 2, :]
        return sight - o.hi * self.plumb(o.a)[..., 2, :] if o.hi else sight

    def upright(self, o):
        """(m, 3) the sight along east, north and up of the instrument's plumb line."""
        return turned(self.plumb(o.a), self.sight(o))

    def aimed(self, o):
        """(m, 3) the sight along the axes of the instrument."""
        setup, word = o.setup, self.net.orientation(o.setup)
        if word == "BASC":
            w = self.rows[:, self.unknowns.at["turn", setup]]
            start = self.sight(o) @ self.unknowns.bases[setup].T
            return start + np.cross(w, start)
        v = self.upright(o)
        if word == "FIX":
            return v
        axes = self.plumb(o.a)
        g = atan2(axes[..., 0, 1], axes[..., 1, 1]) if word == "GRID" else self.own("turn", setup)
        c, s = np.cos(g), np.sin(g)
        return np.stack([c * v[..., 0] - s * v[..., 1], s * v[..., 0] + c * v[..., 1], v[..., 2]], axis=-1)

    def orient(self):
        """Gives set-ups that turn their orientation where they start, by what they read."""
        for number in range(len(self.net.setups)):
            rows = [o for o in self.net.observations if o.setup == number]
            word = self.net.orientation(number)
            if word == "VERT":
                self._orient_upright(number, rows)
            elif word == "BASC":
                read = readings(rows)
                both = [(v, np.real(self.sight(o)[0])) for o, v in read]
                a, b = (np.array([v / np.linalg.norm(v) for v in part]) for part in zip(*both, strict=True))
                u, _, vt = np.linalg.svd(a.T @ b)
                handed = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
                self.unknowns.bases[number] = u @ handed @ vt

    def _orient_upright(self, number, rows):
        east, north, _ = np.real(self.upright(rows[0])[0])
        for o in rows:
            if o.kind in ("Hz", "Alpha"):
                read = o.value if o.kind == "Hz" else np.pi / 2 - o.value
                east, north, _ = np.real(self.upright(o)[0])
                break
        else:
            of = {o.kind: o.value for o in rows if o.b == rows[0].b}
            read = np.arctan2(of["DX"], of["DY"])
        self.unknowns.values[self.unknowns.at["turn", number]] = np.arctan2(east, north) - read

    def observed(self):
        """(n,) residuals (m,) of all observations, and their sigmas."""
        rows = self.net.observations
        return [self.residual(o) for o in rows], [self.sigma(o) for o in rows]

    def residual(self, o):
        """(m,) computed minus observed."""
        name = f"_{o.kind.lower()}"
        if hasattr(self, name):
            return getattr(self, name)(o)
        if o.kind in READ_ALONG:
            return self._component(o)
        if o.kind[0] in "VL" and o.kind[1:] in AXES:
            turn = self.net.frame.R if o.kind[0] == "V" else np.eye(3)
            return self.sight(o) @ turn[AXES[o.kind[1]]] - o.value
        if o.kind[:-1] == "Geo":
            at = self.point(o.b) + o.ht * self.plumb(o.b)[..., 2, :] if o.ht else self.point(o.b)
            return self.net.frame.earth(at)[..., AXES[o.kind[-1]]] - o.value
        if o.kind[:-1] == "Bary":
            return self._barycentre(o)
        assert o.kind[0] == "P", o.kind
        return self.point(o.b)[..., AXES[o.kind[1]]] - o.value

    def _dist(self, o):
        return self._length(o, norm(self.sight(o)))

    def _disthz(self, o):
        return self._length(o, norm(self.upright(o)[..., :2]))

    def _length(self, o, computed):
        wanted = self.net.estimate
        if o.group:  # of a polar sub-frame
            scale = self.own("frame-scale", o.group) if "frame-scale" in wanted else 0.0
            return computed - (1 + scale) * o.value
        constant = self.own("constant", o.instrument) if "constant" in wanted else 0.0
        scale = self.own("scale", o.instrument) if "scale" in wanted else 0.0
        return computed - constant - (1 + scale) * o.value

    def _disthz0(self, o):
        centre, radius = self.net.frame.sphere
        a = self.point(o.a) - centre
        sight = self.point(o.b) - self.point(o.a)
        return radius * atan2(norm(np.cross(a, sight)), dot(a, a + sight)) - o.value

    def _rise(self, o):
        """Levelled from a to b: heights, and the slope of level surfaces along the line."""
        frame = self.net.frame
        rise = frame.geodetic(self.point(o.b))[2] - frame.geodetic(self.point(o.a))[2]
        if not self.net.is_deflected:
            return rise
        both = [self.net.points[self.net.names[name]].deflection or (0.0, 0.0) for name in (o.a, o.b)]
        mean = np.mean(both, axis=0)
        flat = turned(frame.verticals(self.point(o.a)), self.point(o.b) - self.point(o.a))[..., :2]
        return rise + flat @ mean

    def _dh(self, o):
        return self._rise(o) + o.ht - o.hi - o.value

    def _equaldh(self, o):
        return self._rise(o) - self.own("value", o.group)

    def _equaldist(self, o):
        return norm(self.point(o.b) - self.point(o.a)) - self.own("value", o.group)

    def _hz(self, o):
        v = self.aimed(o)
        return wrapped(atan2(v[..., 0], v[..., 1]) - o.value)

    _azim = _hz

    def _zen(self, o):
        v, net = self.aimed(o), self.net
        arc = net.frame.arc(self.point(o.a), self.point(o.b))
        is_own = ("refraction", o.instrument) in self.unknowns.at and net.orientation(o.setup) != "BASC"
        k = self.own("refraction", o.instrument) if is_own else net.refraction
        bent = (k - (1.0 if net.frame.kind == "plane" else 0.0)) * arc
        return wrapped(atan2(norm(v[..., :2]), v[..., 2]) - bent - o.value)

    def _angle(self, o):
        axes = self.plumb(o.a)
        to, back = (turned(axes, self.point(name) - self.point(o.a)) for name in (o.b, o.backsight))
        return wrapped(atan2(to[..., 0], to[..., 1]) - atan2(back[..., 0], back[..., 1]) - o.value)

    def _component(self, o):
        computed = self.aimed(o)[..., READ_ALONG[o.kind]]
        if self.net.orientation(o.setup) == "GRID":
            frame = self.net.frame
            computed = computed / (1 + frame.geodetic(self.point(o.a))[2] / frame.sphere[1])
        scale = self.own("frame-scale", o.setup) if "frame-scale" in self.net.estimate else 0.0
        return computed - (1 + scale) * o.value

    def _alpha(self, o):
        v = self.aimed(o)
        return wrapped(atan2(v[..., 1], v[..., 0]) - o.value)

    def _beta(self, o):
        v = self.aimed(o)
        return wrapped(atan2(v[..., 2], norm(v[..., :2])) - o.value)

    def axis(self, name):
        """(m, 3) unit direction; a given one that is no unknown."""
        base = self.unknowns.bases[name]
        if ("axis", name) not in self.unknowns.at:
            return np.broadcast_to(base[0], (len(self.rows), 3))
        du, dv = np.moveaxis(self.rows[:, self.unknowns.at["axis", name]], -1, 0)
        n = base[0] + du[:, None] * base[1] + dv[:, None] * base[2]
        return n / norm(n)[:, None]

    def _axisradius(self, o):
        shift = self.own("shift", o.group)[:, None]
        centre = self.point(o.a) + shift * self.axis(o.axis)
        return norm(self.point(o.b) - centre) - self.own("radius", o.group)

    def _axisplane(self, o):
        n = self.axis(o.axis)
        return dot(n, self.point(o.a) - self.point(o.b)) + self.own("shift", o.group)

    def _axisfoot(self, o):
        arm = self.point(o.b) - self.point(o.a)
        return dot(self.axis(o.axis), arm) / norm(arm.real)

    def _of_place(self, o, component):
        at = self.point(o.b) + o.ht * self.plumb(o.b)[..., 2, :] if o.ht else self.point(o.b)
        return self.net.frame.geodetic(at)[component]

    def _lon(self, o):
        return wrapped(self._of_place(o, 0) - o.value)

    def _lat(self, o):
        return self._of_place(o, 1) - o.value

    def _height(self, o):
        return self._of_place(o, 2) - o.value

    def _chord(self, o):
        feet = []
        for name in (o.a, o.b):
            longitude, latitude, _ = self.net.frame.geodetic(self.point(name))
            feet.append(self.net.frame.ground.geocentric(longitude, latitude, 0 * latitude))
        return norm(feet[1] - feet[0]) - o.value

    def _barycentre(self, o):
        axis = AXES[o.kind[-1]]
        parts = [w * self.point(name)[..., axis] for w, name in zip(o.weights, o.members, strict=True)]
        return self.point(o.a)[..., axis] - sum(parts) / sum(o.weights) - o.value

    def sigma(self, o):
        """Standard deviation at the first row, with its relative part."""
        if not o.relative:
            return o.sigma
        length = np.linalg.norm(np.real(self.sight(o)[0]))
        return o.sigma + (o.relative / length if o.kind in ANGLES else o.relative * length)

    def coordinate(self, name, component):
        """(m,) a known coordinate: how far it is from what is given, m along the axes of the system."""
        row = self.net.names[name]
        gap = self.net.system.gap(self.point(name), self.net.given[row])[..., component]
        return gap * self.net.system.metres(np.real(self.point(name)))[..., component]
