import math
import re
import xml.etree.ElementTree as ElementTree

from obseq.report.notebook import network_figure


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


def test_an_ellipse_is_turned_against_the_downward_axis_of_the_figure(plain, make) -> None:
    # the major axis points 30 degrees from north towards east: 60 degrees above the x axis of the figure
    plain["points"][1]["ellipse"] = {"semi_major": 2e-3, "semi_minor": 1e-3, "bearing": math.pi / 6}
    assert "rotate(-60.00)" in network_figure(make())


def test_points_at_one_place_are_drawn(plain, make) -> None:
    for point in plain["points"]:
        point |= {"x": 5.0, "y": 5.0, "sx": None, "sy": None}
    assert "nan" not in network_figure(make())


def test_names_do_not_cover_each_other_and_stations_come_first(plain, make) -> None:
    plain["points"] = [plain["points"][0] | {"name": f"P{k}", "x": k * 1e-4} for k in range(20)] + plain[
        "points"
    ]
    named = re.findall(r"<text [^>]*>(\w+)</text>", network_figure(make()))
    assert named == ["A", "B", "C"]


def test_a_name_stays_inside_the_figure(plain, make) -> None:
    plain["points"][1]["name"] = "a_very_long_name"
    (left,) = re.findall(r'<text x="([\d.]+)"[^>]*>a_very_long_name', network_figure(make()))
    assert float(left) + 16 * 7.5 < 900
