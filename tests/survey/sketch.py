"""Networks of a few points, drawn by hand: true coordinates, exact observations, what is found from them."""

import math
from pathlib import Path

import numpy as np

from obseq.survey import InitialValues, initial_values, join, make_points, read_obs

GON = 200.0 / math.pi


def flat(points):
    return np.tile(np.eye(3), (len(points), 1, 1))


class Sketch:
    """Points with true coordinates, and exact observations of them in a flat frame."""

    def __init__(self, folder: Path, **points: tuple[float, float, float]):
        self.file = folder / "sketch.obs"
        self.truth = {name: np.array(xyz, float) for name, xyz in points.items()}
        self.lines: list[str] = []
        self.heights = 0.0, 0.0

    def raised(self, instrument, target):
        """Instruments and targets of what follows stand so high above their points."""
        self.heights = instrument, target
        return self

    def _seen(self, origin, target):
        """From the instrument on one point to the target on another."""
        return self.truth[target] - self.truth[origin] + (0.0, 0.0, self.heights[1] - self.heights[0])

    def _add(self, code, origin, target, value):
        instrument, raised = self.heights
        self.lines.append(f"{code} {origin} {target} {value!r} 0.001 0 {instrument} {raised}")

    def write(self, text):
        self.lines.append(text)
        return self

    def hz(self, station, *targets, g0=0.0):
        for target in targets:
            east, north, _ = self.truth[target] - self.truth[station]
            reading = math.remainder(math.atan2(east, north) - g0, 2 * math.pi)
            self._add(5, station, target, float(reading * GON))
        return self

    def zen(self, station, *targets):
        for target in targets:
            east, north, up = self._seen(station, target)
            self._add(6, station, target, float(math.atan2(math.hypot(east, north), up) * GON))
        return self

    def dist(self, a, *others):
        for b in others:
            self._add(3, a, b, float(np.linalg.norm(self._seen(a, b))))
        return self

    def dh(self, a, *others):
        for b in others:
            self._add(4, a, b, float(self._seen(a, b)[2]))
        return self

    def dxyz(self, station, *targets, rotation=None, codes=(14, 15, 16)):
        """Vectors in the instrument; `rotation` is instrument -> frame."""
        turn = np.eye(3) if rotation is None else np.asarray(rotation)
        for target in targets:
            vector = turn.T @ self._seen(station, target)
            for code, value in zip((14, 15, 16), vector, strict=True):
                if code in codes:
                    self._add(code, station, target, float(value))
        return self

    def full(self, station, *targets, g0=0.0):
        return self.hz(station, *targets, g0=g0).zen(station, *targets).dist(station, *targets)

    def solve(self, *known, hints=None, vertical=flat, recompute=False) -> "Solution":
        self.file.write_text("\n".join(self.lines))
        names, hints = [*known, *(hints or {})], hints or {}
        rows = [self.truth[name] for name in known] + list(hints.values())
        sigmas = np.full((len(names), 3), 0.001)
        sigmas[len(known) :] = np.nan
        points, book = join(make_points(names, rows, sigmas), read_obs(self.file))
        return Solution(self, points.names, initial_values(points, book, vertical, recompute_free=recompute))


class Solution:
    def __init__(self, sketch: Sketch, names: tuple[str, ...], values: InitialValues):
        self.sketch, self.names, self.values = sketch, names, values

    def method(self, name):
        step = self.values.point_steps[self.names.index(name)]
        return None if step is None else step.method

    def reason(self, name):
        found = [item.reason for item in self.values.unplaced if item.what == f"point {name}"]
        assert len(found) == 1, self.values.unplaced
        return found[0]

    def assert_true(self, *methods):
        """All points are where they are in truth, the unknown ones placed by one of the methods."""
        assert self.values.unplaced == ()
        for name, xyz in zip(self.names, self.values.coordinates, strict=True):
            np.testing.assert_allclose(xyz, self.sketch.truth[name], rtol=0, atol=1e-6, err_msg=name)
            if self.method(name) != "given" and methods:
                assert self.method(name) in methods, name


A, B, C = (0.0, 0.0, 10.0), (100.0, 0.0, 12.0), (40.0, 90.0, 15.0)
P, Q = (55.0, 35.0, 20.0), (30.0, -60.0, 3.0)
