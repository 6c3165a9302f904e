"""What a network says of its quality when asked: reliability, snooping, variance components, ellipses."""

import json
import math
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest
from distances import SIGMA, distances
from scipy import special
from scipy.stats import chi2

from obseq.errors import InputError
from obseq.records.quality import StatisticsRecord
from obseq.report.adjusted import outcome
from obseq.report.page import page
from obseq.report.result_file import read_json, to_json
from obseq.report.summary import VERBOSE, listing, summary
from obseq.survey import Network, Quality
from obseq.survey.adjustment import adjusted_records


@pytest.fixture(scope="module")
def demo() -> Network:
    data = files("obseq.survey") / "data"
    return Network.read(str(data / "demo.obs"), str(data / "demo.cor"), frame="RTL", points_crs="IGNF:LAMB93")


def test_redundancy_numbers_sum_up_and_standardise_the_residuals(demo) -> None:
    record = demo.adjust().record()
    parts = [row.redundancy for row in (*record.observations, *record.constraints)]
    assert sum(parts) == pytest.approx(record.redundancy, abs=1e-9)
    for row in record.observations:
        expected = row.residual / (row.sigma * math.sqrt(row.redundancy))
        assert row.standardised_residual == pytest.approx(expected, rel=1e-6)
        assert row.tau == pytest.approx(expected / record.global_test.sigma0, rel=1e-6)
        assert row.blunder == pytest.approx(-row.residual / row.redundancy, rel=1e-6)
        assert row.detectable == pytest.approx(4.132148 * row.sigma / math.sqrt(row.redundancy), rel=1e-6)
    assert record.reliability.critical == pytest.approx(-special.ndtri(0.0005))


def test_nothing_is_computed_that_was_not_asked_for(demo, monkeypatch) -> None:
    monkeypatch.setattr("obseq.survey.fieldwork.snooped", None)
    for name in ("reliability", "_components", "relative_precision"):
        monkeypatch.setattr(f"obseq.survey.adjustment.quality.{name}", None)
    record = demo.adjust(quality=Quality(reliability=False)).record()
    assert (record.reliability, record.snooping, record.variance_components, record.relative) == (None,) * 4
    assert "redundancy" not in record.to_dict()["observations"][0]


def test_snooping_leaves_out_a_planted_blunder_and_says_what_it_changed(tmp_path) -> None:
    clean = distances(tmp_path).adjust()
    network = distances(tmp_path, blunder=0.03)
    record = network.adjust(quality=Quality(snooping="w")).record()
    (rejection,) = record.snooping.rejections
    assert rejection.row == 4
    assert rejection.observation.startswith("Dist B -> Q")
    assert rejection.blunder == pytest.approx(0.03, abs=4 * SIGMA)
    rejected = record.observations[4]
    assert (rejected.active, rejected.rejected) == (False, True)
    assert rejected.residual == pytest.approx(-rejection.blunder, rel=0.2)
    assert record.n_observations == 14
    assert record.snooping.most_moved == "Q"
    assert record.snooping.moved > 0.005
    found = {point.name: (point.x, point.y, point.z) for point in record.points}
    for name, place in zip(clean.points.names, clean.points.coordinates, strict=True):
        assert math.dist(found[name], place) < 6 * SIGMA
    assert network.book.observations.active.all()  # what was given stays as it was


def test_without_a_blunder_nothing_is_left_out_and_the_report_says_so(tmp_path) -> None:
    record = distances(tmp_path).adjust(quality=Quality(snooping="tau", ellipses=0.95)).record()
    assert record.snooping.rejections == ()
    assert "0 left out; no test rejects any more" in listing(outcome(record))


def test_a_blunder_that_the_global_test_accepts_is_named_first(tmp_path) -> None:
    record = distances(tmp_path, blunder=0.0112, seed=5, scale=0.3).adjust().record()
    assert record.global_test.passed
    text = summary(outcome(record), detail=VERBOSE)
    (largest,) = [line for line in text.splitlines() if line.startswith("  largest w")]
    assert "1 beyond" in largest
    assert text.index("n.obs:") == text.index("n.obs:5")


def test_ellipses_are_those_of_the_level_and_of_the_sigmas_asked_for(demo) -> None:
    plain = demo.adjust().record()
    scaled = demo.adjust(quality=Quality(ellipses=0.95)).record()
    prior = demo.adjust(quality=Quality(ellipses=0.95, a_priori=True)).record()
    estimated = math.sqrt(2 * special.fdtri(2, plain.redundancy, 0.95))
    given = math.sqrt(special.chdtri(2, 0.05)) / plain.global_test.sigma0
    for k in range(4):
        axis = plain.points[k].ellipse.semi_major
        assert scaled.points[k].ellipse.semi_major == pytest.approx(estimated * axis)
        assert prior.points[k].ellipse.semi_major == pytest.approx(given * axis)
        assert prior.points[k].sx == pytest.approx(plain.points[k].sx / plain.global_test.sigma0)
    assert (plain.precision, prior.precision) == ("a posteriori", "a priori")


def test_relative_precisions_of_points_that_observations_join(demo) -> None:
    adjusted = demo.adjust(quality=Quality(relative=True))
    record = adjusted.record()
    pairs = [(item.first, item.second) for item in record.relative]
    assert pairs == [("PtA", "PtB"), ("PtA", "PtC"), ("PtB", "PtD"), ("PtC", "PtD")]
    places = dict(zip(adjusted.points.names, adjusted.points.coordinates, strict=True))
    for item in record.relative:
        assert item.distance == pytest.approx(math.dist(places[item.first], places[item.second]))
        assert 0.0 < item.precision <= item.ellipse.semi_major * 1.0001


def test_points_on_one_vertical_have_no_bearing_and_no_relative_precision(tmp_path) -> None:
    (tmp_path / "n.obs").write_text("4 A P 0.0001 0.001\n4 A P 0.0 0.001\n", encoding="utf-8")
    (tmp_path / "n.cor").write_text("1 A 0 0 0 0.001 0.001 0.001\n4 P 0 0 0\n", encoding="utf-8")
    network = Network.read(tmp_path / "n.obs", tmp_path / "n.cor", frame="Local")
    record = network.adjust(quality=Quality(relative=True)).record()
    (pair,) = record.relative
    assert pair.distance < pair.precision
    assert pair.bearing_precision is None
    (row,) = [line for line in listing(outcome(record)).splitlines() if line.split()[:2] == ["A", "P"]]
    assert len(row.split()) == 7  # of two names, distance, its precision, ellipse: neither ppm nor bearing
    assert page(record)
    (tmp_path / "n.obs").write_text("4 A P 0 0.001\n4 A P 0 0.001\n", encoding="utf-8")
    network = Network.read(tmp_path / "n.obs", tmp_path / "n.cor", frame="Local")
    assert network.adjust(quality=Quality(relative=True)).record().relative is None


def test_ellipsoids_hold_the_whole_covariance_with_ends_above_the_horizon(demo) -> None:
    record = demo.adjust(quality=Quality(ellipsoids=True)).record()
    for point in record.points:
        ends = [
            (math.cos(e) * math.sin(b), math.cos(e) * math.cos(b), math.sin(e))
            for b, e in zip(point.ellipsoid.bearings, point.ellipsoid.elevations, strict=True)
        ]
        assert all(0.0 <= angle <= math.pi / 2 for angle in point.ellipsoid.elevations)
        axes = np.array(ends).T * np.array(point.ellipsoid.axes)
        rebuilt = (axes @ axes.T)[np.triu_indices(3)]
        np.testing.assert_allclose(rebuilt, point.covariance, atol=1e-12)


def test_effects_name_the_point_that_a_bias_moves_most(demo) -> None:
    adjusted = demo.adjust(quality=Quality(effects=True))
    row = adjusted.record().observations[2]
    moved = demo.book.observations.values.copy()
    moved[2] += row.detectable * 1e-3
    book = replace(demo.book, observations=replace(demo.book.observations, values=moved))
    again = replace(demo, book=book).adjust()
    k = adjusted.points.names.index(row.effect.point)
    shifts = 1e3 * (again.points.coordinates - adjusted.points.coordinates)
    assert int(np.argmax(np.linalg.norm(shifts, axis=1))) == k
    np.testing.assert_allclose(shifts[k], [row.effect.x, row.effect.y, row.effect.z], rtol=2e-3, atol=1e-5)


def test_inner_precisions_are_those_of_comp3d(shared_data) -> None:
    folder = shared_data / "comp3d-no-redundancy"
    expected = json.loads((folder / "expected.json").read_text(encoding="utf-8"))["points"]
    adjusted = Network.read_project(folder / "project.comp").adjust(quality=Quality(inner=True))
    for name, covariance in zip(adjusted.points.names, adjusted.inner, strict=True):
        found = covariance[np.triu_indices(3)]
        np.testing.assert_allclose(found, expected[name]["cov6"], rtol=1e-5, atol=1e-12, err_msg=name)
    record = adjusted.record()
    assert record.points[0].inner[0] == pytest.approx(math.sqrt(adjusted.inner[0, 0, 0]))
    assert record.points[0].sx == pytest.approx(record.points[0].inner[0])  # its datum is that already


def test_variance_components_scale_the_sigmas_that_they_find_wrong(tmp_path) -> None:
    record = distances(tmp_path, scale=3.0, seed=3).adjust(quality=Quality(variance_components=True)).record()
    (component,) = record.variance_components
    assert component.group == "Dist"
    assert component.supported
    assert component.redundancy == pytest.approx(record.redundancy)
    assert record.variance_factor == pytest.approx(1.0, abs=1e-6)
    assert record.observations[0].sigma == pytest.approx(SIGMA * component.sigma_factor)


def test_the_record_comes_back_with_all_of_it_and_the_listing_fits(tmp_path) -> None:
    everything = Quality(snooping="w", relative=True, ellipses=0.9, level=0.01)
    record = distances(tmp_path, blunder=0.03).adjust(quality=everything).record()
    (tmp_path / "a.json").write_text(to_json(record), encoding="utf-8")
    assert read_json(tmp_path / "a.json") == record
    text = listing(outcome(record))
    assert max(map(len, text.splitlines())) <= 120
    for words in (
        "rejected",
        "ellipses 90 %",
        "Pairs. Precisions",
        "limit 2.58",
    ):
        assert words in text


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"snooping": "z"}, 'snooping must be "w" or "tau" or None'),
        ({"level": 5}, "not between 0 and 1"),
        ({"ellipses": 95}, "not between 0 and 1"),
        ({"relative": "yes"}, "relative must be True or False"),
    ],
)
def test_wrong_wishes_are_refused(wrong, message) -> None:
    with pytest.raises(InputError, match=message):
        Quality(**wrong)


def test_inner_precisions_do_not_depend_on_what_is_known(tmp_path) -> None:
    network = distances(tmp_path)
    wanted = Quality(inner=True, a_priori=True)
    tight = network.adjust(quality=wanted).inner
    loose = np.where(np.isnan(network.points.sigmas), np.nan, 0.0005)
    other = replace(network, points=replace(network.points, sigmas=loose)).adjust(quality=wanted).inner
    np.testing.assert_allclose(other, tight, rtol=0.02, atol=1e-9)


def test_factors_of_sigmas_are_tested_by_the_chi_square_of_their_redundancy() -> None:
    rows = [
        StatisticsRecord("DIST", 9, 0, redundancy, 1.0, 0.0, 2.0, factor)
        for redundancy, factor in ((6.0, 1.2), (1.0, 0.9), (0.99, 1.1), (4.0, None), (None, 1.0))
    ]
    six, one, *others = adjusted_records.tested_types(rows)
    assert all((row.lower, row.upper, row.level) == (None, None, None) for row in others)
    for row, freedom in ((six, 6.0), (one, 1.0)):
        assert row.level == 0.005  # two are tested, at 1 % together
        assert row.lower is not None and row.upper is not None
        assert chi2.cdf(freedom * row.lower**2, freedom) == pytest.approx(0.0025)
        assert chi2.sf(freedom * row.upper**2, freedom) == pytest.approx(0.0025)
