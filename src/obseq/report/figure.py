"""A plan of the network, drawn as SVG: points, lines of sight, and error ellipses large enough to be seen."""

import math
from collections.abc import Collection, Iterable, Iterator, Sequence

from msgspec import structs

from obseq.dataclass import dataclass
from obseq.records.adjustment import AdjustmentRecord, PointRecord
from obseq.report.html import escaped
from obseq.report.scheme import Places, scheme

WIDTH = 900.0
TALLEST = 600.0
LEGEND = 30.0
MARGIN = 50.0
MOST_LINES = 5000
MOST_NAMES = 500
LETTER = 7.5
LINE = 12.0
LARGEST_ELLIPSE = 40.0


@dataclass(frozen=True)
class View:
    """From plan coordinates (m, y up) to the figure (y down).

    Attributes:
        left: Smallest x.
        top: Largest y.
        scale: Figure units per metre.
        height: Height of the figure.
    """

    left: float
    top: float
    scale: float
    height: float

    def place(self, point: PointRecord) -> tuple[float, float]:
        """Where a point that has a plan is drawn."""
        x, y = point.plan or (self.left, self.top)
        return MARGIN + (x - self.left) * self.scale, MARGIN + (self.top - y) * self.scale


def network_figure(record: AdjustmentRecord) -> str:
    """The plan of an adjusted network as an SVG element."""
    drawn = scheme(record)
    points = record.points if drawn is None else tuple(_on_scheme(point, drawn) for point in record.points)
    sights = ((row.origin, row.target) for row in record.observations if row.active)
    return plan_figure(points, sights, {row.origin for row in record.stations}, is_scheme=drawn is not None)


def _on_scheme(point: PointRecord, places: Places) -> PointRecord:
    x, y = places[point.name]
    return structs.replace(point, x=x, y=y, sx=point.sz, sy=point.sz, ellipse=None)


def plan_figure(
    given: Sequence[PointRecord],
    sights: Iterable[tuple[str, str]],
    stations: Collection[str],
    *,
    is_scheme: bool = False,
) -> str:
    """A plan as an SVG element; of a large network, not every line of sight and not every name."""
    points = [point for point in given if point.plan]
    if not points:
        return ""
    view = _view(points)
    exaggeration = _exaggeration(points, view)
    parts = [
        f'<svg viewBox="0 0 {WIDTH:.0f} {view.height:.0f}" role="img" aria-label="plan of the network">',
        f'<path class="sight" d="{_sights(sights, {point.name: point for point in points}, view)}"/>',
        *_marks(points, stations, view, exaggeration),
        *_names(points, stations, view),
        *(_legend(view, exaggeration) if not is_scheme else _no_plan(view)),
        "</svg>",
    ]
    return "\n".join(parts)


def _view(points: list[PointRecord]) -> View:
    """The largest view that holds all points, in the middle of the figure."""
    xs, ys = zip(*(point.plan for point in points if point.plan), strict=True)
    wide, tall = max(xs) - min(xs), max(ys) - min(ys)
    inside = WIDTH - 2.0 * MARGIN
    scale = min(inside / max(wide, 1e-6), TALLEST / max(tall, 1e-6))
    left = (min(xs) + max(xs) - inside / scale) / 2.0
    return View(left, max(ys), scale, tall * scale + 2.0 * MARGIN + LEGEND)


def _sights(sights: Iterable[tuple[str, str]], points: dict[str, PointRecord], view: View) -> str:
    pairs = {(min(ends), max(ends)) for ends in sights}
    known = sorted(pair for pair in pairs if pair[0] in points and pair[1] in points)
    return "".join(
        "M{:.1f} {:.1f}L{:.1f} {:.1f}".format(*view.place(points[start]), *view.place(points[end]))
        for start, end in known[:MOST_LINES]
    )


def _marks(
    points: list[PointRecord], stations: Collection[str], view: View, exaggeration: float
) -> Iterator[str]:
    for point in points:
        x, y = view.place(point)
        yield _precision(point, x, y, exaggeration * view.scale)
        if point.name in stations:
            yield f'<path class="station" d="M{x:.1f} {y - 6:.1f}l5.2 9h-10.4z"/>'
        else:
            yield f'<circle class="point" cx="{x:.1f}" cy="{y:.1f}" r="3"/>'


def _names(points: list[PointRecord], stations: Collection[str], view: View) -> Iterator[str]:
    """The names that find room, those of stations first; none where there are too many points."""
    taken: list[tuple[float, float, float]] = []
    for point in sorted(points, key=lambda point: point.name not in stations):
        if len(points) > MOST_NAMES:
            return
        x, y = view.place(point)
        width = LETTER * len(point.name)
        left = x + 8.0 if x + 8.0 + width < WIDTH else x - 8.0 - width
        if all(abs(y - other) > LINE or left > end or left + width < start for other, start, end in taken):
            taken.append((y, left, left + width))
            yield f'<text x="{left:.1f}" y="{y - 6:.1f}">{escaped(point.name)}</text>'


def _precision(point: PointRecord, x: float, y: float, scale: float) -> str:
    """An error ellipse, or a cross of the two precisions when it is not in the record."""
    ellipse = point.ellipse
    if ellipse:
        radii = f'rx="{ellipse.semi_major * scale:.2f}" ry="{ellipse.semi_minor * scale:.2f}"'
        turn = f"translate({x:.1f} {y:.1f}) rotate({math.degrees(ellipse.bearing) - 90.0:.2f})"
        return f'<ellipse class="precision" {radii} transform="{turn}"/>'
    dx, dy = (point.sx or 0.0) * scale, (point.sy or 0.0) * scale
    return (
        f'<path class="precision" d="M{x - dx:.2f} {y:.2f}h{2 * dx:.2f}M{x:.2f} {y - dy:.2f}v{2 * dy:.2f}"/>'
    )


def _exaggeration(points: list[PointRecord], view: View) -> float:
    """The round factor (1, 2 or 5 times a power of ten) that makes the largest precision well visible."""
    largest = max(max(point.sx or 0.0, point.sy or 0.0) for point in points)
    return _round_below(LARGEST_ELLIPSE / (largest * view.scale)) if largest > 0.0 else 1.0


def _round_below(value: float) -> float:
    power = 10.0 ** math.floor(math.log10(value))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= value)


def _no_plan(view: View) -> Iterator[str]:
    text = "no plan is known: a scheme of the levelling, with the standard deviations of the heights"
    yield f'<text x="{MARGIN:.0f}" y="{view.height - 11:.1f}">{text}</text>'


def _legend(view: View, exaggeration: float) -> Iterator[str]:
    length = _round_below(WIDTH / 4.0 / view.scale)
    y = view.height - 15.0
    yield f'<path class="bar" d="M{MARGIN:.0f} {y:.1f}h{length * view.scale:.1f}"/>'
    text = f"{length:g} m; precisions (one sigma) enlarged {exaggeration:g} times"
    yield f'<text x="{MARGIN + length * view.scale + 10:.1f}" y="{y + 4:.1f}">{text}</text>'
