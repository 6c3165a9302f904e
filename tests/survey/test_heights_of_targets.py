"""A wrong height of the target in one sight; and what all distances of a traverse may have in common."""

import pytest
from set_ups import Site, free_stations, traverse

from obseq.survey.screening.findings import Cause


def test_a_zenith_angle_and_a_distance_that_one_height_explains(tmp_path):
    """C4 is 21 m higher than F1 and 25 m off: 2 m more change the distance by 1.3 m."""
    places = free_stations().places | {"C4": (20.0, 55.0, 22.0)}
    seen = ("C0", "C1", "C2", "C4")
    site = Site(places, {"F1": seen, "F2": seen}, seen)
    assert site.errors(tmp_path) == []
    lines = site.change(lambda line: {"prism": line.prism + 2.0}, "63", origin=("F1",), target=("C4",))
    ((error, told),) = site.errors(tmp_path)
    assert error.cause is Cause.HEIGHT and told == lines
    right = next(line.prism for k, line in enumerate(site.lines) if k + 1 in lines) - 2.0
    assert f"{right + 2.0:.4f} m is written, {right:.3f}"[:-1] in error.text


def test_a_zenith_angle_alone_may_be_one(tmp_path):
    """The sight is nearly level: a height does nothing to its distance."""
    site = free_stations()
    (line,) = site.change(lambda line: {"value": line.value + 0.30721}, "6", origin=("F2",), target=("C1",))
    ((error, told),) = site.errors(tmp_path)
    assert told == {line}
    assert "no usual slip explains it, unless the height of the target is wrong" in error.text
    assert error.text.endswith(" fits")


@pytest.mark.parametrize("change", [lambda length: length * 1.0004, lambda length: length + 0.066])
def test_scale_and_constant_are_told_where_both_explain_all_distances(change, tmp_path):
    """All legs of the traverse are 150 m to 190 m long."""
    site = traverse()
    site.change(lambda line: {"value": change(line.value)}, "3")
    ((error, _),) = site.errors(tmp_path)
    assert error.cause is Cause.DISTANCES and error.text.endswith("nothing tells these apart")
    assert "a constant added to all of them fits" in error.text and "one scale for all of them" in error.text
