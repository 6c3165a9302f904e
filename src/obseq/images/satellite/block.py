"""A block of satellite images: rational polynomials, a correction of each image, tie and control points.

The rational polynomials take a point to a pixel; the correction, a polynomial of the pixel, takes this to
where the point was measured (the bias compensation of Fraser and Hanley). The equation is
`Dist_Polyn2D_Degree_n_EqColin` of the catalogue, which knows a sensor by its tangent map: that is made anew
at each iteration. Points are in a local frame (metres), pixels from the offsets of their image.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from obseq import crs
from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.images.adjustment.equations import CONTROL, roots_of
from obseq.images.aerial.rpc import Rpc
from obseq.images.control import ControlPoints
from obseq.images.measures import ImagePoints
from obseq.images.names import are_among, index_of
from obseq.kernels import calculator
from obseq.leastsquares import Batch, LeastSquares, LeastSquaresResult

CORRECTIONS = {"bias": 0, "affine": 1}
"""Kinds of correction, and the degree of their polynomial."""
STEP = 1.0
"""Metres of the differences that give the tangent map: its curvature over them is below 1e-9 of a pixel."""
LEAST_RAYS = 2
STEPS, ARRIVED = 20, 1e-6
"""Of an intersection: iterations, and metres by which its last step may move a point."""
GEOGRAPHIC = "+proj=latlong +datum=WGS84"
PRIOR = "corrections"


@dataclass(eq=False)
class SatelliteBlock:
    """Images with rational polynomials, and what was measured in them.

    Attributes:
        rpcs: of the images, by name.
        measures: samples and lines, from the centre of the first pixel.
        control: known points, in the frame.
        check_points: points that check the result, in the frame.
        frame: definition of the local frame.
        correction: `bias` or `affine`.
        bias_sigma: pixels by which the polynomials of an image may be off.
        drift_sigma: of affine terms: pixels over half of the image.
    """

    rpcs: Mapping[str, Rpc]
    measures: ImagePoints
    control: ControlPoints
    check_points: ControlPoints
    frame: str
    correction: str = "bias"
    bias_sigma: float = 10.0
    drift_sigma: float = 1.0

    def __post_init__(self) -> None:
        if self.correction not in CORRECTIONS:
            raise InputError(f"correction {self.correction!r}: {' or '.join(CORRECTIONS)} is wanted")
        index_of(list(self.rpcs), self.measures.image_names, "image points: image")

    @property
    def degree(self) -> int:
        """Degree of the correction."""
        return CORRECTIONS[self.correction]

    @cached_property
    def _to_geographic(self) -> crs.Transformer:
        return crs.Transformer(crs.parse(self.frame), crs.parse(GEOGRAPHIC))

    def project(self, image: IntArray, points: FloatArray) -> FloatArray:
        """Pixels (n, 2) of points (n, 3) of the frame, from the offsets of their images, uncorrected."""
        ground = np.asarray(self._to_geographic.forward(points))
        pixels = np.empty((len(points), 2))
        for k, name in enumerate(self.measures.image_names):
            rows = image == k
            pixels[rows] = self.rpcs[name].project(ground[rows]) - self._middle(name)
        return pixels

    def _middle(self, image: str) -> FloatArray:
        offsets = self.rpcs[image].offsets
        return np.array([offsets["SAMP"], offsets["LINE"]])

    def _half(self, image: str) -> float:
        scales = self.rpcs[image].scales
        return max(abs(scales["SAMP"]), abs(scales["LINE"]))

    def tangents(self, image: IntArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Pixels (n, 2) of points, and their derivatives (n, 2, 3) by the frame."""
        steps = STEP * np.vstack([np.eye(3), -np.eye(3)])
        around = (points[None] + steps[:, None]).reshape(-1, 3)
        found = self.project(np.tile(image, 6), around).reshape(6, -1, 2)
        slopes = (found[:3] - found[3:]) / (2.0 * STEP)
        return self.project(image, points), np.moveaxis(slopes, 0, 2)

    def observed(self) -> FloatArray:
        """(n, 2) what was measured, from the offsets of the images."""
        middles = np.array([self._middle(name) for name in self.measures.image_names]).reshape(-1, 2)
        return np.asarray(self.measures.xy - middles[self.measures.image])

    def intersect(self) -> tuple[FloatArray, BoolArray]:
        """(k, 3) where the rays of each point meet, uncorrected, and (k,) whether two rays do."""
        given, image, point = self.observed(), self.measures.image, self.measures.point
        count = len(self.measures.point_names)
        sums = np.zeros((count, 3))
        np.add.at(sums, point, np.array([self._home(name) for name in self.measures.image_names])[image])
        rays = np.bincount(point, minlength=count)
        places = sums / np.maximum(rays, 1)[:, None]
        weights = 1.0 / self.measures.sigmas**2
        for _ in range(STEPS):
            pixels, slopes = self.tangents(image, places[point])
            normal, right = np.zeros((count, 3, 3)), np.zeros((count, 3))
            np.add.at(normal, point, np.einsum("nia,ni,nib->nab", slopes, weights, slopes))
            np.add.at(right, point, np.einsum("nia,ni,ni->na", slopes, weights, given - pixels))
            solvable = np.linalg.cond(normal) < 1e12
            step = np.zeros((count, 3))
            step[solvable] = np.linalg.solve(normal[solvable], right[solvable][..., None])[..., 0]
            places += step
            if np.abs(step).max(initial=0.0) <= ARRIVED:
                break
        return places, np.asarray(solvable & (rays >= LEAST_RAYS) & np.isfinite(places).all(axis=1))

    def _home(self, image: str) -> FloatArray:
        """The middle of the ground of an image, in the frame."""
        offsets = self.rpcs[image].offsets
        middle = [offsets["LONG"], offsets["LAT"], offsets["HEIGHT"]]
        return np.asarray(self._to_geographic.inverse([middle])[0])

    def solve(self, max_iterations: int = 30, threads: int = 1) -> SatelliteSolution:
        """Adjusts the block.

        Raises:
            InputError: no point has two rays.
            SingularSystemError: measures do not determine some unknowns, which are named.
        """
        return SatelliteSolution.of(self, max_iterations, threads)


@dataclass(frozen=True, eq=False)
class SatelliteSolution:
    """An adjusted block of satellite images.

    Attributes:
        block: what was adjusted.
        points: names of the points.
        left_out: names of points with less than two rays, which are no control points.
        result: of the least-squares system.
        ids: blocks of unknowns: of the points, of the corrections.
        rows: measures that take part.
        batch: their equations.
    """

    block: SatelliteBlock
    points: tuple[str, ...]
    left_out: tuple[str, ...]
    result: LeastSquaresResult
    ids: tuple[IntArray, IntArray]
    rows: IntArray
    batch: Batch

    @classmethod
    def of(cls, block: SatelliteBlock, max_iterations: int, threads: int) -> SatelliteSolution:
        """The solution of a block; see `SatelliteBlock.solve`."""
        measures, control = block.measures, block.control
        places, is_placed = block.intersect()
        known = are_among(measures.point_names, control.names)
        wanted = np.flatnonzero(known)
        rows_of = index_of(control.names, [measures.point_names[k] for k in wanted], "control point")
        places[wanted] = control.coordinates[rows_of]
        used = is_placed | known
        if not used.any():
            raise InputError("no point is measured in two images, or known")
        names = tuple(name for name, keep in zip(measures.point_names, used.tolist(), strict=True) if keep)
        lost = tuple(name for name, keep in zip(measures.point_names, used.tolist(), strict=True) if not keep)
        system = LeastSquares(threads=threads)
        points = system.add_points(names, places[used])
        corrections = _add_corrections(system, block)
        number = np.cumsum(used) - 1
        rows = np.flatnonzero(used[measures.point])
        image, point = measures.image[rows], number[measures.point[rows]]
        given = block.observed()[rows]

        def observations(coordinates: FloatArray) -> FloatArray:
            at = coordinates[point]
            pixels, slopes = block.tangents(image, at)
            return np.column_stack([given, at, pixels, slopes[:, 0], slopes[:, 1]])

        batch = system.add(
            f"Dist_Polyn2D_Degree_{block.degree}_EqColin",
            {"ground": points[point], "parameters": corrections[image]},
            observations(places[used]),
            measures.sigmas[rows],
            lambda row: measures.label(int(rows[row])),
            "image points",
        )
        _add_control(system, points, names, control)

        def follow(now: LeastSquares, iteration: int) -> None:
            batch.observations = observations(now.values(points))

        result = system.solve(
            strategy="gauss-newton", max_iterations=max_iterations, before_iteration=follow, covariance=True
        )
        return cls(block, names, lost, result, (points, corrections), rows, batch)

    @property
    def coordinates(self) -> FloatArray:
        """(n, 3) of the points, in the frame."""
        return self.result.values(self.ids[0])

    @property
    def covariances(self) -> FloatArray:
        """(n, 3, 3) of the points."""
        return self.result.covariance(self.ids[0], self.result.variance_factor is None)

    def corrections(self) -> dict[str, tuple[FloatArray, FloatArray]]:
        """Coefficients of the correction of each image, and their precisions; pixels from its offsets."""
        values = self.result.values(self.ids[1])
        covariance = self.result.covariance(self.ids[1], self.result.variance_factor is None)
        sigmas = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        return {name: (values[k], sigmas[k]) for k, name in enumerate(self.block.measures.image_names)}

    def residuals(self) -> FloatArray:
        """(m, 2) computed minus measured, pixels."""
        return self.result.residuals(self.batch)

    def check(self) -> tuple[tuple[str, ...], FloatArray, FloatArray]:
        """Check points that were adjusted, (n, 3) adjusted minus given, and (n, 3, 3) its covariances."""
        given = self.block.check_points
        place = {name: k for k, name in enumerate(self.points)}
        found = given.select([name for name in given.names if name in place])
        rows = [place[name] for name in found.names]
        return (
            found.names,
            self.coordinates[rows] - found.coordinates,
            self.covariances[rows] + found.covariances,
        )


def _add_corrections(system: LeastSquares, block: SatelliteBlock) -> IntArray:
    """The corrections, observed to be nothing: that is what polynomials of an image are worth."""
    names = block.measures.image_names
    kernel = calculator(f"Dist_Polyn2D_Degree_{block.degree}_EqDist")
    terms = kernel.observations
    ids = system.add_vectors(
        [f"{name} correction" for name in names], np.zeros((len(names), len(terms))), terms
    )
    sigmas = np.array(
        [
            [
                block.bias_sigma if term[2:] == "0_0" else block.drift_sigma / block._half(name)
                for term in terms
            ]
            for name in names
        ]
    )
    system.add_prior(ids, np.zeros_like(sigmas), sigmas, PRIOR)
    return ids


def _add_control(
    system: LeastSquares, points: IntArray, names: tuple[str, ...], control: ControlPoints
) -> None:
    """Holds or observes the coordinates of control points."""
    place = {name: k for k, name in enumerate(names)}
    rows = [(k, place[name]) for k, name in enumerate(control.names) if name in place]
    if not rows:
        return
    own, at = np.array(rows).T
    held, free = control.is_held[own], control.is_free[own]
    for axis in range(3):
        if held[:, axis].any():
            system.freeze(points[at[held[:, axis]]], (axis,))
    given = ~held & ~free
    if given.any():
        pairs = np.argwhere(given)
        roots = roots_of(control.covariances[own], given)
        coefficients = roots[pairs[:, 0], pairs[:, 1]]
        values = np.sum(coefficients * control.coordinates[own][pairs[:, 0]], axis=1)
        labels = [f"{control.names[own[k]]} {'xyz'[axis]}" for k, axis in pairs]
        system.add_linear([points[at[pairs[:, 0]]]], [coefficients], values, 1.0, labels, CONTROL)
