"""Parts of a network that nothing ties to its known points: left out with the true reason, no gross error."""

import re

import numpy as np
import pytest
from sketch import Sketch

from obseq.cli.main import main
from obseq.errors import SingularSystemError
from obseq.survey import Network

TIED = {"K1": (0, 0, 10), "K2": (200, 10, 12), "P": (90, 150, 8), "Q": (180, 120, 20)}
LOOSE = {"A": (1000, 500, 20), "B": (1150, 530, 25), "C": (1040, 640, 14), "D": (1190, 690, 30)}
ALL = TIED | LOOSE


def lines(folder, *parts, links=()):
    """Directions, zenith angles and distances inside each part, and distances between them."""
    sketch = Sketch(folder, **ALL)
    for part in parts:
        for station in part:
            others = [name for name in part if name != station]
            sketch.hz(station, *others, g0=0.3).zen(station, *others).dist(station, *others)
    for a, b in links:
        sketch.dist(a, b)
    return sketch.lines


def read(folder, written, off=0.3):
    """The network with approximate coordinates of all new points, some decimetres wrong."""
    shifts = np.random.default_rng(1).normal(0, off, (len(ALL), 3))
    rows = [f"1 {name} {x} {y} {z} 0.002" for name, (x, y, z) in list(TIED.items())[:2]]
    for (name, place), shift in zip(list(ALL.items())[2:], shifts, strict=False):
        x, y, z = (np.array(place) + shift).tolist()
        rows.append(f"0 {name} {x} {y} {z}")
    (folder / "p.cor").write_text("\n".join(rows) + "\n")
    (folder / "o.obs").write_text("\n".join(written) + "\n")
    return Network.read(folder / "o.obs", folder / "p.cor", refraction=1.0)  # straight lines over a plane


def adjusted_with_loose_part(folder, links):
    network = read(folder, lines(folder, TIED, LOOSE, links=links))
    adjustment = network.adjust()
    assert not adjustment.gross_errors
    assert sorted(item.name for item in adjustment.left_out) == list("ABCD")
    at = dict(zip(adjustment.points.names, adjustment.points.coordinates, strict=True))
    np.testing.assert_allclose([at["P"], at["Q"]], [TIED["P"], TIED["Q"]], rtol=0, atol=1e-4)
    return adjustment.left_out


def test_a_part_that_hangs_on_nothing_is_left_out_and_contradicts_nothing(tmp_path):
    for item in adjusted_with_loose_part(tmp_path, ()):
        assert item.reason == "not connected to any known point by a chain of observations"


@pytest.mark.parametrize("links", [[("P", "A")], [("P", "A"), ("Q", "B")]])
def test_a_part_tied_by_too_few_observations_says_what_it_may_do(tmp_path, links):
    for item in adjusted_with_loose_part(tmp_path, links):
        assert re.search(
            "nothing fixes the position along .* and the rotation about z of A, B, C, D", item.reason
        )


def test_a_gross_error_elsewhere_is_still_named(tmp_path):
    written = lines(tmp_path, TIED, LOOSE)
    row = next(k for k, line in enumerate(written) if line.startswith("3 P Q"))
    written[row] = "3 P Q 99.5 0.001"
    adjustment = read(tmp_path, written).adjust()
    (error,) = adjustment.gross_errors
    assert "P -> Q" in error.what
    assert len(adjustment.left_out) == 4


def test_a_strict_adjustment_names_what_is_loose(tmp_path):
    network = read(tmp_path, lines(tmp_path, TIED, LOOSE))
    with pytest.raises(
        SingularSystemError, match=r"nothing fixes the position along x, y, z .* of A, B, C, D"
    ):
        network.adjust(strict=True)


def test_stations_that_see_only_each_other_are_undetermined_together(tmp_path):
    sketch = Sketch(tmp_path, **ALL)
    for station in "ABC":
        sketch.hz(station, *[name for name in "ABC" if name != station])
    sketch.hz("A", "P")
    adjustment = read(tmp_path, lines(tmp_path, TIED) + sketch.lines).adjust()
    assert not adjustment.gross_errors
    assert {item.name for item in adjustment.left_out} >= set("ABC")


HELD_BY_ONE = {
    "turn": ("1 A 0 0 0 0.001\n0 B 100 0 0\n0 P 50 60 1\n", "azimuth (Azim, code 8), or another"),
    "heights": ("3 A 0 0 0 0.001\n0 B 100 0 0\n0 P 50 60 1\n", "Give a known point (flag 1"),
    "none": (
        "0 A 0 0 0\n0 B 100 0 0\n0 P 50 60 1\n",
        "Give at least one point of the point file as known",
    ),
}
OBSERVED = "3 A B 100 0.002\n3 A P 78.109 0.002\n3 B P 78.109 0.002\n4 A B 0 0.002\n4 A P 1 0.002\n"


@pytest.mark.parametrize(("points", "remedy"), HELD_BY_ONE.values(), ids=list(HELD_BY_ONE))
def test_what_moves_is_told_with_what_holds_it_and_no_word_of_the_library(tmp_path, capsys, points, remedy):
    (tmp_path / "n.cor").write_text(points)
    (tmp_path / "n.obs").write_text(OBSERVED)
    for strict in ([], ["--strict"]):
        paths = ["--obs", str(tmp_path / "n.obs"), "--cor", str(tmp_path / "n.cor")]
        assert main(["adjust", *paths, *strict]) == 2
        said = capsys.readouterr().err
        assert "the rotation about" in said
        assert remedy in said
        assert not re.search("unknown|freeze|prior|undetermined together", said)
