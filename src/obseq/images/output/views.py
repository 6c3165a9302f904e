"""Plan and side view of an adjusted block: cameras, rays, points with the ellipses of their precision."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.images.output.drawings import round_below, svg

if TYPE_CHECKING:
    from obseq.arrays import FloatArray
    from obseq.images.output.arrays import BlockArrays

WIDTH, TALLEST, MARGIN = 900.0, 520.0, 30.0
MOST_RAYS, MOST_POINTS = 1500, 4000
LARGEST = 30.0
"""Length of the largest axis of an ellipse."""
STEPS = 24


@dataclass(frozen=True, eq=False)
class View:
    """Two axes of the world as a drawing.

    Attributes:
        axes: (2, 3) across and up.
        corner: (2,) smallest value across, largest up.
        scale: drawing units per unit of the world.
        height: of the drawing.
    """

    axes: FloatArray
    corner: FloatArray
    scale: float
    height: float

    def places(self, points: FloatArray) -> FloatArray:
        """(n, 2) where points (n, 3) are drawn."""
        flat = points @ self.axes.T
        across, up = flat[:, 0] - self.corner[0], self.corner[1] - flat[:, 1]
        return np.column_stack([MARGIN + across * self.scale, MARGIN + up * self.scale])


def plan_and_side(block: BlockArrays) -> dict[str, str]:
    """The drawings by title: from above, and from the side along which the block is longest."""
    everything = np.concatenate([block.coordinates, block.centres])
    flat = everything[:, :2] - everything[:, :2].mean(axis=0)
    along = np.linalg.svd(flat, full_matrices=False)[2][0] if len(flat) > 1 else np.array([1.0, 0.0])
    along = along if along[np.argmax(np.abs(along))] > 0.0 else -along
    plan = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    side = np.array([[along[0], along[1], 0.0], [0.0, 0.0, 1.0]])
    return {
        "Plan": _drawn(block, plan, everything),
        "Side view": _drawn(block, side, everything),
    }


def _drawn(block: BlockArrays, axes: FloatArray, everything: FloatArray) -> str:
    view = _view(axes, everything)
    ellipses, factor = ("", None) if block.covariances is None else _ellipses(block, block.covariances, view)
    body = [
        f'<path class="ray" d="{_rays(block, view)}"/>',
        ellipses,
        _points(block, view),
        f'<path class="camera" d="{_cameras(block, view)}"/>',
        _legend(view, factor),
    ]
    return svg("".join(body), "view of the block", WIDTH, view.height)


def _view(axes: FloatArray, everything: FloatArray) -> View:
    flat = everything @ axes.T
    low, high = flat.min(axis=0), flat.max(axis=0)
    span = np.maximum(high - low, 1e-9)
    scale = float(min((WIDTH - 2 * MARGIN) / span[0], TALLEST / span[1]))
    left = (low[0] + high[0] - (WIDTH - 2 * MARGIN) / scale) / 2.0
    return View(axes, np.array([left, high[1]]), scale, float(span[1] * scale + 3 * MARGIN))


def _rays(block: BlockArrays, view: View) -> str:
    n = len(block.image)
    rows = np.unique(np.linspace(0, n - 1, min(n, MOST_RAYS)).astype(np.int64))
    starts = view.places(block.centres)[block.image[rows]]
    ends = view.places(block.coordinates)[block.point[rows]]
    pairs = zip(starts.tolist(), ends.tolist(), strict=True)
    return "".join(f"M{a:.1f} {b:.1f}L{c:.1f} {d:.1f}" for (a, b), (c, d) in pairs)


def _points(block: BlockArrays, view: View) -> str:
    places = view.places(block.coordinates)[:MOST_POINTS].tolist()
    control = block.is_control
    return "".join(
        f'<circle class="{"control" if control[k] else "tie"}" cx="{x:.1f}" cy="{y:.1f}" r="2"/>'
        for k, (x, y) in enumerate(places)
    )


def _cameras(block: BlockArrays, view: View) -> str:
    """A triangle for each camera, that opens the way it looks."""
    reach = 14.0 / view.scale
    corners = np.array([[-0.4, 0.0, 1.0], [0.4, 0.0, 1.0]]) * reach
    tips = view.places(block.centres).tolist()
    ends = [view.places(corners @ r.T + c) for r, c in zip(block.rotations, block.centres, strict=True)]
    triangles = zip(tips, ends, strict=True)
    return "".join(
        f"M{x:.1f} {y:.1f}L{a[0]:.1f} {a[1]:.1f}L{b[0]:.1f} {b[1]:.1f}z" for (x, y), (a, b) in triangles
    )


def _ellipses(block: BlockArrays, covariances: FloatArray, view: View) -> tuple[str, float]:
    """Standard ellipses of points in the plane of the view, and by how much they are enlarged."""
    rows = np.arange(min(len(block.coordinates), MOST_POINTS))
    flat = view.axes @ covariances[rows] @ view.axes.T
    values, vectors = np.linalg.eigh(flat)
    radii = np.sqrt(np.maximum(values, 0.0))
    largest = float(np.quantile(radii[:, 1], 0.98)) if len(rows) else 0.0
    factor = round_below(LARGEST / (largest * view.scale)) if largest > 0.0 else 1.0
    centres = view.places(block.coordinates[rows])
    turns = np.linspace(0.0, 2.0 * np.pi, STEPS, endpoint=False)
    circle = np.column_stack([np.cos(turns), np.sin(turns)])
    lines = []
    for centre, radius, axes in zip(centres, radii, vectors, strict=True):
        rim = (circle * np.minimum(radius * factor * view.scale, 4 * LARGEST)) @ axes.T * [1.0, -1.0] + centre
        lines.append("M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in rim.tolist()) + "z")
    return f'<path class="ellipse" d="{"".join(lines)}"/>', factor


def _legend(view: View, factor: float | None) -> str:
    length = round_below(WIDTH / 5.0 / view.scale)
    y = view.height - 14.0
    words = f"{length:g}" if factor is None else f"{length:g}; standard ellipses enlarged {factor:g} times"
    end = MARGIN + length * view.scale
    return (
        f'<path class="bar" d="M{MARGIN:.0f} {y:.1f}h{length * view.scale:.1f}"/>'
        f'<text x="{end + 8:.1f}" y="{y + 4:.1f}">{words}</text>'
    )
