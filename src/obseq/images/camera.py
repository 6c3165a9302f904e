"""Cameras: from a direction in the camera frame to a pixel, and back.

    q = projection(P)            dimensionless; P in the camera frame: x right, y down, z forward
    q' = distortion(q)           dimensionless, about the principal point
    pixel = PP + F q'            x = column to the right, y = line downwards; F and PP in pixels

Any member of the catalogue can be the projection (`Stenope` is the pinhole) and the degree of the distortion
(`(radial, decentric, general)`). The parameters and their order are those of the colinearity equation, which
is MMVII's: `F`, `PPx`, `PPy`, then `K1`, ..., `p1`, `p2`, ..., `b1`, `b2`, ... A parameter is a coefficient
of the dimensionless coordinates: a coefficient per pixel^2 times F^2 is the K1 of here.

In a backward camera (DBAT, PhotoModeler, Australis) the distortion goes the other way, from q' to q: it
corrects what was measured (see `obseq.formulas.backward`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from obseq.arguments import NUMBER, require
from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.errors import FormulaError, InputError
from obseq.images.names import as_names
from obseq.kernels import calculator
from obseq.leastsquares.problem.arguments import real

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from obseq.arrays import BoolArray, FloatArray
    from obseq.images.model import CameraModel
    from obseq.kernels import Calculator
    from obseq.kernels.loading import Kernel


NEWTON_STEPS = 50
NEWTON_TOLERANCE = 1e-12
"""Dimensionless: a thousandth of a millionth of a pixel for usual focal lengths."""
HALVINGS = 10
"""Times a step that takes farther from the goal is halved."""
LEAST_FOCAL = 0.02
"""Share of the larger side of an image below which a focal length is in another unit."""
FOLDED = 0.01
"""Pixels by which a point may come back from distortion and its inverse, and still count as seen."""


@dataclass(frozen=True, eq=False)
class Camera:
    """The interior orientation of a camera; it does not change (`with_parameters` gives another).

    Attributes:
        name: Name of the calibration.
        width: Columns of the image, pixels; 0, with `height`, when the size is not known.
        height: Lines of the image, pixels.
        focal: Focal length F, pixels.
        principal_point: (2,) pixels; the middle of the image when not given.
        degree: Degrees of the distortion: radial, decentric, general polynomial.
        distortion: (n,) its coefficients in the order of `coefficient_names`; may be given as a mapping of
            some of them by name; zero when not given.
        projection: `Stenope`, `FE_EquiDist`, `FE_EquiSolid`, `StereroGraphik`, `OrthoGraphik` or
            `EquiRect` (MMVII's names).
        fraser: False for MMVII's other choice of the terms of degree 1 (`a`, `b`).
        backward: True when the distortion corrects the measured point, instead of moving the computed one.
        model: a model of one's own (docs/camera-model.md); None for those of the catalogue.

    Example:
        >>> camera = Camera("D5600", 6000, 4000, focal=6153.0, degree=(3, 1, 1), distortion={"K1": -0.1})
        >>> camera.project([[0.0, 0.0, 2.0]])
        array([[3000., 2000.]])
    """

    name: str
    width: int
    height: int
    focal: float
    principal_point: FloatArray = field(default_factory=lambda: np.full(2, np.nan))
    degree: tuple[int, int, int] = (3, 1, 1)
    distortion: ArrayLike | Mapping[str, float] = field(default_factory=dict)
    projection: str = "Stenope"
    fraser: bool = True
    backward: bool = False
    model: CameraModel | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", as_names([self.name], "camera")[0])
        for argument in ("width", "height", "focal"):
            require(f"camera {self.name}", argument, getattr(self, argument), NUMBER)
        point = real(self.principal_point, f"camera {self.name}: principal point").reshape(-1)
        if point.shape != (2,):
            raise InputError(f"camera {self.name}: the principal point is two numbers, not {point.size}")
        middle = np.array([self.width / 2.0, self.height / 2.0])
        object.__setattr__(self, "principal_point", np.where(np.isnan(point), middle, point))
        object.__setattr__(self, "degree", tuple(int(number) for number in self.degree))
        object.__setattr__(self, "distortion", self._coefficients(self.distortion))
        self._check()

    def _check(self) -> None:
        if not (min(self.width, self.height) > 0 or self.width == self.height == 0):
            raise InputError(f"camera {self.name}: an image of {self.width} by {self.height} has no pixels")
        if not (np.isfinite(self.focal) and self.focal > 0.0):
            raise InputError(f"camera {self.name}: the focal length must be above zero, not {self.focal}")

    def require_plausible(self) -> None:
        """Refuses a focal length that cannot be in pixels, for those who are about to adjust with it.

        Raises:
            InputError: it is less than a fiftieth of the image.
        """
        if self.focal < LEAST_FOCAL * max(self.width, self.height):
            raise InputError(
                f"camera {self.name}: a focal length of {self.focal:g} pixels for an image of "
                f"{self.width} by {self.height} pixels is too short; it is in pixels here: "
                "multiply millimetres by the pixels per millimetre of the sensor"
            )

    def _coefficients(self, given: ArrayLike | Mapping[str, float]) -> FloatArray:
        names = self.coefficient_names
        if isinstance(given, Mapping):
            unknown = sorted(set(given) - set(names))
            if unknown:
                raise InputError(
                    f"camera {self.name}: {', '.join(unknown)} not in the distortion {self._model}, whose "
                    f"coefficients are {', '.join(names) or 'none'}"
                )
            given = [given.get(name, 0.0) for name in names]
        values = real(given, f"camera {self.name}: distortion")
        if values.shape != (len(names),) or not np.isfinite(values).all():
            raise InputError(
                f"camera {self.name}: the distortion {self._model} takes {len(names)} finite coefficients "
                f"({', '.join(names) or 'none'}), not {values.tolist()}"
            )
        return values

    # Names and parameters

    @property
    def _model(self) -> str:
        if self.model is not None:
            return self.model.distortion.name
        radial, decentric, general = self.degree
        name = f"{'Backward' if self.backward else 'Dist'}_Rad{radial}_Dec{decentric}_XY{general}"
        return name if self.fraser else f"{name}_D1aXbX"

    @property
    def formula(self) -> str:
        """Name of its colinearity equation."""
        return (
            f"EqColinearityCamPPC_{self.projection}_{self._model}" if self.model is None else self.model.name
        )

    @property
    def equation(self) -> str | Kernel:
        """Its colinearity equation: the name of one of the catalogue, or one's own."""
        return self.formula if self.model is None else self.model.colinearity

    @property
    def is_mmvii(self) -> bool:
        """Whether projection, degree and coefficients say all, as they do in files of MMVII."""
        return self.model is None and not self.backward

    @property
    def coefficient_names(self) -> tuple[str, ...]:
        """Names of the distortion coefficients, in the order of the equation."""
        if self.model is not None:
            return self.model.coefficient_names
        try:
            return _coefficient_names(self._model)
        except FormulaError as error:
            raise InputError(f"camera {self.name}: degree {self.degree}: {error}") from None

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """`F`, `PPx`, `PPy`, and the names of the coefficients."""
        return ("F", "PPx", "PPy", *self.coefficient_names)

    @property
    def coefficients(self) -> FloatArray:
        """(n,) the distortion coefficients, as an array."""
        return np.asarray(self.distortion, dtype=np.float64)

    @property
    def parameters(self) -> FloatArray:
        """(3 + n,) their values."""
        return np.concatenate([[self.focal], self.principal_point, self.coefficients])

    def with_parameters(self, values: ArrayLike, name: str | None = None) -> Camera:
        """The same camera with other values of its parameters, and another name if one is given."""
        array = np.asarray(values, dtype=np.float64)
        return replace(
            self,
            name=name or self.name,
            focal=float(array[0]),
            principal_point=array[1:3],
            distortion=array[3:],
        )

    # Projection

    @cached_property
    def _distort(self) -> Calculator:
        return calculator(f"EqDist_{self._model}") if self.model is None else self.model.map

    @cached_property
    def _direct(self) -> Calculator:
        return calculator(f"Dir_{self.projection}")

    @cached_property
    def _inverse(self) -> Calculator:
        return calculator(f"Inv_{self.projection}")

    def project(self, points: ArrayLike) -> FloatArray:
        """Pixels (n, 2) of points of the camera frame (n, 3), of any distance; not finite where undefined.

        It is the formula alone: a point behind a pinhole gets the pixel where the line through the centre
        meets the image plane, though no camera sees it there (`sees`, `is_in_front`).
        """
        rays = np.asarray(points, dtype=np.float64)
        return self.principal_point + self.focal * self.distorted(self._plane(rays))

    def project_with_jacobian(self, points: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Pixels (n, 2) of points of the camera frame (n, 3), and their derivatives (n, 2, 3)."""
        rays = np.asarray(points, dtype=np.float64)
        plane, first = self._direct.values_and_jacobian(rays, np.zeros((len(rays), 0)))
        distorted, second = self._distorted_with_jacobian(plane)
        return self.principal_point + self.focal * distorted, self.focal * (second @ first)

    def directions(self, pixels: ArrayLike) -> FloatArray:
        """Unit directions (n, 3) in the camera frame of pixels (n, 2).

        NaN where the distortion cannot be inverted: far outside the image, usually.
        """
        plane = self.undistorted((np.asarray(pixels, dtype=np.float64) - self.principal_point) / self.focal)
        found = self._inverse.values(plane, np.zeros((len(plane), 0)))
        return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))

    def distorted(self, plane: ArrayLike) -> FloatArray:
        """Distorted coordinates (n, 2) of dimensionless ones (n, 2); NaN where there are none."""
        q = np.asarray(plane, dtype=np.float64)
        return self._inverted(q) if self.backward else self._mapped(q)

    def undistorted(self, distorted: ArrayLike) -> FloatArray:
        """Dimensionless coordinates (n, 2) that the distortion takes to those given; NaN where none does."""
        q = np.asarray(distorted, dtype=np.float64)
        return self._mapped(q) if self.backward else self._inverted(q)

    def _distorted_with_jacobian(self, plane: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Distorted coordinates (n, 2), and their derivatives (n, 2, 2)."""
        if not self.backward:
            return self._distort.values_and_jacobian(plane, self._rows(len(plane)))
        distorted = self._inverted(plane)
        _, jacobian = self._distort.values_and_jacobian(distorted, self._rows(len(plane)))
        return distorted, np.asarray(np.linalg.inv(jacobian))

    def _mapped(self, q: FloatArray) -> FloatArray:
        """What the polynomials of the distortion make of points (n, 2)."""
        return self._distort.values(q, self._rows(len(q)))

    def _inverted(self, goal: FloatArray) -> FloatArray:
        """Points (n, 2) that the polynomials of the distortion take to those given; NaN where none.

        Newton's iterations with the exact derivative, a step being halved until it improves.
        """
        q = goal.copy()
        if not self.coefficients.any():
            return q
        rows = self._rows(len(q))
        values, jacobian = self._distort.values_and_jacobian(q, rows)
        off = goal - values
        for _ in range(NEWTON_STEPS):
            step = _solve_each(jacobian, off)
            q, off, jacobian = self._moved(q, step, goal, off, rows)
            if np.fmax.reduce(np.abs(step), axis=None, initial=0.0) <= NEWTON_TOLERANCE:
                break
        (a, b), (c, d) = jacobian[:, 0].T, jacobian[:, 1].T
        is_there = np.maximum(*np.abs(off).T) <= 1e3 * NEWTON_TOLERANCE
        return np.where((is_there & (a * d > b * c) & (a + d > 0.0))[:, None], q, np.nan)  # not folded

    def _moved(
        self, q: FloatArray, step: FloatArray, goal: FloatArray, off: FloatArray, rows: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The places after a step, halved where it takes farther off; what is left there, derivatives."""
        before, share = _squares(off), np.ones((len(q), 1))
        for _ in range(HALVINGS + 1):
            there = q + share * step
            values, jacobian = self._distort.values_and_jacobian(there, rows)
            left = goal - values
            worse = _squares(left) > before
            if not worse.any():
                break
            share[worse] *= 0.5
        return there, left, jacobian

    def _plane(self, points: FloatArray) -> FloatArray:
        return self._direct.values(points, np.zeros((len(points), 0)))

    def _rows(self, n: int) -> FloatArray:
        return np.repeat(self.coefficients[None], n, axis=0)  # as kernels read them at once

    # Visibility

    def contains(self, pixels: ArrayLike, margin: float = 0.0) -> BoolArray:
        """(n,) whether pixels (n, 2) are in the image, or within a margin around it."""
        array = np.asarray(pixels, dtype=np.float64)
        if not self.width:
            return np.asarray(np.isfinite(array).all(axis=1))
        size = np.array([self.width, self.height])
        return np.asarray(((array >= -margin) & (array <= size + margin)).all(axis=1))

    def sees(self, points: ArrayLike, margin: float = 0.0) -> BoolArray:
        """(n,) whether points of the camera frame (n, 3) have an image in the frame.

        A point must be where the projection is defined (in front, for a pinhole), project in the image
        or within the margin, and not be folded by the distortion: the inverse must lead back to it.
        """
        array = np.asarray(points, dtype=np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            plane = self._plane(array)
            distorted = self.distorted(plane)
            inside = self.contains(self.principal_point + self.focal * distorted, margin)
            seen = self.is_in_front(array) & inside
        seen[seen] = self.focal * np.abs(self.undistorted(distorted[seen]) - plane[seen]).max(axis=1) < FOLDED
        return seen

    def is_in_front(self, points: ArrayLike) -> BoolArray:
        """(n,) whether the projection is defined at points of the camera frame (n, 3)."""
        x, y, z = np.asarray(points, dtype=np.float64).T
        if self.projection in ("Stenope", "OrthoGraphik"):
            return np.asarray(z > 0.0)
        if self.projection == "EquiRect":
            return np.asarray(np.hypot(x, z) > 0.0)
        return np.asarray((np.hypot(x, y) > 0.0) | (z > 0.0))


@cache
def _coefficient_names(model: str) -> tuple[str, ...]:
    """Names of the coefficients of a distortion, in the order of the equation."""
    return calculator(f"EqDist_{model}").observations


def _solve_each(matrices: FloatArray, right: FloatArray) -> FloatArray:
    """Solutions (n, 2) of systems (n, 2, 2) x = (n, 2), not finite where singular."""
    (a, b), (c, d) = matrices[:, 0].T, matrices[:, 1].T
    found, (x, y) = np.empty_like(right), right.T
    with np.errstate(divide="ignore", invalid="ignore"):
        found[:, 0], found[:, 1] = d * x - b * y, a * y - c * x
        found /= (a * d - b * c)[:, None]
    return found


def _squares(pairs: FloatArray) -> FloatArray:
    """(n,) squared lengths of (n, 2)."""
    return np.asarray(np.square(pairs[:, 0]) + np.square(pairs[:, 1]))


def median_camera(cameras: Sequence[Camera], name: str) -> Camera:
    """The camera whose parameters are the medians of those of several, which have one model and size.

    Of an even number of values the median is the mean of the two in the middle (MMVII's shared
    calibration after a resection without calibration).
    """
    if not cameras:
        raise InputError(f"camera {name}: the median of no cameras")
    first = cameras[0]
    for other in cameras[1:]:
        if (other.formula, other.width, other.height) != (first.formula, first.width, first.height):
            raise InputError(f"camera {name}: {other.name} is not of the model and size of {first.name}")
    values = np.median([camera.parameters for camera in cameras], axis=0)
    return first.with_parameters(values, name)
