import math
import re
import xml.etree.ElementTree as ElementTree

import pytest

from obseq.report.figure import ellipse, network_figure


def circles(svg: str) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in re.findall(r'cx="([-\d.]+)" cy="([-\d.]+)"', svg)]


def test_east_is_right_and_north_is_up(record) -> None:
    b, c = circles(network_figure(record))  # A is a station and has another mark
    assert b[0] > c[0]  # B lies 60 m east of C
    assert b[1] > c[1]  # and 40 m south: lower in the figure


def test_it_is_valid_xml_with_one_line_per_pair_of_points(record) -> None:
    root = ElementTree.fromstring(network_figure(record))
    sights = next(path for path in root.iter("path") if path.get("class") == "sight")
    assert sights.get("d", "").count("M") == 2  # A-B twice observed, A-C; the unused one adds nothing


def test_ellipse_of_a_precision_along_the_first_diagonal() -> None:
    # variances 5 and 1 along x = y and across: xx = yy = 3, xy = 2
    major, minor, angle = ellipse(3.0, 2.0, 3.0)
    assert (major, minor, angle) == pytest.approx((math.sqrt(5.0), 1.0, math.pi / 4))


def test_ellipse_of_equal_precisions_is_a_circle() -> None:
    assert ellipse(4.0, 0.0, 4.0)[:2] == (2.0, 2.0)


def test_an_ellipse_is_turned_against_the_downward_axis_of_the_figure(record) -> None:
    record["points"][1]["covariance"] = [3e-6, 2e-6, 0.0, 3e-6, 0.0, 1e-6]
    assert "rotate(-45.00)" in network_figure(record)


def test_points_at_one_place_are_drawn(record) -> None:
    for point in record["points"]:
        point |= {"x": 5.0, "y": 5.0, "sx": None, "sy": None}
    assert "nan" not in network_figure(record)


def test_names_do_not_cover_each_other_and_stations_come_first(record) -> None:
    record["points"] = [record["points"][0] | {"name": f"P{k}", "x": k * 1e-4} for k in range(20)] + record[
        "points"
    ]
    named = re.findall(r"<text [^>]*>(\w+)</text>", network_figure(record))
    assert named == ["A", "B", "C"]


def test_a_name_stays_inside_the_figure(record) -> None:
    record["points"][1]["name"] = "a_very_long_name"
    (left,) = re.findall(r'<text x="([\d.]+)"[^>]*>a_very_long_name', network_figure(record))
    assert float(left) + 16 * 7.5 < 900
