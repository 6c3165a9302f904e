"""Approximate coordinates that are far off do not spoil a network."""

from importlib.resources import files

import numpy as np
import pytest

from obseq.survey import Network

LAMBERT = "IGNF:LAMB93"
FRAME = f"RTL*657700*6860700*0*{LAMBERT}"
DEMO = files("obseq.survey") / "data"
WRONG = {
    "28 m": "657690 6860720 10",
    "zero": "0 0 0",
    "easting and northing swapped": "6860700 657710 10",
    "a digit": "657710 6960700 10",
    "kilometres": "657.710 6860.700 0.010",
    "height": "657710 6860700 1000",
    "one of the other points": "657700 6860690 10",
}


def adjusted(folder, points, frame=FRAME):
    (folder / "net.cor").write_text(points)
    return Network.read(str(DEMO / "demo.obs"), folder / "net.cor", frame, LAMBERT).adjust()


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    return adjusted(tmp_path_factory.mktemp("demo"), (DEMO / "demo.cor").read_text())


@pytest.mark.parametrize("frame", [FRAME, "RTL"])
@pytest.mark.parametrize("cause", WRONG)
def test_a_wrong_approximation_does_not_spoil_the_network(tmp_path, demo, cause, frame):
    points = (DEMO / "demo.cor").read_text().replace("657710     6860700     10", WRONG[cause])
    found = adjusted(tmp_path, points, frame)
    assert found.converged
    assert len(found.solution.iterations) <= 5
    np.testing.assert_allclose(found.points.crs_coordinates, demo.points.crs_coordinates, rtol=0, atol=1e-6)
    assert found.sigma0 == pytest.approx(demo.sigma0, rel=1e-6)
    assert [item.name for item in found.replaced] == ["PtB"]
    assert any("point PtB" in text and "were replaced" in text for text in found.warnings)
    given = [float(word) for word in WRONG[cause].split()]
    np.testing.assert_allclose(found.to_dict()["replaced"][0]["given"], given, atol=1e-3)


def test_all_approximations_wrong(tmp_path, demo):
    points = (DEMO / "demo.cor").read_text()
    points = points.replace("657710     6860700     10", "1 2 3").replace(
        "657710     6860710     10", "0 0 0"
    )
    found = adjusted(tmp_path, points)
    np.testing.assert_allclose(found.points.crs_coordinates, demo.points.crs_coordinates, rtol=0, atol=1e-6)
    assert [item.name for item in found.replaced] == ["PtB", "PtC"]


def test_places_that_stand_for_nothing_are_one_warning(tmp_path):
    points = (DEMO / "demo.cor").read_text()
    for place in ("657710     6860700     10", "657710     6860710     10"):
        points = points.replace(place, "0 0 0")
    found = adjusted(tmp_path, points)
    said = [text for text in found.warnings if "approximate coordinates" in text]
    assert len(found.replaced) == 2
    assert [text.partition(", up")[0] for text in said] == [
        "2 points have the same approximate coordinates (0.000, 0.000, 0.000)"
    ]
    assert "PtB (" in said[0] and "PtC (" in said[0]


def test_good_approximations_are_kept(demo):
    assert demo.replaced == ()
    assert demo.solution.iterations[0].sigma0 == pytest.approx(5443.8677, rel=1e-6)


def test_a_wrong_observation_does_not_throw_a_good_approximation_away(tmp_path, demo):
    (tmp_path / "net.obs").write_text((DEMO / "demo.obs").read_text().replace(" 10.05 ", " 100.5 "))
    network = Network.read(tmp_path / "net.obs", str(DEMO / "demo.cor"), FRAME, LAMBERT)
    assert network.initial_values().replaced == ()


def test_the_origin_of_a_frame_stays_among_the_points(tmp_path):
    points = (DEMO / "demo.cor").read_text().replace("657710     6860700     10", "0 0 0")
    assert adjusted(tmp_path, points, "RTL").frame.startswith("RTL*65770")
