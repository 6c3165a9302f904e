"""Space resection: where one image was taken from, of points known on the ground and in the image."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from obseq.errors import InputError, SingularSystemError
from obseq.geometry import exponential, skew
from obseq.images.aerial.frames import LocalFrames
from obseq.images.aerial.shots import angles_from_matrices

if TYPE_CHECKING:
    from obseq.arrays import FloatArray
    from obseq.images.aerial.mapping import MapSystem
    from obseq.images.aerial.shots import FrameCamera


LEAST_POINTS = 4
"""Three points leave up to four solutions: they serve only with an approximate pose to choose among them."""
STEPS = 100
"""Steps at most."""
ARRIVED = 1e-12
"""A step has arrived when it moves the centre by less than this share of the distance to the ground."""
WEAK = 300.0
"""A pose is ill-determined when an error of one part of the focal may move it by more than so many parts."""

_PERCENT = (
    (6.25, 80, 200), (12.5, 20, 320), (18.75, 60, 250), (25, 90, 240), (31.25, 30, 330),
    (37.5, 10, 335), (37.5, 50, 340), (43.75, 70, 330), (50, 20, 350), (56.25, 40, 360),
    (62.5, 60, 360), (62.5, 90, 350), (68.75, 20, 370), (68.75, 80, 355), (75, 50, 380),
    (81.25, 20, 400), (87.5, 10, 450), (87.5, 70, 400), (93.75, 40, 500), (93.75, 90, 300),
)  # fmt: skip


class Resection(NamedTuple):
    """The pose of one image.

    Attributes:
        position: (3,) map coordinates of the projection centre; z in the type of the points, without
            alteration.
        matrix: (3, 3) rotation from the map at the centre to image axes.
        residuals: (n, 2) observed minus computed pixels.
        sigma0: standard deviation of a column or line, pixels; nan without redundancy.
        covariance: (6, 6) of centre (metres, map axes) and small rotation (radians, map axes), for sigma0,
            or for one pixel where there is no redundancy.
        amplification: how many parts of its distance to the ground the pose moves for an error of one part
            of the
            focal: 1 to 50 for good geometry, without bound on the danger cylinder.
    """

    position: FloatArray
    matrix: FloatArray
    residuals: FloatArray
    sigma0: float
    covariance: FloatArray
    amplification: float

    @property
    def is_ill_determined(self) -> bool:
        """Whether the points leave the pose open: close together, or on a danger cylinder with the centre."""
        return self.amplification > WEAK

    def angles(self, order: str = "opk") -> FloatArray:
        """Omega, phi, kappa (3,), radians, in an order of axes."""
        return np.asarray(angles_from_matrices(self.matrix[None], order)[0])


def resect(
    system: MapSystem,
    camera: FrameCamera,
    pixels: FloatArray,
    points: FloatArray,
    *,
    start: tuple[FloatArray, FloatArray] | None = None,
    position: FloatArray | None = None,
) -> Resection:
    """The pose with the least squared residuals in pixels, from a view downwards or from a given pose.

    Args:
        system: the map.
        camera: of the image.
        pixels: (n, 2) column and line of at least four points; three with a whole pose as start.
        points: (n, 3) map coordinates with ellipsoidal heights.
        start: approximate position (3,) and rotation (3, 3) from the map.
        position: approximate position (3,) alone; the image then looks down, turned as the points say.

    Raises:
        InputError: too few points, or values that are not finite.
        SingularSystemError: the points cannot give a pose: on a line, or all in one place.
    """
    _check(pixels, points, LEAST_POINTS if start is None else LEAST_POINTS - 1)
    frame = LocalFrames(system, points[:, :2].mean(axis=0)[None])
    ground = frame.to_euclidean(points)
    rays = np.column_stack([pixels - camera.principal_point, np.full(len(pixels), camera.focal)])
    if start is None:
        centre, turn = _looking_down(
            rays, ground, None if position is None else frame.to_euclidean(position[None])[0]
        )
    else:
        centre = frame.to_euclidean(start[0][None])[0]
        turn = frame.to_frame(start[1][None], start[0][None, :2])[0]
    centre, turn = _adjusted(rays, ground, centre, turn)
    return _as_result(frame, rays, ground, centre, turn)


def seed_points(camera: FrameCamera) -> tuple[FloatArray, FloatArray]:
    """Twenty pixels (20, 2) spread over the image, and ground heights (20,): IGN's, for known shots.

    Raises:
        InputError: if the camera has no image size.
    """
    if camera.size is None:
        raise InputError(f"camera {camera.name}: has no image size; give width and height.")
    percent = np.array(_PERCENT)
    return percent[:, :2] / 100.0 * camera.size, percent[:, 2]


def _check(pixels: FloatArray, points: FloatArray, least: int) -> None:
    if len(pixels) != len(points) or len(points) < least:
        raise InputError(
            f"resection: needs at least {least} points known in the image and on the ground; "
            f"it has {len(pixels)} and {len(points)}."
        )
    if not (np.isfinite(pixels).all() and np.isfinite(points).all()):
        raise InputError("resection: a pixel or a ground coordinate is not finite.")


def _looking_down(
    rays: FloatArray, ground: FloatArray, position: FloatArray | None
) -> tuple[FloatArray, FloatArray]:
    """A vertical view: turn, scale and place of the similarity between image (y up) and ground plan."""
    image = rays[:, 0] - 1j * rays[:, 1]
    plan = ground[:, 0] + 1j * ground[:, 1]
    across, beside = image - image.mean(), plan - plan.mean()
    spread = float((np.abs(across) ** 2).sum())
    if spread == 0.0 or float((np.abs(beside) ** 2).sum()) == 0.0:
        raise SingularSystemError("resection: all points are in one place; spread them over the image.")
    factor = complex((np.conj(across) * beside).sum()) / spread
    above = plan.mean() - factor * image.mean()
    kappa = float(np.angle(factor))
    centre = np.array([above.real, above.imag, ground[:, 2].mean() + abs(factor) * rays[0, 2]])
    turn = np.array(
        [
            [np.cos(kappa), np.sin(kappa), 0.0],
            [np.sin(kappa), -np.cos(kappa), 0.0],
            [0.0, 0.0, -1.0],
        ]
    )
    return (centre if position is None else position), turn


def _adjusted(
    rays: FloatArray, ground: FloatArray, centre: FloatArray, turn: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Levenberg-Marquardt on centre and rotation."""
    distance = float(np.median(np.sqrt(((ground - centre) ** 2).sum(axis=1))))
    damping, cost = 1e-3, _cost(_residuals(rays, ground, centre, turn))
    for _ in range(STEPS):
        left = _residuals(rays, ground, centre, turn)
        jacobian = _jacobian(rays, ground, centre, turn)
        normal, right = jacobian.T @ jacobian, jacobian.T @ left.ravel()
        step = np.linalg.lstsq(normal + damping * np.diag(normal.diagonal()), right, rcond=None)[0]
        moved, rotated = centre + step[:3], turn @ exponential(step[3:])
        trial = _cost(_residuals(rays, ground, moved, rotated))
        small = np.abs(step[:3]).max() <= ARRIVED * distance and np.abs(step[3:]).max() <= ARRIVED
        if trial <= cost:
            centre, turn, cost, damping = moved, rotated, trial, damping / 10.0
        else:
            damping = max(damping * 10.0, 1e-12)
        if small or damping > 1e12:
            break
    return centre, turn


def _cost(residuals: FloatArray) -> float:
    """Sum of squares; infinite where a point is behind the camera."""
    return float((residuals**2).sum()) if np.isfinite(residuals).all() else np.inf


def _residuals(rays: FloatArray, ground: FloatArray, centre: FloatArray, turn: FloatArray) -> FloatArray:
    """Observed minus computed pixels (n, 2); nan behind the camera."""
    sight = (ground - centre) @ turn.T
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.where(sight[:, 2] > 0.0, sight[:, 2], np.nan)
        return np.asarray(rays[:, :2] - rays[:, 2:] * sight[:, :2] / depth[:, None])


def _jacobian(rays: FloatArray, ground: FloatArray, centre: FloatArray, turn: FloatArray) -> FloatArray:
    """Derivatives (2 n, 6) of the pixels by centre and small rotation: turn <- turn exp([w])."""
    away = ground - centre
    sight = away @ turn.T
    slope = sight[:, :2] / sight[:, 2:]
    by_point = (rays[:, 2] / sight[:, 2])[:, None, None] * (turn[:2] - slope[:, :, None] * turn[2])
    by_rotation = -by_point @ skew(away)
    return np.concatenate([-by_point, by_rotation], axis=2).reshape(-1, 6)


def _as_result(
    frame: LocalFrames, rays: FloatArray, ground: FloatArray, centre: FloatArray, turn: FloatArray
) -> Resection:
    residuals = _residuals(rays, ground, centre, turn)
    if not np.isfinite(residuals).all():
        raise SingularSystemError(
            "resection: no pose sees all points in front of the camera; check the measures."
        )
    jacobian = _jacobian(rays, ground, centre, turn)
    distance = float(np.median(np.sqrt(((ground - centre) ** 2).sum(axis=1))))
    scaled = jacobian * np.array([distance] * 3 + [1.0] * 3) / rays[0, 2]
    weakest = float(np.linalg.svd(scaled, compute_uv=False)[-1])
    amplification = np.inf if weakest < 1e-14 else 1.0 / weakest
    redundancy = residuals.size - 6
    sigma0 = float(np.sqrt((residuals**2).sum() / redundancy)) if redundancy else np.nan
    place = frame.to_map(centre[None])
    return Resection(
        place[0],
        frame.from_frame(turn[None], place[:, :2])[0],
        residuals,
        sigma0,
        _covariance(frame, jacobian, place, sigma0 if redundancy else 1.0),
        amplification,
    )


def _covariance(frame: LocalFrames, jacobian: FloatArray, place: FloatArray, sigma: float) -> FloatArray:
    """Along the axes of the map at the centre."""
    inverse = sigma**2 * np.linalg.pinv(jacobian.T @ jacobian)
    turn = frame.system.axes(place[:, :2])[0] @ frame.axes[0].T
    both = np.kron(np.eye(2), turn)
    return np.asarray(both @ inverse @ both.T)
