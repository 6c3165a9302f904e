"""What people do with a block by names, in the words of networks."""

import csv
import re
from dataclasses import replace
from typing import get_overloads

import numpy as np
import pytest
import scenes

import obseq
from obseq.errors import InputError
from obseq.images import AdjustedBlock, BundleAdjustment, ControlPoints
from obseq.images.output.block_record import BundleRecord, MeasureRecord
from obseq.reading.origin import Origin
from obseq.records.adjustment import AdjustmentRecord
from obseq.records.table import kinds_of_tables
from obseq.survey.adjustment import asked as of_networks


@pytest.fixture(scope="module")
def block() -> BundleAdjustment:
    return scenes.block()[0]


@pytest.fixture(scope="module")
def solution(block):
    return block.adjust()


def counts(block: BundleAdjustment) -> tuple[int, int]:
    """How many image points there are, and how many known points."""
    known = ~np.isinf(np.diagonal(block.control.covariances, axis1=1, axis2=2)).any(axis=1)
    return sum(len(part.measures) for part in block.sets), int(known.sum())


def test_observations_are_left_out_by_name(block):
    all_points, control = counts(block)
    assert counts(block.without("i0 -> P3")) == (all_points - 1, control)
    assert counts(block.without("P3", kind="image")) == (all_points - 8, control)
    assert counts(block.without("P3", kind="control")) == (all_points, control - 1)
    assert counts(block.without("P3")) == (all_points - 8, control - 1)
    of_image = int((block.sets[0].measures.image == 2).sum())
    assert counts(block.without("i2", "P4")) == (all_points - of_image - 7, control - 1)
    assert counts(block) == (all_points, control)


def test_a_line_of_a_file_is_left_out():
    made = scenes.block(n_points=10)[0]
    measures = made.sets[0].measures
    made.sets = []
    made.add_measures(measures, origin=Origin("folder/measures.csv", range(2, len(measures) + 2)))
    rest = made.without("measures.csv:5").sets[0]
    assert len(rest.measures) == len(measures) - 1
    assert list(rest.origin.lines)[:4] == [2, 3, 4, 6]
    assert rest.measures.xy[3].tolist() == measures.xy[4].tolist()


def test_a_line_of_a_table_of_control_points_is_left_out():
    made = scenes.block(n_control=0)[0]
    control = ControlPoints.of(["P1", "P2", "P3"], np.arange(9.0).reshape(3, 3), 0.01)
    made.add_control_points(control, Origin("folder/control.csv", (2, 3, 5)))
    assert made.without("control.csv:5").control.is_free.all(axis=1).tolist() == [False, False, True]
    with pytest.raises(InputError, match=r"no observation is called 'control\.csv:4'"):
        made.without("control.csv:4")


def test_names_that_nothing_has_are_refused(block):
    for what, kind, message in (
        ("i99", None, "no observation is called 'i99'; nearest names"),
        ("i0", "control", "no observation of kind control is called 'i0'"),
        ("i0", "Hz", "no observation is of kind Hz; there are image, control"),
        ("i0 -> X", None, "no observation is called 'i0 -> X'"),
    ):
        with pytest.raises(InputError, match=message):
            block.without(what, kind=kind)
    with pytest.raises(InputError, match="must be positive"):
        block.weights(factor=0.0)
    for odd in ({"factor": 1e-300}, {"sigma": 1e300}):
        with pytest.raises(InputError, match=r"must be positive, at most 1e\+12"):
            block.weights(**odd)
    for odd in ({}, {"factor": 2.0, "sigma": 0.1}):
        with pytest.raises(InputError, match="either a factor of the sigmas or a sigma"):
            block.weights(**odd)


def test_sigmas_are_changed_by_name(block):
    before = block.sets[0].measures
    after = block.weights("i1", factor=3.0, kind="image").sets[0].measures
    is_other = before.image == before.image_names.index("i1")
    np.testing.assert_array_equal(after.sigmas[is_other], 3.0 * before.sigmas[is_other])
    np.testing.assert_array_equal(after.sigmas[~is_other], before.sigmas[~is_other])
    known = block.weights("P0", kind="control", sigma=0.5).control.covariances
    np.testing.assert_allclose(known[0], 0.25 * np.eye(3))
    np.testing.assert_array_equal(known[1:], block.control.covariances[1:])


def test_a_copy_is_its_own(block):
    made, before = block.copied(), counts(block)
    made.add_length("P0", "P1", 1.0, 0.1)
    made.add_approximations(["P29"], [[9.0, 9.0, 9.0]])
    made.camera_of["new"] = "c"
    assert counts(block) == before
    assert block.lengths.values == ()
    assert "P29" not in block.approximations
    assert "new" not in block.camera_of


def test_adjust_solves_and_looks_for_errors(block, solution):
    solved = block.solve()
    np.testing.assert_allclose(solution.coordinates, solved.coordinates, atol=1e-9)
    assert solution.diagnosis is not None
    assert solution.gross_errors == ()
    assert solution.record().is_complete
    bad = block.copied()
    xy = bad.sets[0].measures.xy.copy()
    xy[5] += 30.0
    part = bad.sets[0]
    bad.sets[0] = replace(part, measures=replace(part.measures, xy=xy))
    (error,) = bad.adjust().gross_errors
    assert "i0" in error.what
    assert "P5" in error.what


def test_covariances_of_points_and_centres_together(solution):
    both = solution.covariance("P7", "i3")
    np.testing.assert_allclose(both, both.T, atol=1e-15)
    np.testing.assert_allclose(
        both[:3, :3], solution.point_covariances[solution.points.index("P7")], rtol=1e-6
    )
    np.testing.assert_allclose(both[3:, 3:], solution.centre_covariances[3], rtol=1e-6)
    assert np.abs(both[:3, 3:]).max() > 0.0
    with pytest.raises(InputError, match="no point and no image is called 'X9'"):
        solution.covariance("X9")


def test_an_ellipse_at_a_level(solution):
    standard, large = solution.ellipse("P7", None), solution.ellipse("P7", 0.95)
    assert standard.semi_major**2 == pytest.approx(np.linalg.eigvalsh(solution.covariance("P7")[:2, :2])[1])
    assert large.semi_major > 2.0 * standard.semi_major


def test_tables_have_columns_rows_and_files(solution, tmp_path):
    points, measures = solution.table("points"), solution.table("measures")
    np.testing.assert_allclose(points["x"], solution.coordinates[:, 0])
    assert points.where(name="P7").rows[0].n_rays == 8
    np.testing.assert_allclose(measures["dx"], solution.residuals.residuals[:, 0])
    assert measures.rows[0].w_x is not None
    measures.save(tmp_path / "residuals.csv")
    rows = list(csv.DictReader((tmp_path / "residuals.csv").read_text(encoding="utf-8").splitlines()))
    assert [float(row["dy"]) for row in rows] == measures["dy"]
    with pytest.raises(InputError, match="no table 'sigma0'; it has iterations, cameras, images, points"):
        solution.table("sigma0")
    with pytest.raises(InputError, match="no column 'z9'"):
        points["z9"]


@pytest.mark.parametrize("loss", ["huber", "tukey"])
def test_robust_weights_hold_a_blunder_down(block, loss):
    bad, part = block.copied(), block.sets[0]
    xy = part.measures.xy.copy()
    xy[40] += 400.0
    bad.sets[0] = replace(part, measures=replace(part.measures, xy=xy))
    true = block.solve().coordinates
    off = [np.abs(found.coordinates - true).max() for found in (bad.solve(), bad.adjust(loss=loss))]
    assert off[1] < 0.05 * off[0]
    with pytest.raises(InputError, match="no loss is named 'huge'"):
        block.adjust(loss="huge")


def test_a_free_block_and_a_scale(block):
    free = block.without(kind="control").adjust(datum="centres")
    assert free.converged
    scaled = block.without(kind="control")
    first, second = (block.control.coordinates[k] for k in (0, 1))
    scaled.add_length("P0", "P1", float(np.linalg.norm(first - second)), 1e-5)
    found = scaled.adjust(datum="points")
    rows = [found.points.index(name) for name in ("P0", "P1")]
    length = np.linalg.norm(np.subtract(*found.coordinates[rows]))
    assert length == pytest.approx(np.linalg.norm(first - second), abs=1e-4)


def test_results_are_saved_and_loaded(solution, tmp_path):
    for name in ("b.json", "b.html", "b.txt", "b.npz"):
        solution.save(tmp_path / name)
    for name in ("b.json", "b.npz"):
        loaded = obseq.load(tmp_path / name)
        assert loaded.table("points")["z"] == solution.table("points")["z"]
    with pytest.raises(InputError, match=r"b\.odt: a result is saved as \.json, \.html, \.txt, \.npz"):
        solution.save(tmp_path / "b.odt")


def test_the_plan_is_drawn(solution):
    matplotlib = pytest.importorskip("matplotlib", reason="no matplotlib (pip install 'obseq[plot]')")
    matplotlib.use("Agg")
    axes = solution.plot(residuals=True)
    assert len(axes.collections[-1].get_offsets()) == len(solution.points)
    assert [text.get_text() for text in axes.texts] == list(solution.points)


@pytest.mark.parametrize(
    ("asked", "record", "others"),
    [
        (of_networks.Asked, AdjustmentRecord, {}),
        (AdjustedBlock, BundleRecord, {"measures": MeasureRecord}),
    ],
)
def test_what_type_checkers_are_told_of_tables_is_true(asked, record, others):
    """Each overload promises the rows that the table of that name has."""
    kinds, promised = kinds_of_tables(record) | others, 0
    for overload in get_overloads(asked.table):
        hint = overload.__annotations__
        for name in re.findall(r"'(\w+)'", hint["name"]):
            assert hint["return"] == f"Table[{kinds[name].__name__}]"
            promised += 1
    assert promised >= 4


def test_on_a_datum_of_its_own_what_is_known_takes_no_part(block):
    free, same = block.adjust(datum="points"), block.without(kind="control").adjust(datum="points")
    np.testing.assert_allclose(free.coordinates, same.coordinates, rtol=0, atol=1e-9)
    assert free.sigma0 == pytest.approx(same.sigma0, rel=1e-9)
    assert any("take no part: the block is free" in note for note in free.block.notes)
    assert not any("take no part" in note for note in block.adjust().block.notes)
