"""The page of a block: what it shows is what was found, and nothing of it comes from elsewhere."""

import dataclasses
import json
import math
import re

import numpy as np
import pytest
import scenes

from obseq import load
from obseq.cli.main import main
from obseq.errors import InputError
from obseq.images import BundleAdjustment, Camera, Weighting
from obseq.images.output.arrays import arrays_of, grid_of, interior, suspected_measures
from obseq.images.output.block_record import block_record_of
from obseq.images.output.page import page
from obseq.images.output.page_charts import cameras
from obseq.images.output.record import record_of
from obseq.report.formats import FORMATS
from obseq.report.result_columns import write_columns
from obseq.report.result_file import read_plain


def content(text):
    """What the page holds for its script."""
    return json.loads(re.search(r'<script type="application/json" id="content">(.*?)</script>', text)[1])


def table(text, name):
    return next(found for found in content(text)["tables"] if found["id"] == name)


def column(found, title):
    return next(item for item in found["columns"] if item["title"] == title)


@pytest.fixture(scope="module")
def solved():
    """A ring with one blunder, one point that is seen once, and names that HTML would obey."""
    block, truth, _ = scenes.block(noise=0.3)
    block.poses = truth
    measures = block.sets.pop().measures
    xy = measures.xy.copy()
    xy[5] += 40.0
    block.add_measures(
        type(measures).packed(
            measures.image_names,
            [*measures.point_names, "<b>lost</b>"],
            [*measures.image, 0],
            [*measures.point, len(measures.point_names)],
            [*xy, [700.0, 700.0]],
            0.3,
        ),
        Weighting(0.3, 1.0, 30.0, 2.0),
    )
    return block.solve()


def test_the_page_says_what_was_found(solved):
    record = record_of(solved)
    text = page(record)
    found = content(text)
    assert found["kind"] == "block"
    assert found["cards"][0]["value"] == f"{record.sigma0:.4g}"
    titles = [item["title"] for part in found["lists"] for item in part["items"]]
    assert "Left out: 1 point" in titles
    assert f"{record.weakened} image points weakened" in titles
    (left,) = (
        item for part in found["lists"] for item in part["items"] if item["title"] == "Left out: 1 point"
    )
    assert "<b>lost</b>" in left["text"]
    assert "<b>" not in text
    parameters = table(text, "parameters")
    assert column(parameters, "value")["values"][0] == record.cameras[0].parameters[0].value
    assert min(column(table(text, "measures"), "weight")["values"]) == 0.0
    assert not re.search(r'(?:src|href)="[^#]|url\(|https?://(?!www\.w3\.org/)', text)
    assert "NaN" not in json.dumps(found)


def test_a_page_without_precisions(solved):
    found = content(page(record_of(solved, precisions=False)))
    assert set(found["plan"]["major"]) == {None}
    assert ["precisions", "none"] in found["sections"][-1]["facts"]


def test_all_residuals_are_in_the_record(solved):
    record = record_of(solved)
    measures, found = record.measures, solved.residuals
    assert len(measures) == len(found.image)
    norms = np.hypot(measures.numbers("dx"), measures.numbers("dy"))
    first = [measure.image == record.images[0].name for measure in measures]
    rms = np.sqrt(np.mean(norms[first] ** 2) / 2.0)
    assert rms == pytest.approx(record.images[0].rms, rel=1e-12)
    assert measures.values("weight").count(0.0) == 1


def test_the_plan_has_points_cameras_and_their_ellipses(solved):
    record = record_of(solved)
    plan = content(page(record))["plan"]
    n = len(record.points)
    assert plan["x"][:n] == pytest.approx([point.x for point in record.points], abs=1e-6)
    assert plan["marks"][n:] == [8] * len(record.images)
    xx, xy, _, yy, _, _ = record.points[0].covariance
    values, vectors = np.linalg.eigh([[xx, xy], [xy, yy]])
    assert (plan["minor"][0], plan["major"][0]) == pytest.approx(np.sqrt(values), rel=1e-4)
    bearing = math.atan2(vectors[0, 1], vectors[1, 1]) % math.pi
    assert plan["bearing"][0] == pytest.approx(bearing, abs=1e-4)
    side = plan["views"][1]
    assert side["y"][:n] == pytest.approx([point.z for point in record.points], abs=1e-6)


def test_residuals_stand_at_their_measures_on_the_frames(solved):
    record = record_of(solved)
    frames, calibration = content(page(record))["sections"][:2]
    assert len(frames["charts"]) == len(record.images)
    worst = max(range(len(record.images)), key=lambda k: record.images[k].rms)
    rows = [row for row in record.measures if row.image == record.images[worst].name]
    first = frames["charts"][0]
    assert first["title"] == record.images[worst].name
    assert first["dx"] == pytest.approx([row.dx for row in rows], abs=1e-4)
    assert first["x"] == pytest.approx([row.x for row in rows], abs=0.1)
    kinds = [chart["kind"] for chart in calibration["charts"]]
    assert kinds == ["frame", "profile", "coverage", "matrix", "grid"]
    counts = np.array(calibration["charts"][2]["counts"])
    x, y = (record.measures.numbers(axis) for axis in "xy")
    size = np.array([record.cameras[0].width, record.cameras[0].height])
    is_first = (x < size[0] / 8) & (y < size[1] / 6)
    assert (counts.sum(), counts[0, 0]) == (len(x), np.count_nonzero(is_first))


def test_a_radial_error_shows_in_the_profile(solved):
    record = record_of(solved)
    block = arrays_of(record)
    middle = interior(record.cameras[0])[1]
    radial = dataclasses.replace(block, residuals=(block.xy - middle) / 500.0)
    (profile,) = (
        chart for chart in cameras(record, radial, suspected_measures(record)) if chart["kind"] == "profile"
    )
    assert profile["mean"] == pytest.approx(np.array(profile["radius"]) / 500.0, abs=0.1)
    assert (np.diff(profile["mean"]) > 0.0).all()
    outer = np.array(profile["rms"][2:]) * math.sqrt(2.0)
    np.testing.assert_allclose(outer, profile["mean"][2:], rtol=0.05)


def test_the_grid_without_distortion_is_that_of_the_image():
    given = grid_of((1000, 800), 900.0)
    assert given.shape == (289, 2)
    assert (given.min(axis=0).tolist(), given.max(axis=0).tolist()) == ([0.0, 0.0], [1000.0, 800.0])


def test_the_page_of_a_stored_result_is_that_of_the_solution(solved, tmp_path, capsys):
    """Nothing is computed again, and nothing but the file is needed."""
    record = record_of(solved)
    path = tmp_path / "bundle.npz"
    with path.open("wb") as file:
        write_columns(file, record)
    with np.load(path) as columns:
        np.testing.assert_array_equal(columns["measures.dx"], solved.residuals.residuals[:, 0])
        np.testing.assert_array_equal(columns["measures.w_y"], solved.reliability().w[:, 1])
        assert len(columns["points.covariance"]) == len(record.points)
    assert load(path) == record
    code = main(["report", str(path), f"--out={tmp_path / 'again'}"])
    assert code == (0 if record.is_complete else 1)
    assert (tmp_path / "again/bundle.html").read_text() == page(record)
    assert (tmp_path / "again/bundle.json").read_text() == record.to_json()
    assert "Image block: " in capsys.readouterr().out
    assert {form.name for form in FORMATS} == {"json", "html", "text", "npz"}


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ('"version": 6', '"version": 5', "format obseq-bundle 5 is not read"),
        ('"redundancy":', '"other":', "missing required field `redundancy`"),
        ('"images": [', '"images": [7, ', r"images\[0\]: Expected `object`"),
        ("{", "{{", "it is not a result file"),
        ('"obseq-bundle"', '"other"', "it is not the result of a bundle adjustment"),
    ],
)
def test_results_of_blocks_that_are_wrong_are_refused(solved, tmp_path, before, after, message):
    path = tmp_path / "bundle.json"
    text = record_of(solved).to_json()
    assert before in text
    path.write_text(text.replace(before, after, 1))
    with pytest.raises(InputError, match=message):
        block_record_of(read_plain(path), str(path))


def test_the_tests_of_all_image_points_are_in_the_record(solved):
    record, found = record_of(solved), solved.reliability()
    redundancies = [record.measures.numbers(f"redundancy_{axis}").sum() for axis in "xy"]
    assert sum(redundancies) == pytest.approx(record.reliability.redundancy)
    np.testing.assert_array_equal(record.measures.numbers("w_x"), found.w[:, 0])
    np.testing.assert_array_equal(record.measures.numbers("detectable_y"), found.detectable[:, 1])


def test_a_camera_without_size_is_drawn(solved):
    measures = solved.block.sets[0].measures
    block = BundleAdjustment()
    block.add_cameras(Camera("c", 0, 0, 1800.0, [1000.0, 750.0], (2, 0, 0)))
    block.add_poses(solved.poses)
    block.add_approximations(solved.points, solved.coordinates)
    block.add_measures(measures.rows(measures.point < 29))
    solution = block.solve(datum="centres")
    frames = content(page(record_of(solution)))["sections"][0]["charts"]
    assert len(frames) == len(solution.poses)
    assert all(-0.1 <= x <= frame["width"] + 0.1 for frame in frames for x in frame["x"])
