"""Numbers of the columns of the page: many at once come out as one after the other."""

import math

import numpy as np
import pytest

from obseq.report.tables.columns import MANY, all_rounded, all_small, rounded, small

ODD = [None, math.nan, math.inf, -math.inf, 0.0, -0.0, 5e-324, 1e-30, 1.5e22, 1e23, 1.7e308, 7.0]
EDGES = [
    sign * 10.0**k * (1.0 + e)
    for k in range(-18, 25)
    for e in (-1e-6, -1e-16, 0.0, 1e-16, 1e-6)
    for sign in (1, -1)
]


@pytest.fixture
def numbers() -> list[float | None]:
    chance = np.random.default_rng(5)
    return [*ODD, *EDGES, *(chance.standard_normal(2000) * 10.0 ** chance.uniform(-20, 25, 2000)).tolist()]


def test_many_small_numbers_come_out_as_single_ones(numbers: list[float | None]) -> None:
    assert len(numbers) > MANY
    assert list(map(repr, all_small(numbers))) == [repr(small(value)) for value in numbers]
    assert list(map(repr, all_small(ODD))) == [repr(small(value)) for value in ODD]


def test_many_rounded_numbers_come_out_as_single_ones(numbers: list[float | None]) -> None:
    places = [(5, 9)[k % 2] for k in range(len(numbers))]
    singly = [rounded(value, digits) for value, digits in zip(numbers, places, strict=True)]
    assert list(map(repr, all_rounded(numbers, places))) == list(map(repr, singly))
    assert list(map(repr, all_rounded(numbers))) == [repr(rounded(value)) for value in numbers]
