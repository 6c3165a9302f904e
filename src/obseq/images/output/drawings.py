"""Drawings of an adjusted block as SVG: residuals on a frame, by radius, as a histogram; distorted grids."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from obseq.arrays import BoolArray, FloatArray

Size = tuple[int, int]
"""Width and height of an image in pixels; zeros where they are not known."""
WIDTH, HEIGHT = 460.0, 300.0
"""Of a drawing, in CSS pixels; frames of images keep their shape within."""
MARGIN = 34.0
LEFT = 58.0
"""Room for the numbers beside an axis that goes up."""
MOST = 4000
"""Arrows of a drawing; of more, evenly spread ones."""
LONGEST = 0.06
"""Share of the frame that a typical large residual takes."""
BINS = 16
LIMIT = 4.0
"""Sigmas that the histogram reaches."""
GRID = 17
RING = 7.0
"""Radius of the circle about a suspected measure, in CSS pixels."""


def svg(body: str, label: str, width: float = WIDTH, height: float = HEIGHT, margin: float = 0.0) -> str:
    """An SVG element with a name for those who cannot see it; a margin is on all sides, beside the size."""
    wide, high = width + 2.0 * margin, height + 2.0 * margin
    return (
        f'<svg width="{wide:.0f}" height="{high:.0f}" '
        f'viewBox="{-margin:.0f} {-margin:.0f} {wide:.0f} {high:.0f}" role="img" '
        f'aria-label="{label}">{body}</svg>'
    )


def round_below(value: float) -> float:
    """1, 2 or 5 times a power of ten, not above a positive value."""
    power = 10.0 ** math.floor(math.log10(value))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= value * (1.0 + 1e-12))


def frame_of(size: Size, xy: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Corner and size of the image in pixels; of the measures where the camera has no size."""
    if size[0]:
        return np.zeros(2), np.array(size, dtype=np.float64)
    reach = np.abs(xy).max(axis=0, initial=1.0)
    return -reach, 2.0 * reach


def arrows(
    frame: Size,
    xy: FloatArray,
    residuals: FloatArray,
    label: str,
    width: float = WIDTH,
    suspected: BoolArray | None = None,
) -> str:
    """Residuals (n, 2) at their measures (n, 2), enlarged, on the frame of the image; with a bar of scale.

    Those that are suspected (n,) stand in circles.
    """
    corner, size = frame_of(frame, xy)
    scale = width / size[0]
    height = float(size[1] * scale)
    typical = float(np.quantile(np.linalg.norm(residuals, axis=1), 0.9)) if len(residuals) else 0.0
    factor = round_below(LONGEST * size.max() / typical) if typical > 0.0 else 1.0
    rows = np.unique(np.linspace(0, max(len(xy) - 1, 0), min(len(xy), MOST)).astype(np.int64))
    path = "".join(_arrow((xy[k] - corner) * scale, residuals[k] * factor * scale) for k in rows)
    rings = "" if suspected is None else "".join(_ring((at - corner) * scale) for at in xy[suspected])
    bar = round_below(0.2 * size[0] / factor)
    length = bar * factor * scale
    legend = (
        f'<path class="bar" d="M8 {height + 14:.1f}h{length:.1f}"/>'
        f'<text x="{length + 14:.1f}" y="{height + 18:.1f}">{bar:g} px</text>'
    )
    body = f'<rect class="frame" width="{width:.0f}" height="{height:.1f}"/><path class="arrow" d="{path}"/>'
    return svg(body + rings + legend, label, width, height + 24.0, RING + 2.0)


def _ring(at: FloatArray) -> str:
    return f'<circle class="suspect" cx="{at[0]:.1f}" cy="{at[1]:.1f}" r="{RING:g}"/>'


def _arrow(at: FloatArray, step: FloatArray) -> str:
    """A line with two barbs at its end."""
    (x, y), (dx, dy) = at.tolist(), step.tolist()
    barbs = "".join(f"m{-u:.1f} {-v:.1f}l{u:.1f} {v:.1f}" for u, v in _barbs(dx, dy))
    return f"M{x:.1f} {y:.1f}l{dx:.1f} {dy:.1f}{barbs}"


def _barbs(dx: float, dy: float) -> Iterator[tuple[float, float]]:
    for turn in (0.4, -0.4):
        cosine, sine = math.cos(turn), math.sin(turn)
        yield 0.3 * (cosine * dx - sine * dy), 0.3 * (sine * dx + cosine * dy)


def radial_profile(middle: Sequence[float], xy: FloatArray, residuals: FloatArray, label: str) -> str:
    """Mean of the radial part of residuals, quadratic mean of their lengths, by the radius from a point."""
    arms = xy - np.asarray(middle)
    radius = np.linalg.norm(arms, axis=1)
    outward = np.sum(arms * residuals, axis=1) / np.maximum(radius, 1e-12)
    edges = np.linspace(0.0, radius.max(initial=1.0) * (1.0 + 1e-9), BINS + 1)
    owner = np.clip(np.digitize(radius, edges) - 1, 0, BINS - 1)
    counts = np.maximum(np.bincount(owner, minlength=BINS), 1)
    mean = np.bincount(owner, outward, BINS) / counts
    rms = np.sqrt(np.bincount(owner, np.sum(residuals**2, axis=1), BINS) / counts)
    middles = (edges[1:] + edges[:-1]) / 2.0
    used = np.bincount(owner, minlength=BINS) > 0
    top = float(max(rms.max(initial=0.0), np.abs(mean).max(initial=0.0), 1e-12))
    plot = _Plot((0.0, float(edges[-1])), (-top, top))
    body = plot.axes("px from the principal point", "px") + plot.line(middles[used], rms[used], "second")
    return svg(body + plot.line(middles[used], mean[used], "first"), label)


def histogram(normalised: FloatArray, label: str) -> str:
    """Residuals over their sigmas, and the normal density that they should have."""
    inside = normalised[np.abs(normalised) < LIMIT]
    counts, edges = np.histogram(inside, 2 * BINS, (-LIMIT, LIMIT))
    density = counts / max(len(normalised), 1) / (edges[1] - edges[0])
    plot = _Plot((-LIMIT, LIMIT), (0.0, max(0.45, float(density.max(initial=0.0)))))
    bars = "".join(plot.bar(edges[k], edges[k + 1], density[k]) for k in range(len(density)))
    x = np.linspace(-LIMIT, LIMIT, 81)
    curve = plot.line(x, np.exp(-(x**2) / 2.0) / math.sqrt(2.0 * math.pi), "first")
    outside = len(normalised) - len(inside)
    note = f"residual / sigma ({outside} beyond {LIMIT:g})" if outside else "residual / sigma"
    return svg(plot.axes(note, "") + bars + curve, label)


class _Plot:
    """From two ranges of numbers to a drawing."""

    def __init__(self, across: tuple[float, float], up: tuple[float, float]) -> None:
        self.across, self.up = across, up

    def place(self, x: float, y: float) -> tuple[float, float]:
        """Where a pair of numbers is drawn."""
        left, right = self.across
        low, high = self.up
        return (
            LEFT + (x - left) / (right - left) * (WIDTH - LEFT - 10.0),
            HEIGHT - MARGIN - (y - low) / (high - low) * (HEIGHT - MARGIN - 12.0),
        )

    def line(self, xs: FloatArray, ys: FloatArray, style: str) -> str:
        """A line through points."""
        places = (self.place(float(x), float(y)) for x, y in zip(xs, ys, strict=True))
        path = "L".join(f"{x:.1f} {y:.1f}" for x, y in places)
        return f'<path class="{style}" d="M{path}"/>' if path else ""

    def bar(self, left: float, right: float, value: float) -> str:
        """A bar that stands on zero."""
        (x, y), (end, foot) = self.place(left, value), self.place(right, 0.0)
        return (
            f'<rect class="bin" x="{x:.1f}" y="{y:.1f}" width="{end - x - 0.5:.1f}" height="{foot - y:.1f}"/>'
        )

    def axes(self, across: str, up: str) -> str:
        """Two axes with the ends of their ranges, and the line of zero."""
        (left, foot), (right, top) = (
            self.place(self.across[0], self.up[0]),
            self.place(self.across[1], self.up[1]),
        )
        zero = self.place(self.across[0], 0.0)[1]
        texts = [
            (left, foot + 14, f"{self.across[0]:.4g}", "start"),
            (right, foot + 14, f"{self.across[1]:.4g}", "end"),
            ((left + right) / 2, foot + 28, across, "middle"),
            (left - 4, top + 8, f"{self.up[1]:.3g}", "end"),
            (left - 4, foot, f"{self.up[0]:.3g}", "end"),
            (left + 4, top + 8, up, "start"),
        ]
        marks = "".join(
            f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{text}</text>'
            for x, y, text, anchor in texts
        )
        lines = f"M{left:.1f} {top:.1f}V{foot:.1f}H{right:.1f}M{left:.1f} {zero:.1f}H{right:.1f}"
        return f'<path class="axis" d="{lines}"/>{marks}'


def grid_of(size: Size, focal: float) -> FloatArray:
    """(289, 2) points of a regular grid of the image, in pixels."""
    corner, reach = frame_of(size, np.full((1, 2), 2.0 * focal))
    ticks = [np.linspace(corner[k], corner[k] + reach[k], GRID) for k in (0, 1)]
    x, y = np.meshgrid(*ticks)
    return np.column_stack([x.ravel(), y.ravel()])


def undistorted_grid(given: FloatArray, undistorted: FloatArray, label: str) -> str:
    """A grid of the image, and where its points would be without distortion (not finite: nowhere)."""
    straight = undistorted.reshape(GRID, GRID, 2)
    found = undistorted[np.isfinite(undistorted).all(axis=1)]
    low = np.minimum(found.min(axis=0, initial=0.0), given.min(axis=0))
    high = np.maximum(found.max(axis=0, initial=0.0), given.max(axis=0))
    scale = float(min(WIDTH / (high[0] - low[0]), 420.0 / (high[1] - low[1])))

    def drawn(grid: FloatArray, style: str) -> str:
        lines = [_polyline((row - low) * scale) for row in (*grid, *np.swapaxes(grid, 0, 1))]
        return f'<path class="{style}" d="{"".join(lines)}"/>'

    body = drawn(given.reshape(GRID, GRID, 2), "given") + drawn(straight, "first")
    return svg(body, label, WIDTH, float((high[1] - low[1]) * scale) + 2.0)


def _polyline(points: FloatArray) -> str:
    """A line that breaks where a point is not defined."""
    words, pen = [], "M"
    for x, y in points.tolist():
        if math.isfinite(x) and math.isfinite(y):
            words.append(f"{pen}{x:.1f} {y:.1f}")
            pen = "L"
        else:
            pen = "M"
    return "".join(words)
