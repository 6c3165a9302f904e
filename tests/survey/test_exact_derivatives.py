"""Derivatives by points are those of whole residuals, everything made anew at moved points.

Of all kinds, in all frames. Sights are of some kilometres: what leans by their length over the radius of the
Earth makes 1e-3 of a derivative.
"""

from dataclasses import replace
from itertools import cycle, permutations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from obseq import crs
from obseq.formats.columns import Columns, Measure
from obseq.geometry.circles import axis_of
from obseq.leastsquares.assembly.evaluation import jacobian_rows, raw_residuals
from obseq.stopwatch import Stopwatch
from obseq.survey import KINDS
from obseq.survey.equations.equations import Equations
from obseq.survey.equations.point_system import PointSystem
from obseq.survey.initial.initial_values import InitialValues
from obseq.survey.kinds.registry import BY_NAME, FAMILIES
from obseq.survey.model import Orientation, points_of_lines
from obseq.survey.network import Network

PLACES = np.array(
    [
        (3000.0, 2000.0, 700.0),
        (9000.0, 2500.0, 900.0),
        (6000.0, 9000.0, 1200.0),
        (10_000.0, 12_500.0, 300.0),
        (-4000.0, 6000.0, 150.0),
        (500.0, -7000.0, 420.0),
    ]
)
NAMES = "ABCDEF"
FRAMES = {
    "plane": "Local",
    "local": "RTL*2.4*58.8*0*EPSG:4326",
    "pole": "RTL*-172.5*-89.9*0*EPSG:4326",
    "antimeridian": "RTL*179.98*-17.5*0*EPSG:4326",
    "geocentric": "GeoC",
}
STEP = 10.0  # m
ORDERS = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
AXIS = "AxisRadius", "AxisPlane", "AxisFoot"
ON_EARTH = *("VX", "VY", "VZ", "GeoX", "GeoY", "GeoZ"), *("Height", "Lat", "Lon", "Chord", "Normal")
"""What needs a place on the Earth."""


def network(where, kinds=KINDS):
    """Observations of all kinds that suit, between all points, with heights and deflections."""
    book, known = Columns(), np.arange(6)[:, None] < 2
    book.files.append("derivatives")
    book.names = {name: row for row, name in enumerate(NAMES)}
    for measure in measures(book, where, kinds):
        book.append(measure, 0, 1)
    places = PLACES.copy()
    normal = axis_of(PLACES[1:4]) / np.linalg.norm(axis_of(PLACES[1:4]))
    places[4] -= (places[4] - places[0]) @ normal * normal  # the first point is the foot of it on the axis
    if where == "geocentric":
        places = crs.Transformer(crs.parse(FRAMES["local"]), crs.parse("GeoC")).forward(places)
    sigmas = np.where(known, 0.001, np.nan) * np.ones(3)
    points = points_of_lines(list(NAMES), places, sigmas, "derivatives", dict.fromkeys(NAMES, 1))
    if where not in ("plane", "geocentric"):
        points = replace(points, deflections=1e-4 * np.sin(np.arange(12.0)).reshape(6, 2))
    return Network.assembled(points, book.field_book(), FRAMES[where], None, 0.12, Stopwatch())


def measures(book, where, kinds):
    sorts = [Orientation.FIX, Orientation.BASC]
    sorts += [Orientation.VERT, Orientation.GRID] * (where != "geocentric")
    stations = [book.open_station(a, sort) for a, sort in zip(range(6), cycle(sorts), strict=False)]
    for kind in kinds:
        if suits(kind, where) and kind.name not in AXIS:
            yield from between_all(book, kind, stations, where)
    axis = book.open_group("axis")
    group = book.open_group("target", axis)
    for name in AXIS[:2]:
        yield from (Measure(BY_NAME[name], 0, b, 0.0, 0.01, group=group) for b in (1, 2, 3))
    yield Measure(BY_NAME[AXIS[2]], 0, 4, 0.0, 0.01, group=axis)


def between_all(book, kind, stations, where):
    """Two heights are given where the kind takes any, and there is a vertical along which they are."""
    heights = (1.5, 2.5) if (kind.takes_heights or kind.is_raised) and where != "geocentric" else (0.0, 0.0)
    group = book.open_group(kind.name) if kind.with_unknowns or kind.name.startswith("Equal") else -1
    for a, b in permutations(range(6), 2):
        if kind.group == "Barycentre":
            group = book.open_barycentre((b, (b + 1) % 6), (0.4, 0.6))
        if kind.name == "Normal":
            group = book.open_normal_row((a, b), (0.6, 0.1, 0.3, 0.2, -0.8, 0.4))
        third = next(row for row in range(6) if row not in (a, b)) if kind.name == "Angle" else -1
        value, station = 1.0 if kind.is_angle else 100.0, stations[a] if kind.needs_station else -1
        ends = (b if kind.is_absolute else a, b)
        yield Measure(kind, *ends, value, 0.01, True, 0.0, *heights, station, group, third)


def suits(kind, where):
    """Whether the kind can be observed there."""
    if where == "plane":
        return kind.name not in ON_EARTH
    return where != "geocentric" or not (kind.is_from_north or kind.is_plumb or kind.name == "DistHz0")


def equations(of, points_crs):
    points, book, places = of.points, of.book, of.points.coordinates
    orientations = book.stations.orientations
    n, m = len(points), len(orientations)
    vectors = np.outer(orientations != Orientation.FIX, (0.0, 0.0, 0.8))
    vectors[orientations == Orientation.BASC] = 0.4, -0.3, 0.5
    turned = Rotation.from_rotvec(vectors).as_matrix() if m else np.zeros((0, 3, 3))
    upright = of.frame.vertical(places[book.stations.origins]).transpose(0, 2, 1)
    steps = (None,) * n, (None,) * m
    start = InitialValues(places, upright @ turned, np.zeros(m), orientations, *steps, (), np.ones(n))
    return Equations(of.frame, PointSystem(of.frame.system, points_crs), points, book, start)


def all_batches(of):
    known = (of.known._soft, of.known._hard)
    return [batch for _, batch in of.batches.values()] + [batch for batch in known if batch is not None]


def along(of, batch, direction):
    """(n,) derivatives along a direction (n_points, 3) of all coordinates, and (n,) those of the steepest."""
    rows, found = jacobian_rows(of.system.unknowns, batch)[1:], np.zeros((batch.n, *direction.shape))
    for role, ids in zip(batch.shape.roles, batch.blocks, strict=True):
        if role.kind == "Point3":
            at = np.arange(batch.n), np.searchsorted(of.points, ids)
            np.add.at(found, at, rows[role.row : role.row + 3].T)
    return np.einsum("nik,ik->n", found, direction), np.linalg.norm(found, axis=(1, 2))


def differences(of, batches, direction):
    """The same derivatives by differences of the sixth order."""
    places, found = of.system.values(of.points), [np.zeros(batch.n) for batch in batches]
    for count, share in ORDERS.items():
        step = count * STEP * direction
        ends = [residuals(of, batches, places + sign * step) for sign in (1.0, -1.0)]
        for own, ahead, back, batch in zip(found, *ends, batches, strict=True):
            gap = ahead - back
            if batch.group in FAMILIES and FAMILIES[batch.group][0].is_angle:
                gap -= 2.0 * np.pi * np.round(gap / (2.0 * np.pi))
            own += share / STEP * gap
    residuals(of, batches, places)
    return found


def residuals(of, batches, places):
    of.system.set_values(of.points, places)
    of.follow(of.system, 0)
    return [raw_residuals(of.system.unknowns, batch)[:, 0] for batch in batches]


def require_exact(of, batches):
    for direction in np.random.default_rng(1).normal(size=(3, 6, 3)):
        for batch, expected in zip(batches, differences(of, batches, direction), strict=True):
            found, lengths = along(of, batch, direction)
            np.testing.assert_allclose(found / lengths, expected / lengths, rtol=0, atol=1e-8)


@pytest.mark.parametrize("where", FRAMES)
def test_derivatives_are_those_of_whole_residuals(where):
    of = network(where)
    made = equations(of, of.frame.system)
    kinds = {kind.group for kind in KINDS if suits(kind, where)}
    assert {group for group, _ in made.batches} == kinds
    require_exact(made, all_batches(made))


@pytest.mark.parametrize("where", ["local", "pole", "antimeridian"])
@pytest.mark.parametrize("sigma", [0.001, 0.0])
def test_those_of_known_coordinates_are_too(where, sigma):
    """Given as longitude, latitude and height, some metres away: a degree is shorter nearer to the pole."""
    of = network(where, [BY_NAME["Dist"]])
    sigmas = np.where(np.isfinite(of.points.sigmas), sigma, np.nan)
    sigmas[:, 2] = 0.002  # not held whole: rows instead of frozen coordinates
    known = replace(of, points=replace(of.points, sigmas=sigmas, coordinates=of.points.coordinates + 3.0))
    made = equations(known, crs.parse("EPSG:4326"))
    made.system.set_values(made.points, of.points.coordinates)
    batches = all_batches(made)[len(made.batches) :]
    assert len(batches) == (1 if sigma else 2)
    require_exact(made, batches)
