"""A sigma out of line with those of its kind is named where it decides what is said of its observation."""

import pytest

from obseq.survey import network_from_tables

RISES = [("A", "P", 1.5004), ("P", "Q", 1.6993), ("Q", "B", -1.2002), ("B", "R", -2.7003), ("R", "A", 0.7003)]
RISES += [("P", "B", 0.5005), ("P", "R", -2.1995)]


def notes(off: float, sigma: float) -> list[str]:
    """What is said of the sigmas of a levelling whose last line is off and has a sigma of its own (m)."""
    points = {"name": ["A", "B", "P", "Q", "R"], "x": [0.0] * 5, "y": [0.0] * 5, "z": [100.0] + [None] * 4}
    points |= {"sx": [0.0] * 5, "sy": [0.0] * 5, "sz": [0.0] + [None] * 4}
    begin, end, values = zip(*RISES, strict=True)
    rows = {"type": ["DH"] * 7, "from": begin, "to": end, "value": [*values[:-1], values[-1] + off]}
    adjustment = network_from_tables(points, rows | {"sigma": [0.001] * 6 + [sigma]}).adjust()
    return [text for text in adjustment.notes if text.startswith("the sigma of ")]


@pytest.mark.parametrize(
    ("off", "sigma", "words"),
    [
        (0.1, 1.0, ("1000 times larger", "hides a misfit of 100.9", "101 times the usual one")),
        (-0.009, 1e-6, ("1000 times smaller", "lets the tests reject a misfit of -8.0", "DH P -> R")),
    ],
)
def test_a_sigma_that_decides_is_named(off, sigma, words):
    (said,) = notes(off, sigma)
    assert all(word in said for word in words) and "usual one of DH observations (1.00 mm)" in said


@pytest.mark.parametrize(("off", "sigma"), [(0.0, 1.0), (0.0, 1e-6), (0.1, 0.02), (0.1, 0.001), (10.0, 1.0)])
def test_a_sigma_is_not_named_where_nothing_depends_on_it_or_the_tests_see_the_error(off, sigma):
    assert notes(off, sigma) == []
