"""One direction that is half a turn off is named wherever it stands, and snooping leaves out nothing else."""

import math
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from obseq.survey import Network, Quality
from obseq.survey.screening.findings import Cause


def demo(lines: list[str], folder: Path) -> Network:
    path = folder / "demo.obs"
    path.write_text("\n".join(lines))
    known = files("obseq.survey") / "data" / "demo.cor"
    return Network.read(str(path), str(known), points_crs="IGNF:LAMB93")


def slipped(lines: list[str], number: int) -> list[str]:
    """Lines of a file of observations, the direction of one of them (from 1) half a turn off."""
    words = lines[number - 1].split()
    words[3] = f"{(float(words[3]) + 200.0) % 400.0:.5f}"
    return [*lines[: number - 1], " ".join(words), *lines[number:]]


@pytest.mark.parametrize("number", [3, 13])
def test_in_a_network_of_four_points_it_is_no_scale_of_the_known_points(tmp_path, number):
    """A scale of 0.538 explains as much there, once directions are believed."""
    lines = (files("obseq.survey") / "data" / "demo.obs").read_text().splitlines()
    (error,) = demo(slipped(lines, number), tmp_path).gross_errors()
    assert error.cause is Cause.SENSE and "200 gon off" in error.text
    assert f"demo.obs:{number})" in error.what + error.text


@pytest.fixture
def figure(shared_data, tmp_path):
    """comp3d-figure with the direction of one line half a turn off."""
    folder = shared_data / "comp3d-figure"
    lines = (folder / "figure.obs").read_text(encoding="latin-1").splitlines()

    def made(number: int) -> Network:
        path = tmp_path / "figure.obs"
        path.write_text("\n".join(slipped(lines, number)))
        return Network.read(str(path), str(folder / "figure.cor"))

    return made


@pytest.mark.parametrize("number", [33])
def test_among_many_it_is_the_one_finding(figure, number):
    """Initial values follow it there, and eight right observations of its target contradict it."""
    (error,) = figure(number).gross_errors()
    assert error.what.endswith(f"figure.obs:{number})") and len(error.rows) == 1
    assert "likely: 200 gon off" in error.text


@pytest.mark.parametrize("number", [306])
def test_snooping_leaves_it_out_and_nothing_else(figure, number):
    """With it iterations end far off or nowhere: five right observations were left out instead."""
    adjustment = figure(number).adjust(quality=Quality(snooping="w"))
    (rejection,) = adjustment.record().snooping.rejections
    assert rejection.observation.endswith(f"figure.obs:{number})")
    assert abs(rejection.blunder) == pytest.approx(np.pi, abs=1e-4)
    assert abs(rejection.statistic) > 1e5 and rejection.p_value < 1e-9
    assert adjustment.solution.converged and adjustment.sigma0 == pytest.approx(0.8979, abs=2e-4)


def test_a_zenith_angle_of_a_side_shot_in_the_other_face(tmp_path):
    """The distance was said to have no length that fits, or to be off by tens of thousands of kilometres."""
    lines = (files("obseq.survey") / "data" / "demo.obs").read_text().splitlines()
    lines[8:8] = ["5 PtA PtX 20.0 0.001", "6 PtA PtX 304.21151 0.001", "3 PtA PtX 12.5 0.005"]
    network = demo(lines, tmp_path)
    assert not network.gross_errors()
    row = network.book.observations.values.tolist().index(pytest.approx(95.78849 * math.pi / 200, abs=1e-12))
    assert network.book.label(row).startswith("Zen PtA -> PtX")
    assert "1 readings of the second face are folded into the first one" in " ".join(network.book.warnings)
