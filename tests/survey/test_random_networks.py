"""Random mixed networks come out as an independent adjuster says, to 1e-3 standard deviations.

The referee itself gives what MMVII and its documentation give.
"""

from pathlib import Path

import numpy as np
import pytest
from referee.adjusted import adjust
from referee.earth import System, tangent
from referee.generated_networks import case, held_case
from referee.judged import judge
from referee.network import Network as Given
from referee.network import Observation, Point, Setup

from obseq.survey import Network

SEEDS = (6, 7, 11, 12, 13, 14, 18, 24, 25, 30, 42, 49, 62, 66, 686, 1102, 1201, 1528, 1817)
"""Of `tools/benchmarks/bench_independent.py`, which does thousands: of all dialects of files and places."""

FREE = (304, 784, 1505, 1782, 42553)
"""Free networks: a refraction of 18 +- 29, weak motions of kilometres and millimetres, tilted instruments,
a latitude whose last digit is worth a millionth of a sigma."""


HELD = (20177, 20396)
"""Free networks with coordinates held along slanting axes, of which height differences see nearly nothing."""


@pytest.mark.parametrize("seed", [*SEEDS, *FREE, *HELD])
def test_a_network_agrees_with_the_referee(tmp_path, seed):
    verdict = judge((held_case if seed in HELD else case)(seed), tmp_path)
    assert verdict is not None
    assert (verdict.said, verdict.accused) == ("", "")
    assert verdict.worst() <= 1.0, verdict
    assert verdict.more <= 3


def test_stations_that_a_search_for_errors_has_placed_stand_upright(tmp_path):
    """With deflections; first values of this network are doubtful: the adjustment begins elsewhere."""
    verdict = judge(case(197), tmp_path)
    assert verdict.said == ""
    assert verdict.worst() <= 1.0, verdict


def test_the_referee_uses_nothing_of_what_it_judges():
    folder = Path(__file__).parents[1] / "referee"
    users = {path.name for path in folder.glob("*.py") if "obseq" in path.read_text("utf-8")}
    assert users == {"judged.py", "judged_blocks.py"}  # the boundary


def test_the_referee_gives_the_numbers_of_mmvii():
    frame = tangent(45.0, 0.0, 0.0)
    places = {"Ori1": (100, 110, 100), "St1": (100, 100, 100), "Tr1": (107.071, 107.071, 99.9998)}
    sigmas = {"Ori1": 0.001, "St1": 0.001, "Tr1": np.nan}
    points = [
        Point(name, np.array(xyz, float), np.array(xyz, float), np.full(3, sigmas[name]))
        for name, xyz in places.items()
    ]
    read = [("Hz", "Ori1", -2.2, 1e-4), ("Hz", "Tr1", np.pi / 4 - 2.2, 1e-4), ("Zen", "Tr1", np.pi / 2, 1e-4)]
    read += [("Dist", "Tr1", 10.0, 1e-3), ("Dist", "Tr1", 10.002, 1e-3), ("DH", "Tr1", 2e-4, 1e-4)]
    observations = [
        Observation(kind, "St1", to, value, sigma, setup=0 if kind in ("Hz", "Zen") else -1)
        for kind, to, value, sigma in read
    ]
    setups = [Setup("St1", "VERT")]
    found = adjust(Given(frame, System(frame.definition, frame), points, observations, setups))
    assert found.sigma0 == pytest.approx(1.0091833, abs=2e-7)  # MMVII's derivatives hold the vertical
    assert found.xyz[2] == pytest.approx([107.07177492, 107.07177492, 99.99996773], abs=2e-8)
    assert found.residuals[:6] == pytest.approx([6e-11, -6e-11, -1.9115e-5, 1e-3, -1e-3, -1.91e-6], abs=5e-9)


@pytest.mark.parametrize(
    ("case", "files"),
    [
        ("trilateration", ("t.obs", "t.cor")),
        ("centring-zero", ("centring.obs", "centring.cor")),
        ("centring-zero", ("reverse.obs", "centring.cor")),
    ],
)
def test_field_cases_are_placed_and_adjusted(shared_data, case, files):
    paths = [shared_data / "field-cases" / case / name for name in files]
    adjustment = Network.read(*paths, frame="RTL*2.4*48.8*0*EPSG:4326").adjust()
    assert adjustment.converged
    assert (adjustment.left_out, adjustment.gross_errors, adjustment.replaced) == ((), (), ())


@pytest.mark.parametrize("frame", ["RTL*657700*6860700*0*IGNF:LAMB93", "RTL"])
def test_the_field_case_of_a_bad_approximation(shared_data, frame):
    folder = shared_data / "field-cases" / "bad-approximation"
    adjustment = Network.read(folder / "demo.obs", folder / "demo.cor", frame, "IGNF:LAMB93").adjust()
    assert [item.name for item in adjustment.replaced] == ["PtB"]
    assert adjustment.sigma0 == pytest.approx(1.76552, abs=5e-6)


def test_heights_of_instrument_and_target_count_for_horizontal_distances(tmp_path):
    """The target's plumb line leans 1 km / 6378 km towards it: 2 m above the mark it is 0.31 mm farther."""
    lines = "type,from,to,value,sigma,from_height,to_height\nDistHz,A,B,1000,0.001,{0},{0}\n"
    lines += "Azim,A,B,100,0.001,,\nZen,A,B,100,0.001,,\n"
    (tmp_path / "p.csv").write_text("name,x,y,z,sx,sy,sz\nA,0,0,0,0,0,0\nB,1000,0,0,,,\n")
    found = []
    for height in (0, 2):
        (tmp_path / "o.csv").write_text(lines.format(height))
        network = Network.read_project(
            [tmp_path / "p.csv", tmp_path / "o.csv"], frame="RTL*2.4*0*0*EPSG:4326"
        )
        found.append(network.adjust().points.coordinates[1, 0])
    assert found[0] - found[1] == pytest.approx(2.0 * 1000.0 / 6378137.0, rel=1e-3)
