"""Snooping leaves out what the diagnosis accuses, where nothing else explains it as well."""

from dataclasses import replace

import numpy as np
import pytest
from distances import SIGMA, distances

from obseq.diagnosis.engine import Search
from obseq.survey import Network, Quality
from obseq.survey.kinds.registry import BY_CODE

W, TAU = Quality(snooping="w"), Quality(snooping="tau")


def scaled(network, factor):
    rows = network.book.observations
    return replace(
        network, book=replace(network.book, observations=replace(rows, sigmas=factor * rows.sigmas))
    )


def with_errors(network, errors):
    values = network.book.observations.values.copy()
    for row, error in errors.items():
        values[row] += error
    rows = replace(network.book.observations, values=values)
    return replace(network, book=replace(network.book, observations=rows))


def test_two_large_errors_go_and_the_rest_is_as_without_them(tmp_path):
    clean, errors = distances(tmp_path), {4: 30.0, 9: -0.5}
    without = np.isin(np.arange(15), list(errors))
    expected = replace(clean, book=clean.book.without(without)).adjust()
    adjusted = with_errors(clean, errors).adjust(quality=W)
    told = adjusted.record().snooping
    assert {(item.row, item.companions) for item in told.rejections} == {(4, 0), (9, 0)}
    np.testing.assert_allclose(adjusted.points.coordinates, expected.points.coordinates, atol=1e-8)
    assert {item.row: item.blunder for item in told.rejections} == pytest.approx(errors, abs=5 * SIGMA)
    assert all(item.statistic > 5.0 and item.p_value < 1e-6 for item in told.rejections)
    assert adjusted.quality.rejected.tolist() == without.tolist()
    assert adjusted.solution.redundancy == expected.solution.redundancy


def test_sigmas_that_are_all_too_large_hide_an_error_from_w_and_not_from_tau(tmp_path):
    network = scaled(distances(tmp_path, blunder=0.03), 5.0)
    assert not network.adjust(quality=W).record().rejections
    (found,) = network.adjust(quality=TAU).record().rejections
    assert found.row == 4 and found.blunder == pytest.approx(0.03, abs=4 * SIGMA)


def test_one_search_serves_whatever_the_factor_of_the_sigmas_is(tmp_path, monkeypatch):
    searches, search = [], Search.at_first
    monkeypatch.setattr(Search, "at_first", lambda own: searches.append(own) or search(own))
    found = scaled(distances(tmp_path, blunder=0.3), 0.2).adjust(quality=TAU).record().rejections
    assert [one.row for one in found] == [4] and len(searches) == 1


def test_sigmas_that_are_all_too_small_invent_no_error_for_tau(tmp_path):
    record = scaled(distances(tmp_path), 0.2).adjust(quality=TAU).record()
    assert record.snooping.rejections == () and record.snooping.end == "no test rejects any more"
    found = scaled(distances(tmp_path, blunder=0.1), 0.2).adjust(quality=TAU).record()
    assert [error.observations[0].row for error in found.diagnosis.accused] == [4]


def test_a_larger_probability_of_leaving_out_what_is_right_lets_smaller_errors_be_seen(tmp_path):
    network = distances(tmp_path, blunder=0.0145, seed=5, scale=0.3)
    gone = [
        len(network.adjust(quality=Quality(snooping="w", snooping_level=level)).record().rejections)
        for level in (1e-6, 0.3)
    ]
    assert gone == [0, 1]


def test_a_detectable_error_is_found_with_the_power_that_the_tests_have(tmp_path):
    (found,) = distances(tmp_path, blunder=0.03).adjust(quality=W).record().rejections
    spread = found.blunder / found.statistic
    assert 3.5 * spread < found.detectable < 5.5 * spread


def test_a_known_coordinate_that_is_wrong_is_named_and_stays(tmp_path):
    network = distances(tmp_path)
    coordinates = network.points.coordinates.copy()
    coordinates[network.points.index["A"], 0] += 0.2
    record = (
        replace(network, points=replace(network.points, coordinates=coordinates)).adjust(quality=W).record()
    )
    assert not record.rejections and "corrected and not left out" in record.snooping.end
    (suspect,) = record.snooping.suspects
    assert suspect.startswith("known x of A")


def test_of_two_lines_that_contradict_each_other_none_is_left_out(tmp_path):
    code = next(code for code, kind in BY_CODE.items() if kind.name == "DH")
    lines = [f"{code} A P 1.0 0.001", f"{code} A P 1.1 0.001"]
    (tmp_path / "l.obs").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (tmp_path / "l.cor").write_text("1 A 0 0 5 0\n2 P 10 0 6 0\n", encoding="utf-8")
    record = Network.read(tmp_path / "l.obs", tmp_path / "l.cor", frame="Local").adjust(quality=W).record()
    assert not record.rejections and "cannot tell which" in record.snooping.end
    assert len(record.snooping.suspects) == 1
