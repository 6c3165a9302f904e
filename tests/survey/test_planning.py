"""Plans, simulated observations and drawn adjustments."""

import json
from dataclasses import replace

import numpy as np
import pytest
from planned import NAMES, PLACES, network, observation_text, point_text

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.report import planned as planned_page
from obseq.report.planned import limited, outcome
from obseq.report.summary import listing
from obseq.survey import Network, Quality, join, plan, read_cor, read_obs, simulate, write_obs
from obseq.survey.adjustment.datum import Datum
from obseq.survey.planning.simulation import Simulation


@pytest.fixture
def planned(tmp_path):
    return network(tmp_path)


def rms(adjustment):
    variances = np.diagonal(adjustment.points.covariances, axis1=1, axis2=2)
    return np.sqrt(variances.sum() / np.count_nonzero(variances))


def test_simulated_values_fit_the_coordinates(planned):
    exact = simulate(planned, noise=False)
    adjustment = exact.adjust()
    np.testing.assert_allclose(adjustment.points.coordinates, planned.points.coordinates, rtol=0.0, atol=1e-9)
    assert np.abs(adjustment.normalised_residuals).max() < 1e-6
    observed = exact.book.observations
    is_distance = observed.types == 3
    ends = planned.points.coordinates[observed.to_points] - planned.points.coordinates[observed.from_points]
    np.testing.assert_allclose(observed.values[is_distance], np.linalg.norm(ends, axis=1)[is_distance])


def test_precisions_are_those_of_an_adjustment_of_simulated_observations(planned):
    found = plan(planned, with_gains=False)
    adjustment = simulate(planned, noise=False).adjust(quality=Quality(a_priori=True))
    np.testing.assert_allclose(
        found.adjustment.points.precisions, adjustment.points.precisions, rtol=1e-9, atol=1e-12
    )
    planned_numbers, numbers = found.adjustment.quality.observations, adjustment.quality.observations
    np.testing.assert_allclose(planned_numbers.redundancy, numbers.redundancy, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(planned_numbers.detectable, numbers.detectable, rtol=1e-6)


def test_values_of_observations_do_not_count(planned):
    changed = replace(
        planned.book,
        observations=replace(planned.book.observations, values=planned.book.observations.values + 0.3),
    )
    one, two = plan(planned, with_gains=False), plan(replace(planned, book=changed), with_gains=False)
    np.testing.assert_allclose(one.adjustment.points.precisions, two.adjustment.points.precisions, rtol=1e-9)


@pytest.mark.parametrize("code", [5, 6, 3])
def test_a_gain_is_what_a_plan_with_the_observation_shows(tmp_path, code):
    """The same observation is missing from a plan and added to it."""
    missing = (code, "D", "F")
    before = plan(network(tmp_path, without=[missing]))
    after = plan(network(tmp_path), with_gains=False)
    kind = {5: "Hz", 6: "Zen", 3: "Dist"}[code]
    gain = next(g for g in before.gains if (g.type, {g.origin, g.target}) == (kind, {"D", "F"}))
    assert gain.before == pytest.approx(rms(before.adjustment), rel=1e-6)
    assert gain.after == pytest.approx(rms(after.adjustment), rel=1e-6)
    row = after.network.points.index[gain.point]
    assert gain.point_after == pytest.approx(
        np.sqrt(np.trace(after.adjustment.points.covariances[row])), rel=1e-6
    )


def test_a_line_that_is_off_may_name_any_point(tmp_path, planned):
    write_obs(tmp_path / "off.obs", planned.book)
    with (tmp_path / "off.obs").open("a") as file:
        file.write("-3 Nowhere Elsewhere 5000 0.01\n")
    book = read_obs(tmp_path / "off.obs")
    numbered = join(planned.points, book)[1]
    gains = [plan(replace(planned, book=found)).gains for found in (planned.book, numbered)]
    assert gains[0] and [gain.after for gain in gains[1]] == pytest.approx([gain.after for gain in gains[0]])


def test_gains_count_the_points_that_matter(planned):
    everywhere, near_f = plan(planned), plan(planned, counted=["F"])
    assert everywhere.candidates == near_f.candidates > 0
    assert near_f.gains[0].point == "F"
    assert [g.after for g in near_f.gains] == sorted(g.after for g in near_f.gains)
    with pytest.raises(InputError, match="unknown point Q"):
        plan(planned, counted=["Q"])


def test_the_weakest_direction_is_that_of_the_covariance(planned):
    found = plan(planned, with_gains=False)
    first = found.weakest_points()[0]
    covariance = found.adjustment.points.covariances[planned.points.index[first.point]]
    level = np.cos(first.elevation)
    along = [level * np.sin(first.azimuth), level * np.cos(first.azimuth), np.sin(first.elevation)]
    assert along @ covariance @ along == pytest.approx(first.sigma**2)
    assert first.sigma**2 == pytest.approx(np.linalg.eigvalsh(found.adjustment.points.covariances).max())


def test_drawn_errors_agree_with_the_prediction_and_with_nothing_else(planned):
    found = plan(planned, with_gains=False, draws=80, seed=3)
    assert found.draws.agrees
    assert abs(found.draws.ratio - 1.0) < 0.15
    assert abs(found.draws.sigma0 - 1.0) < 0.1
    from obseq.survey.planning.simulation import compared, draw

    drawn = draw(Simulation(planned), 80, 3)
    too_small = replace(found.adjustment.points, covariances=found.adjustment.points.covariances / 2.0)
    assert not compared(drawn, replace(found.adjustment, points=too_small), 3).agrees


def test_draws_that_do_not_converge_are_counted(planned, monkeypatch):
    from obseq.survey.planning import simulation

    solved, count = simulation._adjusted, iter(range(9))
    monkeypatch.setattr(simulation, "_adjusted", lambda *given: solved(*given) if next(count) % 3 else None)
    drawn = simulation.draw(Simulation(planned), 7, 3)
    assert len(drawn.errors) == len(drawn.variance_factors) == 4 and drawn.failed == 3


def test_errors_have_the_sigmas_that_are_given(planned):
    simulation = Simulation(planned)
    rng = np.random.default_rng(5)
    drawn = [simulation.drawn(rng) for _ in range(300)]
    errors = np.array([one.book.observations.values for one in drawn]) - simulation.exact
    np.testing.assert_allclose(errors.std(axis=0), simulation.sigmas, rtol=0.2)
    moved = np.array([one.points.coordinates for one in drawn]) - planned.points.coordinates
    np.testing.assert_allclose(moved[:, :2].std(axis=0), 0.001, rtol=0.2)
    assert np.abs(moved[:, 2:]).max() < 1e-9


def test_the_same_seed_gives_the_same_errors(planned):
    one, two, other = (simulate(planned, seed).book.observations.values for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, two)
    assert np.abs(one - other).max() > 1e-4


def test_points_without_coordinates_are_placed_by_true_values_only(tmp_path, planned):
    (tmp_path / "p.cor").write_text("\n".join(point_text().splitlines()[:-1]) + "\n")
    with pytest.raises(InputError, match="coordinates of all points; F have none"):
        plan(Network.read(tmp_path / "plan.obs", tmp_path / "p.cor"))
    write_obs(tmp_path / "measured.obs", simulate(planned, seed=2).book)
    found = plan(Network.read(tmp_path / "measured.obs", tmp_path / "p.cor"), with_gains=False)
    assert any("1 points had no coordinates" in note for note in found.adjustment.notes)
    expected = plan(planned, with_gains=False).adjustment.points.precisions
    np.testing.assert_allclose(found.adjustment.points.precisions, expected, rtol=1e-3, atol=1e-6)


def test_placeholders_are_no_coordinates(tmp_path, planned):
    lines = point_text().splitlines()
    (tmp_path / "p.cor").write_text("\n".join([*lines[:-1], f"0 {lines[-1].split()[1]} 0 0 0"]) + "\n")
    with pytest.raises(InputError, match=r"F have none, or a placeholder \(0 0 0\)"):
        simulate(Network.read(tmp_path / "plan.obs", tmp_path / "p.cor"))
    write_obs(tmp_path / "measured.obs", simulate(planned, seed=2).book)
    found = simulate(Network.read(tmp_path / "measured.obs", tmp_path / "p.cor"), noise=False)
    assert "its approximate coordinates (0.000, 0.000, 0.000) are 131 m from" in found.book.warnings[-1]
    np.testing.assert_allclose(found.points.coordinates, planned.points.coordinates, atol=0.02)


@pytest.fixture
def folder(tmp_path, monkeypatch, planned):
    monkeypatch.chdir(tmp_path)
    return tmp_path


FILES = ["--obs", "plan.obs", "--cor", "plan.cor"]


def test_the_command_writes_the_plan(folder, capsys):
    assert main(["plan", *FILES, "--draws", "20", "--out", "out"]) == 0
    text = capsys.readouterr().out
    assert "is weak (" in text
    assert "One more " in text
    assert "What one more observation would bring" in (folder / "out/plan.txt").read_text()
    record = json.loads((folder / "out/plan.json").read_text())
    assert record["format"] == "obseq-plan"
    assert record["draws"]["draws"] == 20
    assert len(record["gains"]) == 10
    assert record["adjustment"]["precision"] == "a priori"
    assert "Every point will be known to" in (folder / "out/plan.html").read_text()


def test_the_command_writes_files_that_can_be_adjusted(folder, capsys):
    assert main(["simulate", *FILES, "--seed", "4", "--out", "epoch"]) == 0
    book, points = read_obs(folder / "epoch/simulated.obs"), read_cor(folder / "epoch/simulated.cor")
    assert len(book.observations) == len(read_obs(folder / "plan.obs").observations)
    assert len(points) == 8
    given = ["--obs", "epoch/simulated.obs", "--cor", "epoch/simulated.cor"]
    assert main(["adjust", *given, "--json", "a.json"]) == 0
    assert 0.6 < json.loads((folder / "a.json").read_text())["sigma0"] < 1.4


def test_an_undetermined_point_is_said(folder, capsys):
    lines = [line for line in observation_text().splitlines() if " F " not in line]
    (folder / "plan.obs").write_text("\n".join([*lines, "3 K1 F 1 0.001"]) + "\n")
    assert main(["plan", *FILES]) == 1
    assert "point F is left out" in capsys.readouterr().out


@pytest.mark.parametrize("size", [1.0, 30.0, 300.0])
def test_a_free_network_on_the_earth_is_that_of_a_plane(tmp_path, size):
    """Nothing but the curvature of the Earth orients it: its rotation is free all the same."""
    places = np.array([657700.0, 6860700.0, 50.0]) + PLACES * [size, size, 1.0]
    (tmp_path / "p.obs").write_text(observation_text())
    (tmp_path / "p.cor").write_text(point_text(places))
    measured = simulate(
        Network.read(tmp_path / "p.obs", tmp_path / "p.cor", points_crs="IGNF:LAMB93"), seed=3
    )
    found = measured.adjust(datum=Datum("inner"), start=Simulation(measured).truth)
    assert found.converged
    assert len(found.points.names) == len(PLACES)
    assert found.solution.redundancy == len(found.residuals) - (3 * len(PLACES) + 3 - 4)
    assert 0.7 < found.sigma0 < 1.3
    assert found.points.precisions.max() < 0.01 * size


def test_a_negative_number_of_draws_is_refused(planned):
    with pytest.raises(InputError, match="draws=-1; give 0 for none"):
        plan(planned, draws=-1)


def test_exact_observations_are_not_judged(tmp_path):
    """Their residuals are rounding: no sigmas are too large, nothing is accepted or rejected."""
    (tmp_path / "plan.obs").write_text(observation_text())
    (tmp_path / "plan.cor").write_text(point_text())
    read = ["--obs", str(tmp_path / "plan.obs"), "--cor", str(tmp_path / "plan.cor")]
    assert main(["plan", *read, "--no-gains", "--out", str(tmp_path / "out")]) == 0
    record = json.loads((tmp_path / "out/plan.json").read_text())["adjustment"]
    assert record["planned"] and record["redundancy"] > 0
    for judged in ("sigma0", "variance_factor", "global_test", "types", "setups", "diagnosis"):
        assert record[judged] is None
    assert all("residual" in row and row["residual"] is None for row in record["observations"])
    for name in ("plan.html", "plan.txt"):
        text = (tmp_path / "out" / name).read_text().partition("</script")[0]
        assert "othing is measured yet" in text
        for word in (
            "rejected: ",
            "accepted",
            "sigmas announce",
            "times too",
            "exceeded by",
            "NOT CONVERGED",
        ):
            assert word not in text


def test_placeholders_have_not_moved(tmp_path):
    network(tmp_path)
    simulated = simulate(network(tmp_path), noise=False)
    points, rows = simulated.points, [NAMES.index(name) for name in "AB"]
    coordinates = points.coordinates.copy()
    coordinates[rows] = 0.0
    adjusted = replace(simulated, points=replace(points, coordinates=coordinates)).adjust()
    moved = {point.name: point.moved for point in adjusted.record().points}
    assert {item.name for item in adjusted.replaced} == {"A", "B"}
    assert moved["A"] is None and moved["B"] is None
    np.testing.assert_allclose(moved["C"], 0.0, atol=1e-6)


def test_what_limits_a_plan_is_said(tmp_path):
    """Good known points leave the precision to the sights; bad ones take it, whatever is observed."""
    sigmas = {"sights": 1e-6, "datum": 0.02}
    records = {}
    for name, sigma in sigmas.items():
        (tmp_path / name).mkdir()
        points = ("K1", "K2", "C", "E", "F")  # around the others
        lines = point_text(sigma=sigma).splitlines()
        fixed = [
            f"1 {line.split()[1]} {' '.join(line.split()[2:5])} {sigma} {sigma} {sigma}"
            if line.split()[1] in points
            else line
            for line in lines
        ]
        (tmp_path / name / "plan.cor").write_text("\n".join(fixed) + "\n")
        (tmp_path / name / "plan.obs").write_text(observation_text())
        read = Network.read(tmp_path / name / "plan.obs", tmp_path / name / "plan.cor")
        records[name] = plan(read, with_gains=False).record()
    assert limited(records["sights"]) is None
    name, whole, own = limited(records["datum"])
    assert name == records["datum"].weakest_points[0].point and own < 0.25 * whole
    assert "The datum limits the precision: " in listing(outcome(records["datum"]))
    assert "The datum limits" not in listing(outcome(records["sights"]))
    shown = planned_page.shown(records["datum"])
    assert "limited by the known points and not by the sights" in shown.verdict.text
    assert shown.lists[0].items[0].title == "The datum limits the precision"
    places = [item.to for item in shown.lists[0].items if item.level == "warn" and item.where]
    rows = records["datum"].adjustment.observations
    assert all(place.table == "observations" and rows[place.row].redundancy < 0.5 for place in places)


def test_a_plan_of_known_points_is_said_to_determine_nothing(tmp_path):
    lines = point_text().splitlines()
    known = [f"1 {' '.join(line.split()[1:5])} 0.001 0.001 0.001" for line in lines]
    (tmp_path / "plan.cor").write_text("\n".join(known) + "\n")
    (tmp_path / "plan.obs").write_text(observation_text())
    record = plan(Network.read(tmp_path / "plan.obs", tmp_path / "plan.cor"), with_gains=False).record()
    assert "Every point is known already" in listing(outcome(record))
    shown = planned_page.shown(record)
    assert (shown.verdict.level, "determines nothing" in shown.verdict.text) == ("warn", True)
