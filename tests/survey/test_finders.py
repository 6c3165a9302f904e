"""What may be behind an error: each slip is told where it fits, and not where chance would do as well."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from obseq.diagnosis.protocol import Change
from obseq.survey.causes import slips
from obseq.survey.causes.catalogue import KNOWN_PLAN
from obseq.survey.causes.set_ups import CIRCLE, INSTRUMENT_HEIGHT, TARGET_HEIGHT
from obseq.survey.causes.vector_slips import slips_of_vector
from obseq.survey.causes.vectors import WHOLE_VECTOR


def found(code, size, sigma, named=None, evidence=None):
    """Codes, texts and strength of the slips of an error."""
    change = Change(0, np.atleast_1d(size).astype(float), np.atleast_1d(sigma).astype(float))
    return [(one.code, one.text, one.is_strong) for one in slips.FINDERS[code](named, change, evidence)]


@pytest.mark.parametrize("size", [math.pi, -math.pi, math.pi + 2.5e-5, 3.0 * math.pi, math.pi - 2.5e-5])
def test_half_a_turn_is_the_other_face(size):
    assert found(CIRCLE.code, size, 1e-5) == [("W117", "the other face was read from there on", True)]


@pytest.mark.parametrize("size", [0.5 * math.pi, 2.0 * math.pi, math.pi + 4e-5, 0.0])
def test_no_other_turn_is_the_other_face(size):
    assert found(CIRCLE.code, size, 1e-5) == []


def heights(written, others, code=TARGET_HEIGHT.code):
    """A wrong height of lines 0 and 1, and what stands in the others."""
    own, rest = np.array([written, written, *others]), np.zeros(2 + len(others))
    pair = (own, rest) if code == INSTRUMENT_HEIGHT.code else (rest, own)
    rows = SimpleNamespace(from_heights=pair[0], to_heights=pair[1])
    evidence = SimpleNamespace(
        effects=SimpleNamespace(notes=SimpleNamespace(book=SimpleNamespace(observations=rows)))
    )
    return SimpleNamespace(code=code, rows=np.array([0, 1])), evidence


@pytest.mark.parametrize("code", [INSTRUMENT_HEIGHT.code, TARGET_HEIGHT.code])
@pytest.mark.parametrize(
    ("written", "size", "others", "wanted"),
    [
        (0.0, -1.5, [1.5, 1.7], [("W114", "a height of 1.500 m was left out", True)]),
        (0.0, -0.75, [1.5, 1.7], [("W114", "a height of 0.750 m was left out", True)]),
        (0.0, -3.4, [1.5, 1.7], [("W114", "a height of 3.400 m was left out", True)]),
        (0.0, -0.74, [1.5, 1.7], []),  # not as those that were noted
        (0.0, -3.5, [1.5, 1.7], []),
        (0.0, 1.5, [1.5, 1.7], []),
        (0.0, -1.5, [], []),
        (1.5, 3.0, [1.7], [("W115", "the sign of the height is wrong", True)]),
        (1.5, 3.0034, [1.7], [("W115", "the sign of the height is wrong", True)]),
        (1.5, 1.5, [1.7], [("W115", "the height does not belong there", True)]),
        (1.5, 0.2, [1.3, 1.7], [("W116", "1.300 m, the height of another line, fits", False)]),
        (1.5, 0.2, [1.7], []),
        (1.5, 0.2, [1.25, 1.7], []),
        (1.5, 0.2, [1.3, *np.linspace(0.2, 2.2, 12)], []),  # one of so many fits by chance
        (1.5, 0.006, [1.494], []),  # no larger than what is not known of it
    ],
)
def test_a_height_is_left_out_of_another_sign_or_of_another_line(code, written, size, others, wanted):
    assert found(code, size, 1e-3, *heights(written, others, code)) == wanted


def plans(given, fitting, others):
    """A known point that fits elsewhere, and other points."""
    coordinates = np.array([[*given, 5.0], *([x, y, 5.0] for x, y in others)])
    places = np.array([[*fitting, 5.0], *([x, y, 5.0] for x, y in others)])
    points = SimpleNamespace(coordinates=coordinates, names=("K", *"ABC"[: len(others)]))
    evidence = SimpleNamespace(
        effects=SimpleNamespace(coordinates=places, notes=SimpleNamespace(points=points))
    )
    return SimpleNamespace(known=[(0, 0), (0, 1)]), evidence


@pytest.mark.parametrize(
    ("given", "fitting", "others", "wanted"),
    [
        ((200.0, 100.0), (100.0, 200.001), [], [("W123", "easting and northing are exchanged", True)]),
        ((200.0, 200.0), (200.001, 200.0), [(300.0, 0.0)], []),
        (
            (0.0, 300.0),
            (100.0, 200.0),
            [(0.002, 300.0), (9.0, 9.0)],
            [("W133", "these are the coordinates of A", True)],
        ),
        ((0.0, 300.0), (100.0, 200.0), [(0.0, 300.02), (9.0, 9.0)], []),
        (
            (0.0, 300.0),
            (100.0, 200.0),
            [(np.nan, np.nan), (0.0, 300.0)],
            [("W133", "these are the coordinates of B", True)],
        ),
        ((0.0, 300.0), (0.001, 300.0), [(9.0, 9.0)], []),  # it lies where it lies
    ],
)
def test_coordinates_are_exchanged_or_those_of_another_point(given, fitting, others, wanted):
    assert found(KNOWN_PLAN, [1.0, 1.0], [1e-3, 1e-3], *plans(given, fitting, others)) == wanted


AXES = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
"""A vector is not observed along east, north and up."""
PLACES = np.array([[0.0, 0.0, 0.0], [400.0, -300.0, 120.0], [395.0, -280.0, 118.0], [7.0, -30.0, 2.0]])


def vector(written, size, tolerance=0.01):
    """Slips of a vector from A to B, of components in axes of its own."""
    rows = SimpleNamespace(values=np.array(written), from_points=np.zeros(3, int), to_points=np.ones(3, int))
    book = SimpleNamespace(observations=rows, point_names="ABCD")
    effects = SimpleNamespace(
        notes=SimpleNamespace(book=book),
        coordinates=PLACES,
        axes=AXES,
        horizons=np.tile(np.eye(3), (4, 1, 1)),
        origins=np.zeros(3, int),
    )
    told = slips_of_vector(effects, np.arange(3), np.array(size), tolerance)
    return [(one.code, one.text) for one in told]


RIGHT = AXES @ PLACES[1]


@pytest.mark.parametrize(
    ("written", "wanted"),
    [
        (-RIGHT, [("W134", "its two ends are exchanged: turned round it fits")]),
        (1000.0 * RIGHT, [("W126", "millimetres read as metres")]),
        (100.0 * RIGHT, [("W127", "centimetres read as metres")]),
        (RIGHT / 0.3048, [("W106", "feet read as metres")]),
        (0.3048 * RIGHT, [("W107", "metres read as feet")]),
        (AXES @ PLACES[2], [("W118", "it goes to C")]),
        (AXES @ (PLACES[1] - PLACES[3]), [("W118", "it comes from D")]),
        (np.add(RIGHT, [0.3, 0.1, -0.2]), []),
        (AXES @ PLACES[2] + [0.02, 0.0, 0.0], []),  # near C, and not there
    ],
)
def test_a_vector_is_turned_round_of_another_unit_or_of_another_point(written, wanted):
    assert vector(written, written - RIGHT) == wanted


def test_of_a_vector_as_short_as_its_tolerance_neither_turn_nor_unit_is_told():
    assert vector(-RIGHT, -2.0 * RIGHT, tolerance=np.abs(RIGHT).max() / 21.0)
    assert not vector(-RIGHT, -2.0 * RIGHT, tolerance=np.abs(RIGHT).max() / 19.0)


def test_a_vector_must_fit_to_what_is_known_of_it():
    rows = SimpleNamespace(values=-RIGHT, from_points=np.zeros(3, int), to_points=np.ones(3, int))
    book = SimpleNamespace(observations=rows, point_names="ABCD")
    effects = SimpleNamespace(
        notes=SimpleNamespace(book=book),
        coordinates=PLACES,
        axes=AXES,
        horizons=np.tile(np.eye(3), (4, 1, 1)),
        origins=np.zeros(3, int),
    )
    named, evidence = SimpleNamespace(rows=np.arange(3)), SimpleNamespace(effects=effects)
    for off, told in ((0.029, ["W134"]), (0.032, [])):
        size = np.add(-2.0 * RIGHT, [0.0, off, 0.0])
        assert [code for code, _, _ in found(WHOLE_VECTOR.code, size, [0.01] * 3, named, evidence)] == told
