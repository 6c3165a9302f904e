"""One gross error that explains what the sigmas do not is named; large residuals everywhere are not one."""

import json

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.leastsquares.statistics.distributions import normal_limit
from obseq.leastsquares.statistics.hypothesis_tests import limit_by_others, scaled_by_others, tau_p_values
from obseq.survey.adjustment.suspicion import suspected

POINTS = "5 R1 0 0 100 0.0002\n4 A 0 0 0\n4 B 0 0 0\n4 C 0 0 0\n5 R2 0 0 103 0.0002\n"
HONEST = ("R1 A 1.0002", "A B 0.9995", "B R2 0.9998", "R1 C 0.5003", "C B 1.4994", "C A 0.5001")


@pytest.fixture
def levelled(tmp_path, monkeypatch, capsys):
    """Adjusts a levelling network whose last line is off, and gives exit code, text and record."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "l.cor").write_text(POINTS)

    def adjusted(last="C A 0.5001", *options, sigma="0.001"):
        lines = (f"4 {line} {sigma}\n" for line in (*HONEST[:-1], last))
        (tmp_path / "l.obs").write_text("".join(lines))
        code = main(["adjust", "--obs", "l.obs", "--cor", "l.cor", "--json", "l.json", *options])
        return code, " ".join(capsys.readouterr().out.split()), json.loads((tmp_path / "l.json").read_text())

    return adjusted


def test_a_blunder_of_ten_sigmas_is_named_instead_of_the_sigmas(levelled):
    code, text, record = levelled("C A 0.5100")
    assert code == 1
    assert record["suspicion"]["observations"] == ["DH C -> A (l.obs:6)"]
    assert record["suspicion"]["blunder"] == pytest.approx(0.01, abs=3e-4)
    assert "GROSS ERROR suspected: DH C -> A (l.obs:6)" in text and "too small" not in text


def test_sigmas_that_are_all_too_small_are_said_to_be_possible_where_little_is_redundant(levelled):
    _, text, record = levelled("C A 0.5070 0.001\n4 A B 1.0018")
    assert record["suspicion"]["observations"] == ["DH C -> A (l.obs:6)"]
    assert record["suspicion"]["may_be_sigmas"]
    assert "so few observations do not exclude that all sigmas are too small" in text


def test_without_it_there_is_nothing_to_suspect(levelled):
    code, text, record = levelled()
    assert code == 0 and record.get("suspicion") is None
    assert "GROSS" not in text


def test_the_report_of_the_stored_result_says_the_same(levelled, capsys):
    levelled("C A 0.5100")
    assert main(["report", "l.json"]) == 1
    assert "GROSS ERROR suspected: DH C -> A (l.obs:6)" in capsys.readouterr().out


def test_what_snooping_left_out_takes_no_part_and_the_exit_code_says_so(levelled):
    code, text, record = levelled("C A 5.5100", "--snooping", "w")
    assert code == 1 and record.get("suspicion") is None
    assert "they take no part in this adjustment" in text and "spoil all of it" not in text


def test_leaving_the_worst_out_lowers_the_sum_of_squares_by_its_square(levelled):
    _, _, record = levelled("C A 0.5100")
    _, _, without = levelled("C A 0.5100", "--snooping", "w")
    before, after = (item["variance_factor"] * item["redundancy"] for item in (record, without))
    assert before - after == pytest.approx(record["suspicion"]["statistic"] ** 2, rel=1e-6)


def test_sigmas_too_small_everywhere_accuse_no_observation():
    w = 4.0 * np.random.default_rng(1).standard_normal(200)
    assert suspected(w, float(np.sum(w**2)) * 0.5, 100) == []


def test_all_tests_share_the_level_and_equals_are_named_together():
    limit = normal_limit(0.0005 / 10)
    w = np.r_[np.zeros(8), limit * 1.001, -limit * 1.001]
    assert suspected(w, 12.0, 10) == [8, 9]
    assert suspected(w / 1.002, 12.0, 10) == []
    assert suspected(w, 12.0, 1) == []


def test_what_remains_too_large_raises_the_limit():
    w = np.r_[np.ones(9), 6.0]
    assert suspected(w, 36.0 + 4.0, 5) == [9]
    assert suspected(w, 36.0 + 40.0, 5) == []


def test_one_blunder_is_not_lost_where_the_rest_is_barely_beyond_its_sigmas():
    """Of five redundant observations the test of tau would find it from 15 sigmas only."""
    w = np.r_[np.ones(9), 7.4]
    assert suspected(w, 7.4**2 + 3.99, 5) == suspected(w, 7.4**2 + 4.2, 5) == [9]


def test_scaled_by_the_others_is_the_test_of_tau():
    w, squares, redundancy = 6.0, 76.0, 5
    tau = w / (squares / redundancy) ** 0.5
    level = float(tau_p_values(tau, redundancy))
    assert scaled_by_others(w, squares, redundancy) == pytest.approx(6.0 / 10.0**0.5)
    assert limit_by_others(w, squares, redundancy, level) == pytest.approx(6.0 / 10.0**0.5, rel=1e-6)


def test_snooping_is_no_remedy_for_a_known_coordinate(levelled, tmp_path):
    third = "5 R3 0 0 102.5 0.0002\n"
    (tmp_path / "l.cor").write_text(POINTS.replace("103 ", "103.008 ") + third)
    code, text, record = levelled("C R3 1.9998 0.001\n4 R3 R2 0.5001")
    assert code == 1
    assert record["suspicion"]["observations"] == ["known z of R2 (l.cor:5)"]
    assert "take a known coordinate as free" in text and "--snooping" not in text
