"""Rational polynomial coefficients of a shot (RPC00B order): what stands in for its geometry elsewhere."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import FloatArray
    from obseq.images.aerial.shots import FrameCamera
    from obseq.images.aerial.surfaces import Surface
    from obseq.images.aerial.worksite import Worksite

POWERS = (
    (0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 0, 1), (0, 1, 1),
    (2, 0, 0), (0, 2, 0), (0, 0, 2), (1, 1, 1), (3, 0, 0), (1, 2, 0), (1, 0, 2),
    (2, 1, 0), (0, 3, 0), (0, 1, 2), (2, 0, 1), (0, 2, 1), (0, 0, 3),
)  # fmt: skip
"""Powers of longitude, latitude and height, in the order of RPC00B."""
TERMS = {1: 4, 2: 10, 3: 20}
"""How many monomials each degree has."""
KEYS = ("LINE", "SAMP", "LAT", "LONG", "HEIGHT")


@dataclass(frozen=True)
class Rpc:
    """Rational polynomials from longitude, latitude (degrees) and height (metres) to line and sample.

    Attributes:
        offsets: of LINE, SAMP, LAT, LONG, HEIGHT.
        scales: the same.
        coefficients: (4, 20) of line numerator and denominator, sample numerator and denominator.
    """

    offsets: dict[str, float]
    scales: dict[str, float]
    coefficients: FloatArray

    def project(self, ground: FloatArray) -> FloatArray:
        """Column and line (n, 2) of longitude, latitude (degrees), height (n, 3)."""
        terms = _terms(self._normalised(ground), len(POWERS))
        line, below_line, sample, below_sample = self.coefficients @ terms.T
        column = sample / below_sample * self.scales["SAMP"] + self.offsets["SAMP"]
        return np.stack([column, line / below_line * self.scales["LINE"] + self.offsets["LINE"]], axis=1)

    def text(self) -> str:
        """The text of an ``_RPC.TXT`` file."""
        lines = ["ERR_BIAS: -1", "ERR_RAND: -1"]
        lines += [f"{key}_OFF: {self.offsets[key]!r}" for key in KEYS]
        lines += [f"{key}_SCALE: {self.scales[key]!r}" for key in KEYS]
        names = ("LINE_NUM", "LINE_DEN", "SAMP_NUM", "SAMP_DEN")
        for name, row in zip(names, self.coefficients, strict=True):
            lines += [f"{name}_COEFF_{index + 1}: {float(value)!r}" for index, value in enumerate(row)]
        return "\n".join(lines) + "\n"

    def _normalised(self, ground: FloatArray) -> FloatArray:
        keys = ("LONG", "LAT", "HEIGHT")
        offsets, scales = ([part[key] for key in keys] for part in (self.offsets, self.scales))
        return (ground - offsets) / scales


def fit_rpc(
    worksite: Worksite,
    shot: int,
    camera: FrameCamera,
    surface: Surface,
    *,
    degree: int = 3,
    step: float = 100.0,
    layers: Sequence[float] = (-250.0, 0.0, 250.0),
) -> Rpc:
    """Coefficients fitted to one shot, on a grid over the ground it sees, in layers above and below it.

    Several layers make the polynomials hold in height too (with one, over flat ground, the denominators are
    nearly singular: B23 of Borea's faults).

    Args:
        worksite: shots and map.
        shot: row of the shot.
        camera: of the shot, with its size.
        surface: the ground, of a stated type.
        degree: 1, 2 or 3.
        step: of the grid, metres.
        layers: heights above the ground, metres; ``(0.0,)`` is Borea's way.

    Raises:
        InputError: another degree, a camera without size, a surface that does not lie under the image.
    """
    if degree not in TERMS:
        raise InputError(f"RPC degree {degree}: must be 1, 2 or 3.")
    grid = _grid(worksite, shot, camera, surface, step)
    points = np.concatenate([grid + np.array([0.0, 0.0, up]) for up in layers])
    pixels = worksite.world_to_image(np.full(len(points), shot), points, surface.height_type)
    system = worksite.map
    ground = np.column_stack([np.rad2deg(system.geodetic(points[:, :2])), points[:, 2]])
    return rpc_through(ground, pixels, degree)


def rpc_through(ground: FloatArray, pixels: FloatArray, degree: int = 3) -> Rpc:
    """Coefficients that take longitude, latitude (degrees), height (n, 3) to sample and line (n, 2)."""
    values = np.column_stack([pixels[:, ::-1], ground[:, [1, 0, 2]]])
    low, high = values.min(axis=0), values.max(axis=0)
    offsets, scales = 0.5 * (high + low), np.where(high > low, 0.5 * (high - low), 1.0)
    unit = (values - offsets) / scales
    terms = _terms(unit[:, [3, 2, 4]], TERMS[degree])
    coefficients = np.zeros((4, len(POWERS)))
    coefficients[[1, 3], 0] = 1.0
    for row, value in ((0, unit[:, 0]), (2, unit[:, 1])):
        found = np.linalg.lstsq(np.hstack([terms, -value[:, None] * terms[:, 1:]]), value, rcond=None)[0]
        coefficients[row, : terms.shape[1]] = found[: terms.shape[1]]
        coefficients[row + 1, 1 : terms.shape[1]] = found[terms.shape[1] :]
    return Rpc(
        dict(zip(KEYS, offsets.tolist(), strict=True)),
        dict(zip(KEYS, scales.tolist(), strict=True)),
        coefficients,
    )


def _grid(worksite: Worksite, shot: int, camera: FrameCamera, surface: Surface, step: float) -> FloatArray:
    """Ground points (n, 3) of a square grid over the rectangle around the image corners."""
    if camera.size is None:
        raise InputError(f"camera {camera.name}: has no image size; give width and height.")
    width, height = camera.size
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=np.float64)
    ground = worksite.image_to_world(np.full(4, shot), corners, surface)
    if not np.isfinite(ground).all():
        raise InputError(f"shot {worksite.shots.names[shot]}: an image corner does not see the ground.")
    low = np.floor(ground[:, :2].min(axis=0) - step - 1.0)
    high = np.floor(ground[:, :2].max(axis=0) + step + 1.0) + step
    x, y = np.meshgrid(np.arange(low[0], high[0], step), np.arange(low[1], high[1], step))
    plan = np.column_stack([x.ravel(), y.ravel()])
    points = np.column_stack([plan, surface.z(plan)])
    return np.asarray(points[np.isfinite(points[:, 2])])


def _terms(normalised: FloatArray, count: int) -> FloatArray:
    """Monomials (n, count) of normalised longitude, latitude, height (n, 3)."""
    x, y, z = normalised.T
    return np.stack([x**i * y**j * z**k for i, j, k in POWERS[:count]], axis=1)
