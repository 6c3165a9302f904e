"""Causes are named in networks of 34 to 57 points too, where a wrong point or set-up is far from most others.

What saves trials in small networks may lose right causes here: a wrong known point drags others along, and
the contradictions of one set-up are few of many.
"""

import numpy as np
import pytest

from obseq.survey.screening.findings import Cause


@pytest.mark.parametrize(
    ("mistake", "seed"),
    [
        ("mistyped_coordinate", 10),
        ("exchanged_known_points", 17),
        ("station_in_degrees", 3),
        ("station_anticlockwise", 2),
    ],
)
def test_a_wrong_point_and_a_wrong_set_up_are_named_first(planted, mistake, seed):
    count = planted.counted(getattr(planted, mistake), range(seed, seed + 1), planted.LARGE)
    assert (count.named, count.first) == (1, 1)


def test_a_known_point_a_hundred_kilometres_off_is_named(planted, tmp_path):
    random = np.random.default_rng(19)
    site = planted.made_site(random, planted.LARGE)
    words = site.cor[int(random.integers(len(site.cor)))]
    words[3] = repr(float(words[3]) + 1e5)
    (error,) = site.read(tmp_path).gross_errors()
    assert error.cause is Cause.MISTYPED and error.points == (words[1],)
    assert error.text.endswith("northing (y): one digit is wrong")


def test_an_honest_large_network_raises_no_alarm(planted):
    assert planted.counted(None, range(7, 8), planted.LARGE).announced == 0
