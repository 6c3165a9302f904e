"""The plan of a page as an SVG element, for notebooks: points, lines of sight, and error ellipses."""

import math
from collections.abc import Iterable, Iterator, Sequence

from obseq.dataclass import dataclass
from obseq.report.drawings.html import escaped
from obseq.report.drawings.plan import STATION, round_below
from obseq.report.tables.units import Plain

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

    def place(self, x: float, y: float) -> tuple[float, float]:
        """Where a place of the plan is drawn."""
        return MARGIN + (x - self.left) * self.scale, MARGIN + (self.top - y) * self.scale


def figure(plan: Plain, names: Sequence[str], sights: Iterable[tuple[str, str]]) -> str:
    """A plan (see `plan.plan`) as an SVG element; of a large network, not every sight and not every name."""
    known = {k: (x, y) for k, (x, y) in enumerate(zip(plan["x"], plan["y"], strict=True)) if x is not None}
    if not known:
        return ""
    view = _view(list(known.values()))
    places = {k: view.place(*place) for k, place in known.items()}
    stations = [k for k in known if plan["marks"][k] & STATION]
    enlarged = _exaggeration(plan, view)
    parts = [
        f'<svg viewBox="0 0 {WIDTH:.0f} {view.height:.0f}" role="img" aria-label="plan of the network">',
        f'<path class="sight" d="{_sights(sights, {names[k]: place for k, place in places.items()})}"/>',
        *_marks(plan, places, enlarged * view.scale),
        *_names(names, places, stations),
        *_legend(plan, view, enlarged),
        "</svg>",
    ]
    return "\n".join(parts)


def _view(places: list[tuple[float, float]]) -> View:
    """The largest view that holds all places, in the middle of the figure."""
    xs, ys = zip(*places, strict=True)
    wide, tall = max(xs) - min(xs), max(ys) - min(ys)
    inside = WIDTH - 2.0 * MARGIN
    scale = min(inside / max(wide, 1e-6), TALLEST / max(tall, 1e-6))
    left = (min(xs) + max(xs) - inside / scale) / 2.0
    return View(left, max(ys), scale, tall * scale + 2.0 * MARGIN + LEGEND)


def _sights(sights: Iterable[tuple[str, str]], places: dict[str, tuple[float, float]]) -> str:
    pairs = {(min(ends), max(ends)) for ends in sights}
    known = sorted(pair for pair in pairs if pair[0] in places and pair[1] in places)
    return "".join(
        "M{:.1f} {:.1f}L{:.1f} {:.1f}".format(*places[start], *places[end])
        for start, end in known[:MOST_LINES]
    )


def _marks(plan: Plain, places: dict[int, tuple[float, float]], scale: float) -> Iterator[str]:
    """Ellipses, triangles of stations, points."""
    for k, (x, y) in places.items():
        if scale and plan["major"][k] is not None:
            radii = f'rx="{plan["major"][k] * scale:.2f}" ry="{plan["minor"][k] * scale:.2f}"'
            turn = f"translate({x:.1f} {y:.1f}) rotate({math.degrees(plan['bearing'][k]) - 90.0:.2f})"
            yield f'<ellipse class="precision" {radii} transform="{turn}"/>'
        if plan["marks"][k] & STATION:
            yield f'<path class="station" d="M{x:.1f} {y - 6:.1f}l5.2 9h-10.4z"/>'
        else:
            yield f'<circle class="point" cx="{x:.1f}" cy="{y:.1f}" r="3"/>'


def _names(
    names: Sequence[str], places: dict[int, tuple[float, float]], stations: Sequence[int]
) -> Iterator[str]:
    """The names that find room, those of stations first; none where there are too many points."""
    taken: list[tuple[float, float, float]] = []
    for k in dict.fromkeys([*stations, *places]) if len(places) <= MOST_NAMES else ():
        x, y = places[k]
        width = LETTER * len(names[k])
        left = x + 8.0 if x + 8.0 + width < WIDTH else x - 8.0 - width
        if all(abs(y - other) > LINE or left > end or left + width < start for other, start, end in taken):
            taken.append((y, left, left + width))
            yield f'<text x="{left:.1f}" y="{y - 6:.1f}">{escaped(names[k])}</text>'


def _exaggeration(plan: Plain, view: View) -> float:
    """The round factor that makes the largest ellipse well visible; 0 without any."""
    largest = max((size for size in plan.get("major", ()) if size is not None), default=0.0)
    return round_below(LARGEST_ELLIPSE / (largest * view.scale)) if largest > 0.0 else 0.0


def _legend(plan: Plain, view: View, enlarged: float) -> Iterator[str]:
    y = view.height - 11.0
    if plan["scheme"]:
        yield f'<text x="{MARGIN:.0f}" y="{y:.1f}">{plan["title"]}; {plan["ellipses"]}</text>'
        return
    length = round_below(WIDTH / 4.0 / view.scale)
    yield f'<path class="bar" d="M{MARGIN:.0f} {y - 4:.1f}h{length * view.scale:.1f}"/>'
    text = f"{length:g} m" + (f"; {plan['ellipses']}, enlarged {enlarged:g} times" if enlarged else "")
    yield f'<text x="{MARGIN + length * view.scale + 10:.1f}" y="{y:.1f}">{escaped(text)}</text>'
