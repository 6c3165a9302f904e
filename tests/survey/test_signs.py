"""A value that is too large by b is told to be too large by b, whatever the kind of observation."""

import numpy as np
import pytest
from outside import OutsideData

from obseq.formats.columns import Columns, Measure
from obseq.stopwatch import Stopwatch
from obseq.survey import KINDS, Quality, simulate
from obseq.survey.kinds.registry import BY_NAME
from obseq.survey.model import Orientation, points_of_lines
from obseq.survey.network import Network
from obseq.survey.planning.simulation import with_values

PLACES = {
    "A": (0.0, 0.0, 0.0),
    "B": (180.0, 20.0, 8.0),
    "C": (150.0, 160.0, -5.0),
    "D": (-20.0, 140.0, 12.0),
    "P": (60.0, 90.0, 30.0),
    "Q": (110.0, 50.0, -20.0),
}
WITHOUT_VALUE = ("EqualDH", "EqualDist", "AxisRadius", "AxisPlane", "AxisFoot")
"""Conditions: nothing is read, so that no reading can be wrong."""
FACTOR = 12.0


def sigma_of(kind):
    """A millimetre, or about that: seen from 100 m, or from the centre of the Earth for places."""
    if not kind.is_angle:
        return 1e-3
    return 2e-10 if kind.is_absolute else 1e-5


def network(kind):
    """Distances and height differences between all points, and observations of one kind on top of them."""
    book, known = Columns(), len(PLACES) - 2
    book.files.append("signs")
    book.names = {name: row for row, name in enumerate(PLACES)}
    pairs = [(a, b) for a in range(len(PLACES)) for b in range(len(PLACES)) if a != b]
    for a, b in pairs:
        book.append(Measure(BY_NAME["Dist"], a, b, 0.0, 0.002), 0, 0)
        book.append(Measure(BY_NAME["DH"], a, b, 0.0, 0.002), 0, 0)
    for measure in measures(book, kind, pairs):
        book.append(measure, 0, 1)
    sigmas = np.where(np.arange(len(PLACES))[:, None] < known, [[0.001] * 3], np.nan)
    points = points_of_lines(
        list(PLACES), np.array([*PLACES.values()]), sigmas, "signs", dict.fromkeys(PLACES, 1)
    )
    return Network.assembled(points, book.field_book(), "RTL*3*45*0*EPSG:4326", None, 0.12, Stopwatch())


def measures(book, kind, pairs):
    """Observations of a kind; set-ups have several, and what groups share is determined by theirs."""
    sigma, stations = sigma_of(kind), {}
    group = book.instrument("one") if kind.with_unknowns else -1
    for a, b in pairs:
        if kind.needs_station and a not in stations:
            orientation = Orientation.VERT if kind.is_of_circle else Orientation.FIX
            stations[a] = book.open_station(a, orientation)
        if kind.group == "Barycentre":
            group = book.open_barycentre((b, (b + 1) % len(PLACES)), (0.4, 0.6))
        if kind.name == "Normal":
            group = book.open_normal_row((a, b), (0.6, 0.0, 0.0, 0.0, -0.8, 0.0))
        third = next(row for row in range(len(PLACES)) if row not in (a, b)) if kind.name == "Angle" else -1
        station = stations.get(a, -1)
        yield Measure(kind, a, b, 0.0, sigma, group=group, station=station, backsight=third)


@pytest.mark.parametrize(
    "kind", [k for k in KINDS if k.name not in WITHOUT_VALUE], ids=lambda kind: kind.name
)
def test_the_sign_of_an_error_is_that_of_the_advice(kind):
    exact = simulate(network(kind), noise=False)
    wrong = int(np.flatnonzero(exact.book.observations.types == kind.code)[7])
    error, values = FACTOR * sigma_of(kind), exact.book.observations.values.copy()
    values[wrong] += error
    adjusted = with_values(exact, values).adjust(quality=Quality())
    told = adjusted.quality.observations
    assert adjusted.converged and 0.05 < told.redundancy[wrong] < 0.999
    assert adjusted.residuals[wrong] < 0.0  # computed minus observed
    assert told.standardised[wrong] < 0.0 and told.tau[wrong] < 0.0
    np.testing.assert_allclose(told.blunder[wrong], error, rtol=0.02)
    every = np.isfinite(told.standardised) & (np.abs(told.standardised) > 0.01)
    assert (np.sign(told.standardised) == np.sign(adjusted.residuals))[every].all()
    snooped = with_values(exact, values).adjust(quality=Quality(snooping="w")).quality
    assert snooped.rejected.nonzero()[0].tolist() == [wrong]
    np.testing.assert_allclose(snooped.snooping.rejections[0].blunder, error, rtol=0.02)


def test_the_advice_for_a_polar_sub_frame_is_the_planted_error():
    """Alpha of P is 50 mgon too large."""
    adjusted = Network.read_project(OutsideData() / "verdict-cases/alpha/n.comp").adjust()
    book, told = adjusted.book, adjusted.quality.observations
    row = next(row for row in range(len(book.observations)) if book.label(row).startswith("Alpha S -> P"))
    assert told.blunder[row] * 200 / np.pi == pytest.approx(0.0509, abs=1e-4)
    assert told.standardised[row] < -37.0 and adjusted.residuals[row] < 0.0
