"""Two epochs: displacements, their covariance, and tests at the stated level."""

import csv
import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from planned import NAMES, PLACES, network, observation_text, point_text

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.report.compared import outcome
from obseq.report.summary import listing
from obseq.survey import Network, compare, simulate
from obseq.survey.epochs.congruence import relative_to, similarities
from obseq.survey.epochs.displacements import displacements
from obseq.survey.planning.simulation import Simulation

SHIFT = np.array([0.006, -0.004, 0.003])


def drawn_pair(simulation, seed, moved=None):
    """Two epochs with the same known coordinates, in error by the same, and one point moved."""
    rng = np.random.default_rng(seed)
    first = simulation.drawn(rng)
    later = simulation if moved is None else moved
    second = replace(later.drawn(rng), points=replace(first.points, coordinates=first.points.coordinates))
    return first.adjust(start=simulation.truth), second.adjust(start=later.truth)


def moved_simulation(planned, name):
    places = planned.points.coordinates.copy()
    places[planned.points.index[name]] += SHIFT
    return Simulation(replace(planned, points=replace(planned.points, coordinates=places)))


@pytest.fixture(scope="module")
def unmoved_pair(tmp_path_factory):
    """Two epochs of the same points, by their seed; drawn and adjusted once."""
    simulation = Simulation(network(tmp_path_factory.mktemp("unmoved")))
    return cache(lambda seed: drawn_pair(simulation, seed))


def test_covariances_of_displacements_are_those_of_drawn_ones(unmoved_pair):
    pairs = [displacements(*unmoved_pair(seed), NAMES) for seed in range(30)]
    vectors = np.array([pair.vectors.ravel() for pair in pairs])
    predicted = pairs[0].cofactors
    known = np.diag(predicted) > 1e-12
    ratio = (vectors**2).mean(axis=0)[known] / np.diag(predicted)[known]
    assert abs(ratio.mean() - 1.0) < 0.25
    assert (ratio < 2.0).all()
    both = np.ix_(known, known)
    whitened = np.linalg.solve(
        np.linalg.cholesky(predicted[both] + 1e-16 * np.eye(known.sum())), vectors[:, known].T
    )
    assert np.mean(whitened**2) == pytest.approx(1.0, abs=0.15)


def test_nothing_moved_is_accepted_at_the_stated_rate(unmoved_pair):
    """1,000 draws gave 4.5 % (all points), 5.1 % (single points), 5.6 % (reference points)."""
    alarms, points, references = 0, 0, 0
    draws = 30
    for seed in range(draws):
        first, second = unmoved_pair(seed)
        found = compare(first, second, 0.05)
        alarms += not found.congruence.passed
        points += len(found.significant)
        references += bool(compare(first, second, 0.05, reference=["K1", "K2", "A", "B", "C"]).moved)
    assert alarms <= 6
    assert references <= 6
    assert points / (8 * draws) < 0.1


def test_a_moved_point_is_found_named_and_measured(tmp_path):
    planned = network(tmp_path)
    first, second = drawn_pair(Simulation(planned), 3, moved_simulation(planned, "B"))
    found = compare(first, second, 0.01)
    assert found.significant == ("B",)
    row = NAMES.index("B")
    spread = 4.0 * np.sqrt(np.diag(found.displacements.block(row)) * found.tester.variance_factor)
    assert (np.abs(found.displacements.vectors[row] - SHIFT) < spread).all()
    relative = compare(first, second, 0.01, reference=["A", "B", "C", "E", "F"])
    assert relative.moved == ("B",)
    assert relative.congruence.passed
    assert relative.significant == ("B",)


def test_reference_points_take_the_datum_out(tmp_path):
    """A shift and a turn of the whole second epoch change nothing relative to points that took part."""
    first, second = drawn_pair(Simulation(network(tmp_path)), 5)
    moved = displacements(first, second, NAMES)
    reference = np.array([name in "ABC" for name in NAMES])
    turn = 1e-3 * np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    rigid = moved.vectors + np.array([1.0, 2.0, 3.0]) + moved.places @ turn.T
    one, two = (
        relative_to(replace(moved, vectors=vectors), reference, similarities(moved.places)[:, :4])
        for vectors in (moved.vectors, rigid)
    )
    np.testing.assert_allclose(one.vectors, two.vectors, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(one.vectors[reference].sum(axis=0), 0.0, atol=1e-12)


def test_epochs_of_different_precision_are_told(tmp_path):
    simulation = Simulation(network(tmp_path))
    first = simulation.drawn(np.random.default_rng(1))
    values = simulation.exact + 4.0 * (first.book.observations.values - simulation.exact)
    noisy = replace(
        first, book=replace(first.book, observations=replace(first.book.observations, values=values))
    )
    found = compare(first.adjust(), noisy.adjust())
    assert found.same_precision is not None
    assert not found.same_precision.passed
    assert compare(first.adjust(), noisy.adjust(), a_priori=True).same_precision is None


def test_what_cannot_be_compared_says_why(tmp_path):
    planned = network(tmp_path)
    adjustment = simulate(planned, 1).adjust()
    with pytest.raises(InputError, match="points Q: not in both epochs"):
        compare(adjustment, adjustment, points=["Q"])
    with pytest.raises(InputError, match="at least two reference points"):
        compare(adjustment, adjustment, reference=["A"])
    (tmp_path / "held.cor").write_text(point_text(sigma=0.0))
    held = simulate(Network.read(tmp_path / "plan.obs", tmp_path / "held.cor"), 2).adjust()
    with pytest.raises(InputError, match="held in both epochs"):
        compare(held, held, points=["K1", "K2"])


@pytest.fixture
def folder(tmp_path, monkeypatch):
    planned = network(tmp_path)
    monkeypatch.chdir(tmp_path)
    moved = moved_simulation(planned, "B").network.points.coordinates
    (tmp_path / "moved.cor").write_text(point_text(moved))
    for name, points, seed in (("may", "plan.cor", 7), ("june", "plan.cor", 8), ("october", "moved.cor", 9)):
        given = ["--obs", "plan.obs", "--cor", points, "--seed", str(seed), "--out", name]
        assert main(["simulate", *given]) == 0
    return tmp_path


MAY = ["--obs", "may/simulated.obs", "--cor", "may/simulated.cor"]


def test_a_reference_point_that_moved_far_is_named_and_no_obstacle(folder):
    """Its coordinates of old would be a gross error of the second epoch, and bend the network."""
    planned = Network.read("plan.obs", "plan.cor")
    places = planned.points.coordinates.copy()
    places[planned.points.index["K2"]] += 10.0 * SHIFT
    (folder / "far.cor").write_text(point_text(places))
    assert main(["simulate", "--obs", "plan.obs", "--cor", "far.cor", "--seed", "3", "--out", "later"]) == 0
    reference = ["--reference", "K1", "K2", "A", "C", "--level", "0.001"]
    assert main(["compare", *MAY, "--obs-2", "later/simulated.obs", *reference, "--out", "far"]) == 1
    record = json.loads((folder / "far/comparison.json").read_text())
    assert (record["moved"], record["obstacles"]) == (["K2"], [])
    (found,) = (row for row in record["displacements"] if row["point"] == "K2")
    np.testing.assert_allclose([found[axis] for axis in ("east", "north", "up")], 10.0 * SHIFT, atol=0.005)


def known_text(known):
    lines = []
    for name, (x, y, z) in zip(NAMES, PLACES.tolist(), strict=True):
        lines.append(f"1 {name} {x} {y} {z} 0 0 0" if name in known else f"0 {name} {x} {y} {z}")
    return "\n".join(lines) + "\n"


@pytest.fixture
def known_pair(tmp_path):
    """Of points that are known exactly in both epochs, K2 has moved; and nothing else has."""
    (tmp_path / "plan.obs").write_text(observation_text())

    def drawn(known):
        (tmp_path / "known.cor").write_text(known_text(known))
        planned, rng = Network.read(tmp_path / "plan.obs", tmp_path / "known.cor"), np.random.default_rng(5)
        second = moved_simulation(planned, "K2").drawn(rng)
        return Simulation(planned).drawn(rng).adjust(), replace(second, points=planned.points).adjust()

    return drawn


def test_a_known_point_that_moved_is_named_and_bends_no_other(known_pair):
    found = compare(*known_pair(("K1", "K2", "A")), 0.01)
    assert (found.moved, found.significant, found.obstacles) == (("K2",), ("K2",), ())
    row = found.displacements.names.index("K2")
    np.testing.assert_allclose(found.displacements.vectors[row], SHIFT, atol=0.004)
    told = listing(outcome(found.record()))
    assert "Known points have moved: K2" in told


def test_two_known_points_that_moved_against_each_other_accuse_nothing_else(known_pair):
    found = compare(*known_pair(("K1", "K2")), 0.01)
    assert found.significant == ()
    assert "one or more of K1, K2, and nothing tells which" in found.obstacles[0]
    assert len(found.obstacles) == 1


def test_points_that_only_known_ones_place_may_seem_to_move_because_of_these(tmp_path):
    """Angles from a new point to known ones: without the known ones, nothing says where it is."""
    sights = [("K1", 0.0), ("K2", 120.0), ("A", 250.0)]
    ring = {name: (np.sin(np.pi * at / 200.0), np.cos(np.pi * at / 200.0)) for name, at in sights}
    lines = [f"1 {name} {100.0 * x:.4f} {100.0 * y:.4f} 0 0 0 0" for name, (x, y) in ring.items()]
    (tmp_path / "p.cor").write_text("\n".join([*lines, "6 P 0 0 0"]))
    (tmp_path / "a.obs").write_text("\n".join(f"5 P {name} {at} 0.0005" for name, at in sights))
    turned = [(name, at + 0.01 * (name == "K2")) for name, at in sights]
    (tmp_path / "b.obs").write_text("\n".join(f"5 P {name} {at} 0.0005" for name, at in turned))
    epochs = [Network.read(tmp_path / name, tmp_path / "p.cor").adjust() for name in ("a.obs", "b.obs")]
    found = compare(*epochs, a_priori=True)
    assert found.significant == ("P",)
    assert "or one of the known points (K1, K2, A)" in found.record().reservations[0]


def test_the_command_names_what_has_moved(folder, capsys):
    level = ["--level", "0.001"]
    assert main(["compare", *MAY, "--obs-2", "june/simulated.obs", *level]) == 0
    assert main(["compare", *MAY, "--obs-2", "october/simulated.obs", *level, "--out", "moved"]) == 1
    assert "moved" in capsys.readouterr().out
    record = json.loads((folder / "moved/comparison.json").read_text())
    assert [row["point"] for row in record["displacements"] if row["is_significant"]] == ["B"]
    rows = list(csv.DictReader((folder / "moved/comparison.csv").read_text().splitlines()))
    assert rows[0]["point"] == "B"
    assert float(rows[0]["east (mm)"]) == pytest.approx(1000 * record["displacements"][0]["east"], abs=0.005)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ([], "give the second epoch"),
        (["--project-2", "a.comp"], "both epochs must be projects"),
        (["--obs-2", "june/simulated.obs", "--points", "Z"], "not in both epochs"),
    ],
)
def test_what_cannot_run_says_why(folder, capsys, options, reason):
    assert main(["compare", *MAY, *options]) == 2
    assert reason in capsys.readouterr().err


LEVELLED = """\
5 R1 0 0 100 0.0002
4 A 0 0 0
4 B 0 0 0
4 C 0 0 0
5 R2 0 0 103 0.0002
"""
RISES = """\
4 R1 A 1.0002 0.001
4 A B 0.9995 0.001
4 B R2 0.9998 0.001
4 R1 C 0.5003 0.001
4 C B 1.4994 0.001
4 C A 0.4997 0.001
"""


@pytest.fixture
def levelled(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "l.cor").write_text(LEVELLED)
    (tmp_path / "e1.obs").write_text(RISES)
    return tmp_path


def compared(folder, rises, *options):
    (folder / "e2.obs").write_text(rises)
    epochs = ["--obs", "e1.obs", "--cor", "l.cor", "--obs-2", "e2.obs"]
    return main(["compare", *epochs, "--out", "out", *options])


def test_a_gross_error_of_an_epoch_forbids_a_verdict_and_is_named(levelled, capsys):
    assert compared(levelled, RISES.replace("C A 0.4997", "C A 1.4997")) == 1
    told = capsys.readouterr().out
    assert "No verdict on movements" in told
    assert "epoch 2 holds a gross error, adjust it first: DH C -> A (e2.obs:6)" in " ".join(told.split())
    assert "moved by" not in told and "all points together" not in told
    rows = list(csv.DictReader((levelled / "out/comparison.csv").read_text().splitlines()))
    assert rows and not any("verdict" in row for row in rows)
    assert len(json.loads((levelled / "out/comparison.json").read_text())["obstacles"]) == 1


def test_a_suspected_observation_of_an_epoch_forbids_a_verdict_too(levelled, capsys):
    assert compared(levelled, RISES.replace("C A 0.4997", "C A 0.5100")) == 1
    told = capsys.readouterr().out
    assert "No verdict on movements" in told and "all points together" not in told
    assert "epoch 2 holds a gross error, adjust it first: DH C -> A (e2.obs:6): wrong by 10." in " ".join(
        told.split()
    )


def test_one_epoch_is_not_two(levelled, capsys):
    (levelled / "link.obs").symlink_to("e1.obs")
    assert main(["compare", "--obs", "e1.obs", "--cor", "l.cor", "--obs-2", "link.obs"]) == 2
    assert "link.obs: is given for both epochs" in capsys.readouterr().err
    assert compared(levelled, RISES) == 0
    assert "both epochs hold the same observations, to the last digit" in capsys.readouterr().out


def test_a_verdict_says_what_it_rests_on(levelled, capsys):
    spoilt = RISES.replace("C A 0.4997", "C A 0.5037").replace("C B 1.4994", "C B 1.4964")
    assert compared(levelled, spoilt) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "What weakens the verdict: sigma0 of epoch 2 is too large" in told
    assert "smaller movements may hide" in told
    assert "stayed" in told
    compared(levelled, spoilt, "--a-priori")
    assert "movements may be found that are none" in " ".join(capsys.readouterr().out.split())


def test_what_an_epoch_leaves_out_is_told(levelled, capsys):
    (levelled / "l.cor").write_text(LEVELLED + "0 D 0 0 0\n")
    assert compared(levelled, RISES + "3 R1 D 12.5 0.001\n") == 1
    told = capsys.readouterr().out
    assert "epoch 2 leaves out point D: the verdict is about the rest" in told
    assert "stayed" in told
    assert "Incomplete: epoch 1 and epoch 2." in told.splitlines()[1]
