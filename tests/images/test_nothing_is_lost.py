"""What was found is returned, whatever fails after it: settling, a datum, covariances."""

import numpy as np
import pytest
import scenes

import obseq.images.adjustment.free as free
from obseq.cli.main import main
from obseq.errors import DivergenceError, InputError, SingularSystemError
from obseq.formats.bal.reader import read_bal
from obseq.images import ControlPoints
from obseq.images.output.page import text as summary
from obseq.images.output.record import record_of


def _cost_at(block, solution) -> float:
    """The sum of squares of image residuals, anew from what the solution says."""
    found = solution.residuals
    cameras, poses = list(solution.cameras.values()), solution.poses
    of = [cameras[list(solution.cameras).index(name)] for name in poses.cameras]
    xy = [
        of[image].project(poses[poses.images[image]].to_local(solution.coordinates[point][None]))[0]
        for image, point in zip(found.image, found.point, strict=True)
    ]
    return float(np.sum(((np.array(xy) - found.xy) / found.sigmas) ** 2))


@pytest.mark.parametrize("datum", ["centres", "points"])
@pytest.mark.parametrize("failure", [DivergenceError, SingularSystemError, InputError])
def test_a_free_block_that_does_not_settle_on_its_datum_is_the_damped_one(monkeypatch, datum, failure):
    block, _, _ = scenes.block(n_control=0)
    block.freeze_parameters("b.|p.|K3")
    right = block.solve(datum=datum)

    def fails(*_):
        raise failure("the steps lead nowhere")

    monkeypatch.setattr(free, "_settled", fails)
    found = block.solve(datum=datum)
    assert found.converged
    assert found.sigma0 == pytest.approx(right.sigma0, rel=1e-9)
    assert found.result.redundancy == right.result.redundancy
    np.testing.assert_allclose(found.poses.centres, right.poses.centres, atol=1e-3)
    assert _cost_at(block, found) == pytest.approx(right.result.cost, rel=1e-6)
    record = record_of(found)
    assert not record.is_complete and record.precision == "none"
    assert record.images[0].centre_sigmas is None and record.reliability is None
    assert "the steps lead nowhere" in summary(record)
    with pytest.raises(failure, match="nowhere"):
        found.centre_covariances  # noqa: B018


@pytest.mark.parametrize("datum", ["points", "centres"])
def test_a_block_of_just_enough_equations_has_a_solution_that_nothing_checks(shared_data, datum):
    block = read_bal(shared_data / "image-cases/bal-three-cameras/problem.txt")
    block.freeze_parameters("K2")
    found = block.solve(datum=datum)
    assert found.result.cost < 0.0014
    assert _cost_at(block, found) < 0.0014
    said = summary(record_of(found))
    assert "equations: 38, unknowns 45, redundancy 0" in said and "nothing checks the result" in said
    assert "A block needs a datum" not in said


def test_a_block_short_of_equations_is_told_so_and_not_of_its_datum():
    block, _, _ = scenes.block(n_images=3, n_points=4, n_control=4)
    found = block.solve()
    assert "36 equations for 40 unknowns: it is 4 equations short" in found.weak
    assert "needs a datum" not in found.weak


def test_control_points_of_one_place_are_told_as_that(shared_data, monkeypatch, capsys):
    monkeypatch.chdir(shared_data / "image-cases/one-place-control")
    names = {"cameras": "cam", "images": "im", "control": "ctl", "measures": "mes"}
    assert main(["bundle", *(f"--{key}={name}.csv" for key, name in names.items()), "--image-sigma=1"]) == 2
    said = capsys.readouterr().err
    assert "all its 9 control points have one place (500328.842, 5452818.781, 1000)" in said
    assert "no two of" not in said


def test_given_poses_do_not_hide_that_control_points_have_one_place():
    block, _, _ = scenes.block(n_control=0)
    block.add_control_points(ControlPoints.of(["P0", "P1", "P2"], np.full((3, 3), 4.0), 0.01))
    with pytest.raises(InputError, match="all its 3 control points have one place"):
        block.solve()


def test_images_that_cannot_be_placed_are_told_with_reasons_and_notes():
    block = scenes.block(n_control=0)[0]
    block.poses = block.poses.select([])
    part = block.sets[0].measures
    few = part.rows(np.flatnonzero(part.point < 5))
    block.sets = []
    block.add_measures(few)
    block.notes = ["control.csv: 9 control points lack a height and are left out"]
    with pytest.raises(InputError, match=r"(?s)no two of .*note: control.csv: 9 control points lack"):
        block.initialise()
