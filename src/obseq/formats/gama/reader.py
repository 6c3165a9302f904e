"""Networks of GNU Gama (`gama-local`, `.gkf`): XML with points and observations in a plane with heights.

Gama computes in a flat world: no curvature, no refraction, heights independent of the plan. So does the frame
here, `Local`, with a refraction coefficient of 1. Points keep the axes of the file (`Local*sw`).
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from obseq import crs
from obseq.formats.columns import Columns
from obseq.formats.gama import values
from obseq.formats.gama.observations import Defaults, ObservationReader
from obseq.formats.gama.points import PointTable
from obseq.formats.levelled_points import with_heights
from obseq.formats.project import Project, Reading, only_one
from obseq.reading.angles import SECOND
from obseq.reading.xml import Element, read_xml
from obseq.records.shown_units import ShownUnits
from obseq.survey.model import FieldBook

ROOTS = ("gama-local", "gama-xml")
NAMESPACES = (None, "http://www.gnu.org/software/gama/gama-local")
SECTION = (
    "distance-stdev",
    "direction-stdev",
    "angle-stdev",
    "zenith-angle-stdev",
    "azimuth-stdev",
)
PARAMETERS = (
    *("sigma-apr", "conf-pr", "tol-abs", "sigma-act", "update-constrained-coordinates", "algorithm"),
    *("angular", "angles", "cov-band", "latitude", "ellipsoid", "language", "encoding", "iterations"),
)
SETS = ("obs", "height-differences", "vectors", "coordinates")
HANDS = {"left-handed": 1.0, "right-handed": -1.0}
UNIT_SIGMA = 10.0
"""Standard deviation of unit weight of files that give none."""
NEITHER = 1.0
"""Refraction coefficient that stands for neither refraction nor curvature."""

ANGLES = ("direction", "angle", "azimuth", "z-angle")
"""Elements that hold an angle."""


def read_gama(paths: tuple[Path, ...], reading: Reading) -> Project:
    """Reads a network of gama-local.

    Args:
        paths: The file.
        reading: How to read it; the encoding is that which the file declares.

    Raises:
        InputError: Naming file and line, what is wrong and what to do.
    """
    root = read_xml(only_one(paths))
    network = _network(root)
    unit_sigma = _parameters(network)
    axes, hand = _orientation(network)
    sections = list(network.named("points-observations"))
    if not sections:
        raise network.error("<network> has no <points-observations>, which hold points and observations")
    table, columns = PointTable(root.file), Columns()
    for section in sections:
        section.allow(SECTION, ("point", *SETS))
        _read_points(section, table)
    system = crs.parse(f"Local*{axes}")
    assert isinstance(system, crs.UnreferencedSystem) and system.axes is not None
    reader = ObservationReader(table, columns, columns.open_file(root.file))
    for section in sections:
        defaults = Defaults(section, unit_sigma, hand, system.axes)
        for element in section.named(*SETS):
            reader.read(element, defaults)
    if not len(columns):
        raise network.error("the network holds no observation")
    points = table.points()
    if not len(points):
        raise network.error("no point has fix or adj: nothing is to be adjusted")
    book = replace(
        columns.field_book(), warnings=tuple(reader.warnings(root.file.name)), unused=tuple(reader.unused())
    )
    _require_some(network, book)
    points = with_heights(points, book)
    return Project(
        points, book, "Local", system.definition, NEITHER, unit_sigma=unit_sigma, shown=_shown(sections)
    )


def _require_some(network: Element, book: FieldBook) -> None:
    if not book.observations.active.any():
        reasons = "; ".join(item.reason for item in book.unused)
        raise network.error(
            f'no observation takes part: {reasons}; write adj="xyz" (xy, z) into the points to be adjusted'
        )


def _shown(sections: list[Element]) -> ShownUnits | None:
    """Degrees, minutes and seconds where the first angle has them."""
    sights = (sight for section in sections for group in section.named(*SETS) for sight in group.children)
    first = next((sight for sight in sights if sight.name in ANGLES), None)
    has_degrees = first is not None and values.angle(first).unit == SECOND
    return ShownUnits(angle="dms") if has_degrees else None


def _network(root: Element) -> Element:
    if root.name not in ROOTS:
        raise root.error(f"<{root.name}> is not a network of gama-local, which begins with <gama-local>")
    if root.attributes.get("xmlns") not in NAMESPACES:
        raise root.error(f"the name space is not that of gama-local, {NAMESPACES[1]}")
    root.allow(("xmlns", "version"), ("network",))
    if len(root.children) != 1:
        raise root.error(f"{len(root.children)} networks in one file; a file holds one: split it")
    network = root.children[0]
    network.allow(("axes-xy", "angles", "epoch"), ("description", "parameters", "points-observations"))
    return network


def _parameters(network: Element) -> float:
    """The standard deviation of unit weight (mm, cc)."""
    found = UNIT_SIGMA
    for element in network.named("parameters"):
        element.allow(PARAMETERS)
        found = element.positive("sigma-apr") or found
        _refuse_reductions(network, element)
    return found


def _refuse_reductions(network: Element, element: Element) -> None:
    given = [name for name in ("latitude", "ellipsoid") if element.get(name) is not None]
    reduced = ("direction", "angle", "z-angle", "azimuth")
    if given and any(
        next(group.named(*reduced), None) is not None
        for section in network.named("points-observations")
        for group in section.named("obs")
    ):
        raise element.error(
            f"{given[0]} makes gama-local reduce angles for the curvature of the Earth, which this reader "
            "does not do. Remove the attribute for a plane, or give the points a coordinate system and the "
            "network as OBS and COR files"
        )


def _orientation(network: Element) -> tuple[str, float]:
    """Where x and y point to, and the sense of angles."""
    axes, hand = network.get("axes-xy") or "ne", network.get("angles") or "left-handed"
    if axes not in crs.AXES:
        raise network.error(f"axes-xy is {axes!r}; it is one of {', '.join(crs.AXES)}")
    if hand not in HANDS:
        raise network.error(f"angles is {hand!r}; it is left-handed or right-handed")
    return axes, HANDS[hand]


def _read_points(section: Element, table: PointTable) -> None:
    """All points of a section; those of observed coordinates too, which give their places."""
    for child in section.children:
        if child.name == "point":
            table.read(child)
        elif child.name == "coordinates":
            for point in child.named("point"):
                table.read(point, is_observed=True)
