"""The exercises of MMVII's training for developers ("Direct Dev"), as commands on a project.

Image centres and stations that are cameras are in `tests/images/test_survey.py`.
"""

from pathlib import Path

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.formulas import formula
from obseq.project import read_control_points, read_topo
from obseq.project.networks import network_of
from obseq.survey import Network, make_points

TREE = Path("MMVII-PhgrProj")
SQUARE = "1 A 90 110 100\n1 B 90 90 100\n1 C 110 90 100\n"
RESECTION = """#VERT
5 S A 0 0.001
5 S B 300 0.001
5 S C 200 0.001
6 S A 100 0.001
6 S B 100 0.001
6 S C 100 0.001
3 S A 14.140 0.005
5 S D 100 0.001
6 S D 100 0.001
3 S D 14.140 0.005
"""


@pytest.fixture
def project(tmp_path, monkeypatch, capsys):
    """Makes a project of a COR and an OBS text, adjusts it, and gives the adjusted points by name."""
    monkeypatch.chdir(tmp_path)

    def adjusted(cor: str, obs: str, *options: str, system: str = "LocalTest") -> dict[str, np.ndarray]:
        Path("in.cor").write_text(cor, encoding="utf-8")
        Path("in.obs").write_text(obs, encoding="utf-8")
        words = ["ImportGCP", "in.cor", "ANXYZ", "In", f"ChSys=[{system}]", "Sigma=0.001", "AddInfoFree=0"]
        assert main(["mmvii", *words]) == 0
        assert main(["mmvii", "ImportOBS", "in.obs", "Field"]) == 0
        code = main(["mmvii", "TopoAdj", "Field", "In", "Out", "New", *options])
        assert code in (0, 1), capsys.readouterr().err
        found = read_control_points(TREE / "PointsMeasure" / "New")
        return dict(zip(found.names, found.coordinates, strict=True))

    return adjusted


def test_a_station_is_found_by_resection(project) -> None:
    found = project(SQUARE, RESECTION)
    # half the diagonal of a square of 20 m: 14.142
    np.testing.assert_allclose(found["S"], [100, 100, 100], atol=0.003)
    np.testing.assert_allclose(found["D"], [110, 110, 100], atol=0.006)


def test_three_directions_alone_place_a_station(project) -> None:
    angles = "".join(line + "\n" for line in RESECTION.splitlines() if line[0] in "#56" and " D " not in line)
    np.testing.assert_allclose(project(SQUARE, angles)["S"], [100, 100, 100], atol=0.003)


def test_a_station_is_found_by_its_centring(project) -> None:
    """S is plumb over the mark M, 1.5 m above it: codes 14 and 15 of zero after `#FIX`."""
    obs = "#FIX\n14 M S 0 0.0005\n15 M S 0 0.0005\n16 M S 1.5 0.0005\n#VERT\n5 S A 0 0.001\n5 S B 300 0.001\n"
    obs += "5 S T 50 0.001\n6 S T 90 0.001\n3 S T 10 0.001\n"
    found = project(SQUARE + "1 M 100 100 98.5\n", obs)
    np.testing.assert_allclose(found["S"], [100, 100, 100], atol=0.002)
    # T: halfway of A and the direction of A plus 100 gon, straight on: azimuth 350 + 50 gon, zenith 90 gon
    height = 100 + 10 * np.cos(np.pi * 90 / 200)
    assert found["T"][0] == pytest.approx(100, abs=0.01) and found["T"][2] == pytest.approx(height, abs=0.01)


def test_a_frame_that_is_turned_anyhow_is_found(project) -> None:
    """`#BASC`: the axes of S are turned by 100 gon about z, from three points by codes 14 to 16."""
    rng = np.random.default_rng(1)
    at = {"A": [90, 110, 100], "B": [90, 90, 100], "C": [110, 90, 100], "D": [103, 108, 104]}
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    lines = ["#BASC"]
    for name, place in at.items():
        own = turn.T @ (np.array(place) - [100, 100, 100]) + rng.normal(0, 2e-4, 3)
        lines += [f"{14 + k} S {name} {own[k]:.5f} 0.0005" for k in range(3)]
    found = project(SQUARE, "\n".join(lines) + "\n")
    np.testing.assert_allclose(found["S"], [100, 100, 100], atol=0.003)
    np.testing.assert_allclose(found["D"], at["D"], atol=0.003)


def test_distances_and_height_differences_need_no_station(project) -> None:
    cor = SQUARE + "0 P 99 101 99\n"
    obs = "3 A P 14.1421356 0.001\n3 B P 14.1421356 0.001\n4 C P 0.0 0.001\n3 C P 14.1421356 0.001\n"
    found = project(cor, obs)
    np.testing.assert_allclose(found["P"], [100, 100, 100], atol=0.002)


def test_a_height_difference_is_that_above_the_ellipsoid() -> None:
    """Code 4: 1 km to the east and 100 m up of a place on the equator, whose radius is a: d^2 / 2R more."""
    height, radius = formula("TopoDH"), 6378137.0
    given = dict.fromkeys(height.observations, 0.0)
    given |= {f"RTL2Geoc_R_{k}_{k}": 1.0 for k in range(3)} | {"RTL2Geoc_T_x": radius}
    given |= {name: value for name, value in (("a", radius), ("e2", 0.00669438)) if name in given}
    assert sum(value != 0.0 for value in given.values()) == 6
    (difference,) = height.evaluate([0.0, 0.0, 0.0, 100.0, 1000.0, 0.0], list(given.values()))
    assert difference == pytest.approx(100.0 + 1000.0**2 / (2 * (radius + 100)), abs=1e-4)


def test_refraction_is_a_parameter_of_the_commands(project) -> None:
    """A sight of 2 km: k of 0 or of 1 differ by d / 2R of its zenith angle, 31 cm of height."""
    cor = "1 A 0 0 100\n1 B 0 -1000 100\n"
    obs = "#VERT\n5 A B 200 0.001\n5 A P 0 0.001\n6 A P 100 0.0005\n3 A P 2000 0.002\n"
    heights = [project(cor, obs, f"TopoRefr={k}")["P"][2] for k in (0, 1)]
    assert heights[0] - heights[1] == pytest.approx(2000.0**2 / (2 * 6378137), rel=0.02)


def test_the_survey_is_weighted(tmp_path) -> None:
    points = make_points(["A"], [[0.0, 0.0, 0.0]], [[0.001] * 3])
    (tmp_path / "a.obs").write_text("3 A B 10 0.004\n", encoding="utf-8")
    book = read_topo(tmp_path)
    plain, heavy = (network_of(points, book, "LocalTest", weight=weight) for weight in (1.0, 16.0))
    assert isinstance(heavy, Network)
    assert plain.book.observations.sigmas[0] == 0.004
    assert heavy.book.observations.sigmas[0] == pytest.approx(0.001)


@pytest.mark.parametrize("option", ["TopoW=0", "TopoW=2"])
def test_a_weight_without_a_survey_is_refused(option, capsys, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["OriBundleAdj", ".*", "A", "B", "GCPDir=G", "GCPW=[1,1]", option]
    assert main(["mmvii", *words]) == 2
    assert "TopoW is above zero, and goes with TopoDirIn" in capsys.readouterr().err
