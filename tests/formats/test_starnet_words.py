"""What lines of STAR*NET say, and what they are refused for, in words that say how they were read."""

import math

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.survey import Network

SITE = """
.UNITS Meters DMS
.ORDER EN
.3D
C A 0 0 10 ! ! !
C B 100 0 10 ! ! !
C P 60 80 10
"""


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("B A-P 393-41-23 3.0", r"n\.dat:8: the angle 393-41-23 is beyond one turn"),
        ("B A-P 33.689774 3.0", r"the angle 33\.689774: .* \(it is read as packed ddd\.mmss\)"),
        ("L A-P 4.052 0.01", r"--sigmas height-per-km.* \(0\.01 is read as the length of the line\)"),
    ],
)
def test_a_line_that_cannot_be_used_says_how_it_was_read(tmp_path, line, message):
    (tmp_path / "n.dat").write_text(f"{SITE}{line}\n")
    with pytest.raises(InputError, match=message):
        Network.read_project(tmp_path / "n.dat")


def test_side_shots_without_standard_errors_change_nothing_else(tmp_path):
    """Those of a class of instruments are told, unless something better is said; other lines need theirs."""
    head = ".3D\n.UNITS Meters DMS\nC A 0 0 0 ! ! !\nC B 100 0 0 ! ! !\nC P 30 40 0\n"
    path = tmp_path / "n.dat"
    path.write_text(f"{head}D A-P 50 .01\nSS A-B-S 90 20 90\n")
    network = Network.read_project(path)
    second = np.pi / 648_000
    wanted = [10 * second, 2e-3, 5 * 2**0.5 * second]
    np.testing.assert_allclose(network.book.observations.sigmas[1:], wanted)
    assert "1 side shots have no standard errors" in " ".join(network.book.warnings)
    given = Network.read_project(path, sigmas=["distance=7mm", "angle=1sec", "zenith=1sec"])
    assert given.book.observations.sigmas[2] == 7e-3
    path.write_text(f"{head}D A-P 50\n")
    with pytest.raises(InputError, match="--sigmas"):
        Network.read_project(path)


def test_a_negative_angle_is_the_rest_of_a_turn(tmp_path):
    (tmp_path / "n.dat").write_text(f"{SITE}A A-P-B -53-07-48.4 5\n")
    book = Network.read_project(tmp_path / "n.dat", sigmas=["angle=5sec"]).book
    wanted = 2.0 * math.pi - math.atan2(80.0, 60.0)
    assert book.observations.values.tolist() == [pytest.approx(wanted, abs=1e-6)]
