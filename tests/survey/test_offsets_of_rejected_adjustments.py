"""What many observations share, or a known point, is named where no single observation stands out."""

import numpy as np
import pytest

from obseq.survey import Network
from obseq.survey.screening import shared_offsets
from obseq.survey.screening.added_unknowns import AddedUnknowns
from obseq.survey.screening.findings import Cause

PLACES = np.array(
    [(0, 0, 240), (800, 100, 260), (1700, -50, 300), (300, 700, 250), (1100, 800, 310), (1500, 1500, 270)],
    dtype=float,
)
KNOWN = (0, 2, 5)
GON, ANGLE, LENGTH, POINT = np.pi / 200.0, 0.6e-3, 0.004, 0.004


@pytest.fixture
def adjusted(tmp_path):
    """The adjustment of six points that all see each other, with noise, with something wrong, and what is."""

    def made(
        seed, *, constant=0.0, prism=0.0, index=0.0, height=0.0, moved=(0.0, 0.0), blunder=0.0, noise=1.0
    ):
        random, lines = np.random.default_rng(seed), []
        for i, here in enumerate(PLACES):
            turn = random.uniform(0.0, 400.0)
            for n, j in enumerate(k for k in range(len(PLACES)) if k != i):
                x, y, z = PLACES[j] - here - [0.0, 0.0, height if i == 1 else 0.0]
                flat = np.hypot(x, y)
                hz = (np.arctan2(x, y) / GON - turn + noise * random.normal(0, ANGLE)) % 400.0
                zenith = np.arctan2(flat, z) / GON + index + noise * random.normal(0, ANGLE)
                length = (
                    np.hypot(flat, z)
                    + prism
                    + (constant if i == 4 else 0.0)
                    + noise * random.normal(0, LENGTH)
                )
                length += blunder if (i, j) == (3, 5) else 0.0
                lines.append(f"{7 if n == 0 else 5} P{i} P{j} {hz:.5f} {ANGLE}")
                lines += [f"6 P{i} P{j} {zenith:.5f} {ANGLE}", f"3 P{i} P{j} {length:.4f} {LENGTH}"]
        given = PLACES + np.random.default_rng(seed + 1).normal(0, POINT, PLACES.shape)
        given[2, : len(moved)] += moved
        rows = [
            f"{1 if k in KNOWN else 0} P{k} {x:.4f} {y:.4f} {z:.4f}" + f" {POINT}" * 3 * (k in KNOWN)
            for k, (x, y, z) in enumerate(given)
        ]
        for name, text in (("n.obs", lines), ("n.cor", rows)):
            (tmp_path / name).write_text("\n".join(text) + "\n")
        return Network.read(str(tmp_path / "n.obs"), str(tmp_path / "n.cor"), refraction=1.0).adjust()

    return made


def test_the_constant_of_one_set_up_is_not_taken_for_sigmas(adjusted):
    (error,) = adjusted(1, constant=0.035).gross_errors
    assert error.cause == Cause.DISTANCES and error.what.startswith("the 5 distances from P4")
    assert float(error.text.split()[0]) == pytest.approx(-0.035, abs=0.008)


def test_an_index_error_of_all_zenith_angles_is_not_taken_for_noise(adjusted):
    (error,) = adjusted(2, index=0.02).gross_errors
    assert error.cause == Cause.INDEX and error.what.startswith("the 30 zenith angles (the first")
    assert float(error.text.split()[0]) == pytest.approx(-0.02, abs=0.0005)


def test_a_height_of_instrument_that_each_of_ten_angles_shows_a_little_is_named(adjusted):
    """At 900 m ten centimetres are eight sigmas of each angle."""
    (error,) = adjusted(3, height=0.1).gross_errors
    assert error.cause == Cause.HEIGHT
    assert error.what.startswith("height of the instrument of 10 observations from P1")
    assert error.text.startswith("0.0000 m is written, 0.1044 m fits") and "left out" in error.text


def test_a_known_point_that_moved_in_plan_is_one_finding(adjusted):
    (error,) = adjusted(4, moved=(0.06, -0.04)).gross_errors
    assert error.points == ("P2",) and error.cause == Cause.MISTYPED
    words = error.text.split()
    assert words[words.index("x") + 2] == "m,"  # a length, whatever the unit of the coordinates
    x, y = (float(words[words.index(axis) + 1].strip(",")) for axis in "xy")
    assert (x, y) == (pytest.approx(0.06, abs=0.015), pytest.approx(-0.04, abs=0.015))


@pytest.mark.parametrize("noise", [1.0, 3.0])
def test_nothing_is_accused_where_nothing_or_all_sigmas_are_wrong(adjusted, noise):
    assert [adjusted(seed, noise=noise).gross_errors for seed in range(10, 22)] == [()] * 12


def test_a_bench_mark_and_the_prism_are_told_together(adjusted):
    """Neither is enough by itself: the sigmas of the distances were blamed, with exit code 0."""
    prism, mark = adjusted(5, prism=0.035, moved=(0.0, 0.0, 0.06)).gross_errors
    assert prism.cause == Cause.DISTANCES and prism.what.startswith("the 30 distances")
    assert float(prism.text.split()[0]) == pytest.approx(-0.035, abs=0.004)
    assert mark.points == ("P2",) and mark.text.startswith(
        "without its height the adjustment is accepted, where"
    )
    words = mark.text.split()
    assert float(words[words.index("off") + 3]) == pytest.approx(0.06, abs=0.02)


def test_two_offsets_are_told_together(adjusted):
    """Right angles and the scatter of all of them were told."""
    index, constant = adjusted(6, index=0.006, constant=0.04).gross_errors
    assert index.cause == Cause.INDEX and index.what.startswith("the 30 zenith angles")
    assert constant.cause == Cause.DISTANCES and constant.what.startswith("the 5 distances from P4")


def test_an_offset_and_one_wrong_observation_are_no_two_offsets(adjusted):
    """The distance from P3 to P5 is wrong; with the prism, offsets of either point take up a part of that."""
    found = adjusted(7, prism=0.03, blunder=0.05).gross_errors
    assert all(
        "30 Dist" in error.what or "30 distances" in error.what or "P3 -> P5" in error.what for error in found
    )


def test_an_observation_beside_an_offset_is_tested_as_a_column_with_one_entry(adjusted, monkeypatch):
    seen = []
    monkeypatch.setattr(shared_offsets, "_two", lambda tests: seen.append(tests) or ())
    adjusted(5, prism=0.035, moved=(0.0, 0.0, 0.06))
    (tests,) = seen
    columns, quality = tests.unknowns.columns[:, :1], tests.found.adjustment.quality.observations
    every = np.hstack([columns, np.eye(len(columns))])
    both = AddedUnknowns.of(tests.found, every, np.zeros(0, np.int64))
    largest = max(both.test((0, 1 + row))[0] for row in range(len(columns)))
    found = tests.unknowns.with_one_observation((0,), quality.redundancy)
    assert found == pytest.approx(largest, rel=1e-9)
    assert found > tests.unknowns.test((0,))[0] + 1.0
