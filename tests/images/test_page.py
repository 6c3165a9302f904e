"""The page of a block: what it shows is what was found, and nothing of it comes from elsewhere."""

import itertools
import math
import re
from html.parser import HTMLParser

import numpy as np
import pytest
import scenes

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.images import BundleAdjustment, Camera, Weighting
from obseq.images.output.block_record import read_block_record
from obseq.images.output.drawings import (
    arrows,
    grid_of,
    histogram,
    radial_profile,
    round_below,
    undistorted_grid,
)
from obseq.images.output.page import STYLE, page
from obseq.images.output.record import record_of
from obseq.report.formats import FORMATS

VOID = {"meta", "path", "rect", "circle", "br"}


class _Checked(HTMLParser):
    """Elements are closed in order; texts by heading."""

    def __init__(self):
        super().__init__()
        self.open, self.headings, self.cells = [], [], []

    def handle_startendtag(self, tag, attrs):
        assert tag in VOID

    def handle_starttag(self, tag, attrs):
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] in ("h1", "h2"):
            self.headings.append(data)
        if self.open and self.open[-1] == "td":
            self.cells.append(data)


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
    parser = _Checked()
    parser.feed(text)
    assert not parser.open
    wanted = ["Plan", "Side view", "Camera c", "Images", "Left out", "Weakened by robust weights"]
    assert [heading for heading in parser.headings if heading in wanted] == wanted
    assert "<b>lost</b>" in parser.cells
    assert "<b>" not in text
    assert f"sigma0 {record.sigma0:.5g}; converged" in text
    assert "beyond the threshold" in parser.cells
    assert f"{record.cameras[0].parameters[0].value:.10g}" in parser.cells
    assert not re.search(r"(?:src|href)=|url\(|https?://", text)
    assert "nan" not in text.lower().replace("nance", "")


def test_a_page_without_precisions(solved):
    text = page(record_of(solved, precisions=False))
    assert "standard ellipses" not in text
    assert "precisions none" in text


def test_all_residuals_are_in_the_record(solved):
    record = record_of(solved)
    columns, found = record.residuals, solved.residuals
    assert len(columns.dx) == len(found.image)
    norms = np.hypot(columns.dx, columns.dy)
    first = np.array(columns.image) == 0
    rms = np.sqrt(np.mean(norms[first] ** 2))
    assert rms == pytest.approx(record.images[0].rms, rel=1e-12)
    assert columns.weight.count(0.0) == 1


def _numbers(path):
    return [float(word) for word in re.findall(r"-?\d+\.?\d*", path)]


def test_arrows_stand_at_their_measures_and_keep_their_directions():
    drawing = arrows((1000, 500), np.array([[500.0, 250.0]]), np.array([[0.3, -0.4]]), "x", width=500.0)
    (path,) = re.findall(r'class="arrow" d="([^"]*)"', drawing)
    x, y, dx, dy, *_ = _numbers(path)
    assert (x, y) == (250.0, 125.0)
    assert dy / dx == pytest.approx(-4 / 3, rel=0.02)
    # 0.06 of the frame is 60 px for 0.5 px: enlarged 100 times, half of it on paper
    assert dx == pytest.approx(0.3 * 100 / 2, abs=0.1)


def test_a_radial_error_shows_in_the_profile():
    rng = np.random.default_rng(0)
    xy = rng.uniform(0, 1000, (4000, 2))
    arms = xy - 500.0
    drawing = radial_profile((500.0, 500.0), xy, arms / 500.0, "x")
    (mean,) = re.findall(r'class="first" d="M([^"]*)"', drawing)
    heights = [float(pair.split()[1]) for pair in mean.split("L")]
    assert all(a > b for a, b in itertools.pairwise(heights))


def test_the_histogram_counts_what_is_beyond():
    values = np.concatenate([np.random.default_rng(1).normal(size=500), [9.0, -7.0]])
    drawing = histogram(values, "x")
    assert "(2 beyond 4)" in drawing
    assert drawing.count('class="bin"') == 32
    assert "beyond" not in histogram(values[:500] * 0.1, "x")


def test_the_grid_without_distortion_is_that_of_the_image():
    given = grid_of((1000, 800), 900.0)
    straight = undistorted_grid(given, given, "x")
    before, after = (re.findall(rf'class="{name}" d="([^"]*)"', straight)[0] for name in ("given", "first"))
    assert before == after
    camera = Camera("c", 1000, 800, 900.0, distortion={"K1": -0.2})
    moved = 900.0 * camera.undistorted((given - [500.0, 400.0]) / 900.0) + [500.0, 400.0]
    bent = undistorted_grid(given, moved, "x")
    assert re.findall(r'class="given" d="([^"]*)"', bent) != re.findall(r'class="first" d="([^"]*)"', bent)


def test_the_page_of_a_stored_result_is_that_of_the_solution(solved, tmp_path, capsys):
    """Nothing is computed again, and nothing but the file is needed."""
    record = record_of(solved)
    path = tmp_path / "bundle.json"
    path.write_text(record.to_json())
    assert read_block_record(path) == record
    code = main(["report", str(path), f"--out={tmp_path / 'again'}"])
    assert code == (0 if record.is_complete else 1)
    assert (tmp_path / "again/bundle.html").read_text() == page(record)
    assert (tmp_path / "again/bundle.json").read_text() == record.to_json()
    assert "Bundle adjustment: sigma0" in capsys.readouterr().out
    assert {form.name for form in FORMATS} == {"json", "html", "text"}


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ('"version": 4', '"version": 3', "format obseq-bundle 3 is not read"),
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
        read_block_record(path)


def test_the_tests_of_all_image_points_are_in_the_record(solved):
    record, found = record_of(solved), solved.reliability()
    columns = record.reliability.all
    assert len(columns.w_x) == len(record.residuals.dx)
    assert sum(columns.redundancy_x) + sum(columns.redundancy_y) == pytest.approx(
        record.reliability.redundancy
    )
    worst = record.reliability.worst[0]
    names = [
        (record.images[i].name, record.points[p].name)
        for i, p in zip(record.residuals.image, record.residuals.point, strict=True)
    ]
    row = names.index((worst.image, worst.point))
    assert (columns.w_x[row], columns.redundancy_y[row]) == (worst.w[0], worst.redundancy[1])
    np.testing.assert_array_equal(columns.detectable_y, found.detectable[:, 1])


@pytest.mark.parametrize(("value", "expected"), [(1.0, 1.0), (9.99, 5.0), (0.02, 0.02), (3e4, 2e4)])
def test_round_numbers(value, expected):
    assert math.isclose(round_below(value), expected)


def test_a_camera_without_size_is_drawn(solved):
    measures = solved.block.sets[0].measures
    block = BundleAdjustment()
    block.add_cameras(Camera("c", 0, 0, 1800.0, [1000.0, 750.0], (2, 0, 0)))
    block.add_poses(solved.poses)
    block.add_approximations(solved.points, solved.coordinates)
    block.add_measures(measures.rows(measures.point < 29))
    solution = block.solve(datum="centres")
    assert page(record_of(solution)).count("<svg") == 2 + 4 + len(solution.poses)


def _luminance(colour):
    """Of WCAG 2, from `#rrggbb`."""
    parts = np.array([int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5)])
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def test_what_is_bad_can_be_read_on_light_and_on_dark_paper():
    light, dark = (_luminance(colour) for colour in re.findall(r"--bad:(#[0-9a-f]{6})", STYLE))
    for paper in ("#ffffff", "#eeeeee"):  # even rows are shaded
        assert (_luminance(paper) + 0.05) / (light + 0.05) >= 4.5
    for paper in ("#121212", "#303030"):
        assert (dark + 0.05) / (_luminance(paper) + 0.05) >= 4.5


def test_the_circle_about_a_measure_in_a_corner_is_whole():
    xy, residuals = np.array([[0.0, 0.0], [2000.0, 1500.0]]), np.ones((2, 2))
    drawing = arrows((2000, 1500), xy, residuals, "residuals", suspected=np.array([True, True]))
    left, top, width, height = map(float, re.search(r'viewBox="([^"]*)"', drawing)[1].split())
    circles = re.findall(r'<circle class="suspect" cx="([^"]*)" cy="([^"]*)" r="([^"]*)"', drawing)
    assert len(circles) == 2
    for x, y, r in (map(float, circle) for circle in circles):
        assert left < x - r
        assert x + r < left + width
        assert top < y - r
        assert y + r < top + height
