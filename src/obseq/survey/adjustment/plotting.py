"""The plan of an adjustment drawn with matplotlib."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from obseq.arrays import BoolArray, FloatArray
from obseq.dataclass import dataclass
from obseq.leastsquares.statistics.ellipses import ellipses_of
from obseq.packages import require
from obseq.survey.adjustment.adjusted_records import place_records
from obseq.survey.equations.frame import Frame
from obseq.survey.model import FieldBook, Points

Axes = Any  # of matplotlib, an extra

USUAL = 0.06
"""Length of a usual ellipse, as a share of the plan."""
HIGHEST = 3.0
"""Residuals over sigmas at the end of the colours."""


@dataclass(frozen=True, eq=False)
class Places:
    """Points of a plan.

    Attributes:
        names: (n,).
        coordinates: (n, 3) metres; x and y are drawn.
        covariances: (n, 3, 3) m^2.
        is_known: (n,) whether it is drawn as a triangle.
    """

    names: tuple[str, ...]
    coordinates: FloatArray
    covariances: FloatArray
    is_known: BoolArray


@dataclass(frozen=True, eq=False)
class Sights:
    """Lines of a plan.

    Attributes:
        ends: (k, 2, 3) metres.
        sizes: (k,) residuals over sigmas, by which they are coloured; None: all alike.
    """

    ends: FloatArray
    sizes: FloatArray | None


def plan(points: Places, sights: Sights, shape: tuple[float | None, int | None], axes: Axes) -> Axes:
    """Draws points, sights and ellipses; gives the axes of matplotlib.

    Args:
        points: The adjusted points.
        sights: Between points, or from them to instruments and cameras.
        shape: Level of the ellipses, and the redundancy of sigma0; None: standard ones, a priori ones.
        axes: Where to draw; None: a figure of its own.
    """
    require("plot", "plot", "matplotlib")
    from matplotlib import pyplot
    from matplotlib.collections import EllipseCollection, LineCollection

    axes = axes or pyplot.subplots(figsize=(8, 8))[1]
    places = points.coordinates[:, :2]
    lines = LineCollection(list(sights.ends[:, :, :2]), linewidths=0.7, zorder=1)
    if sights.sizes is not None:
        lines.set_array(sights.sizes)
        lines.set_clim(0.0, HIGHEST)
        axes.figure.colorbar(lines, ax=axes, label="residual / sigma")
    else:
        lines.set_color("#98a2ad")
    axes.add_collection(lines)
    level, redundancy = shape
    shapes = ellipses_of(points.names, points.covariances, level, redundancy)
    usual = (
        float(np.nanmedian(shapes.semi_major[shapes.semi_major > 0.0]))
        if (shapes.semi_major > 0.0).any()
        else 1.0
    )
    size = float(np.nanmax(np.ptp(places, axis=0))) or 1.0
    factor = _round_below(USUAL * size / usual)
    axes.add_collection(
        EllipseCollection(
            2.0 * factor * shapes.semi_major,
            2.0 * factor * shapes.semi_minor,
            90.0 - np.degrees(shapes.bearing),
            units="xy",
            offsets=places,
            offset_transform=axes.transData,
            facecolors="none",
            edgecolors="#8b3a62",
            zorder=2,
        )
    )
    axes.plot(*places[~points.is_known].T, "o", color="#1b1f24", markersize=4, zorder=3)
    axes.plot(*places[points.is_known].T, "^", color="#1b1f24", markersize=8, zorder=3)
    for name, place in zip(points.names, places, strict=True):
        axes.annotate(name, place, xytext=(6, 4), textcoords="offset points", fontsize=8)
    words = "standard" if level is None else f"{100 * level:g} %"
    axes.set_title(f"ellipses {words}, {factor:g} times larger than life")
    axes.set_aspect("equal", "datalim")
    axes.margins(0.1)
    return axes


def _round_below(value: float) -> float:
    power = 10.0 ** math.floor(math.log10(value))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= value)


def network_html(points: Points, book: FieldBook, frame: Frame) -> str:
    """What a network consists of, and a plan of the points that have coordinates."""
    from obseq.report import notebook

    names, observations = book.point_names, book.observations
    ends = zip(observations.from_points.tolist(), observations.to_points.tolist(), strict=True)
    return notebook.network_html(
        place_records(points),
        ((names[a], names[b]) for a, b in ends),
        {names[row] for row in book.stations.origins.tolist()},
        network_text(points, book, frame),
    )


def network_text(points: Points, book: FieldBook, frame: Frame) -> str:
    """What a network consists of, in a line."""
    known = int((~points.is_free).any(axis=1).sum())
    return (
        f"{len(points)} points ({known} known), {len(book.observations)} observations, "
        f"{len(book.stations)} stations; frame {frame.system.definition}"
    )
