"""Sights in both faces of the telescope: folded into the first one, reduced to means, compared."""

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.survey import Network, network_from_tables

POINTS = "".join(
    f"1 {name} {x} {y} {z} 0.002\n"
    for name, x, y, z in (("A", 0, 0, 10), ("B", 200, 0, 14), ("C", 180, 150, 8))
)
DIRECTIONS = {"A": 226.0337, "B": 96.5170, "C": 20.3483}
ZENITHS = {"A": 101.5912, "B": 99.2883, "C": 102.1286}


def lines(turns=(), complements=()):
    """A free station; of some targets the direction, or the zenith angle, is read in the second face too."""
    for code, name in zip((7, 5, 5), DIRECTIONS, strict=True):
        yield f"{code} S {name} {DIRECTIONS[name]} 0.0008"
        yield f"6 S {name} {ZENITHS[name]} 0.0012 0 1.5 0"
    yield from (f"5 S {name} {(DIRECTIONS[name] + 200.0007) % 400.0:.4f} 0.0008" for name in turns)
    yield from (f"6 S {name} {400.0 - ZENITHS[name]:.4f} 0.0012 0 1.5 0" for name in complements)


def written(tmp_path, *given):
    (tmp_path / "s.cor").write_text(POINTS)
    (tmp_path / "s.obs").write_text("\n".join(lines(*given)) + "\n")
    return tmp_path / "s.obs", tmp_path / "s.cor"


@pytest.mark.parametrize("given", [("AB", ""), ("", "AC"), ("", "B"), ("ABC", "ABC")])
@pytest.mark.parametrize("faces", ["mean", "all"])
def test_sights_in_both_faces_give_what_the_first_one_gives(tmp_path, given, faces):
    alone = Network.read(*written(tmp_path)).adjust()
    network = Network.read(*written(tmp_path, *given), faces=faces)
    adjusted = network.adjust()
    assert not adjusted.gross_errors
    np.testing.assert_allclose(adjusted.points.coordinates, alone.points.coordinates, atol=1e-3)
    pairs = len(given[0]) + len(given[1])
    kept = int(network.book.observations.active.sum())
    assert kept == (6 if faces == "mean" else 6 + pairs)
    told = " ".join(network.book.warnings)
    assert f"{pairs} readings of the second face" in told and "s.obs:7" in told
    assert ("reduced to their means" in told) == (faces == "mean")


def test_means_and_errors_of_the_instrument(tmp_path):
    """Each second direction is 7 cc too large: the collimation error is half of it."""
    network = Network.read(*written(tmp_path, "ABC", "ABC"))
    rows = network.book.observations
    gon = np.pi / 200
    assert rows.values[0] == pytest.approx((226.0337 + 0.00035) * gon, abs=1e-12)
    assert rows.sigmas[0] == pytest.approx(0.0008 * gon / np.sqrt(2), rel=1e-12)
    assert rows.sigmas[1] == pytest.approx(0.0012 * gon / np.sqrt(2), rel=1e-12)
    told = " ".join(network.book.warnings)
    assert "collimation error from 3 pairs: -3.5 cc, sigma 0.0 cc" in told
    assert "index error from 3 pairs: +0.0 cc" in told or "index error from 3 pairs: -0.0 cc" in told


def test_a_pair_that_differs_is_named(tmp_path):
    obs, cor = written(tmp_path, "ABC")
    turned = (DIRECTIONS["C"] + 200.0007) % 400.0
    obs.write_text(obs.read_text().replace(f"5 S C {turned:.4f}", f"5 S C {turned + 0.02:.4f}"))
    told = " ".join(Network.read(obs, cor).book.warnings)
    assert "faces differ by more than their sigmas in" in told
    assert "Hz S -> C (" in told.partition("faces differ")[2].partition(",")[0]


def test_a_choice_that_is_none_is_refused(tmp_path):
    with pytest.raises(InputError, match="'both' is neither 'mean'"):
        Network.read(*written(tmp_path, "ABC"), faces="both")


def test_one_slip_is_left_to_the_search_of_gross_errors(tmp_path):
    obs, cor = written(tmp_path, "B")
    assert "Hz" in Network.read(obs, cor).adjust().gross_errors[0].what


def test_sights_near_the_vertical_and_other_set_ups_are_no_second_face(tmp_path):
    obs, cor = written(tmp_path)
    turned = [
        f"{code} S {name} {DIRECTIONS[name] - 200} 0.001" for code, name in zip((7, 5), "AB", strict=True)
    ]
    plumb = ["6 S Z 0.0021 0.01", "6 S Z -0.0018 0.01", "6 S N 199.9985 0.01", "6 S N 200.0013 0.01"]
    obs.write_text(obs.read_text() + "\n".join([*turned, *plumb]) + "\n")
    assert len(Network.read(obs, cor).book.observations) == 12


@pytest.mark.parametrize(("written_as", "kept"), [(-3.5, -3.5), (-49.0, -49.0), (-51.0, 51.0), (-0.4, 0.4)])
def test_an_elevation_below_the_horizon_is_no_second_face(tmp_path, written_as, kept):
    """-96 gon is the second face of 96, -0.4 one of a plumb sight; -3.5 would be a sight into the sky."""
    obs, cor = written(tmp_path)
    obs.write_text(obs.read_text().replace("6 S A 101.5912", f"6 S A {written_as}"))
    values = Network.read(obs, cor).book.observations.values
    assert values[1] == pytest.approx(kept * np.pi / 200, abs=1e-12)


def test_beside_elevations_one_that_is_nearly_level_keeps_its_sign_too(tmp_path):
    obs, cor = written(tmp_path)
    text = obs.read_text().replace("6 S A 101.5912", "6 S A -3.5")
    second = next(line for line in text.splitlines() if line.startswith("6 S B"))
    obs.write_text(text.replace(second, " ".join([*second.split()[:3], "-0.4", *second.split()[4:]])))
    found = Network.read(obs, cor).book.observations.values * 200 / np.pi
    assert {-3.5, -0.4} <= set(np.round(found, 9).tolist())


def test_tables_and_files_of_other_programs_are_looked_at_too():
    known = {"name": ["A", "B", "C"], "x": [0, 200, 180], "y": [0, 0, 150], "z": [10, 14, 8]}
    rows = {"type": ["Hz"] * 4, "from": ["S"] * 4, "to": ["A", "B", "A", "B"], "sigma": [1e-5] * 4}
    values = {"value": [0.1, 1.2, 0.1 + 3.14159, 1.2 + 3.14159]}
    network = network_from_tables(known, rows | values)
    assert network.book.observations.active.tolist() == [True, True, False, False]
    assert "2 pairs of directions are reduced to their means" in " ".join(network.book.warnings)


def test_the_face_of_a_direction_is_that_of_the_zenith_angle_on_its_line(tmp_path):
    """C is sighted in the second face only; of D the zenith angle takes no part, and says the face."""
    (tmp_path / "f.dat").write_text(
        ".UNITS METERS\n.3D\nC A 0 0 0 ! ! !\nC B 100 0 0 ! ! !\nDB A\nDM B 0-00-00 100 90-00-00\n"
        "DM C 270-00-00 50 270-00-00\nDM D 225-00-00 50 270-00-00 & & *\nV A-D 90-00-00\nDE\n"
    )
    sigmas = ["direction=1sec", "distance=1mm", "zenith=1sec"]
    found = Network.read_project(tmp_path / "f.dat", sigmas=sigmas, refraction=1.0).adjust().record()
    places = {point.name: (point.x, point.y) for point in found.points}
    assert places["C"] == pytest.approx((50.0, 0.0), abs=1e-9)
    assert places["D"] == pytest.approx((50 * np.sqrt(0.5), 50 * np.sqrt(0.5)), abs=1e-9)
