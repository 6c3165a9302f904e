"""Codes against what the original's files hold, and against their definitions."""

import itertools

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.targets import made
from obseq.targets.codes import (
    hamming_codes,
    larger_set,
    least_distance,
    longest_runs,
    low_codes,
    members,
    ring_codes,
    rotated,
)


def test_a_rotation_moves_bit_i_to_i_minus_p() -> None:
    assert rotated(0b000110, 6, 1) == 0b000011
    assert rotated(0b000011, 6, 1) == 0b100001


@pytest.mark.parametrize(("bits", "count", "first"), [(12, 147, 65), (14, 516, 129), (20, 24793, 1025)])
def test_ring_codes_are_as_many_as_printed_ones(bits: int, count: int, first: int) -> None:
    codes = ring_codes(bits)
    assert (len(codes), codes[0]) == (count, first)
    assert all(code.bit_count() % 2 == 0 for code in codes)
    assert all(code == min(members(code, bits, bits)) for code in codes[:200])


def test_low_codes_stand_for_every_code_once() -> None:
    lows = low_codes(6, 3).tolist()
    everything = list(itertools.chain(*(set(members(low, 6, 3)) for low in lows)))
    assert sorted(everything) == list(range(64))


def test_runs_go_around_the_circle() -> None:
    assert longest_runs(0b100011, 6) == (3, 3)
    assert longest_runs(0, 6) == (6, 0)
    assert longest_runs(63, 6) == (0, 6)


@pytest.mark.parametrize(
    ("choice", "count"), [("former", 36), ("present", 32), pytest.param("larger", 36, marks=pytest.mark.slow)]
)
def test_sets_have_the_sizes_of_the_original_s_two_histories(choice: str, count: int) -> None:
    spec = made("IGNIndoor", choice=choice)
    assert len(spec.codes) >= count if choice == "larger" else len(spec.codes) == count
    assert spec.class_distance == 3
    assert all(
        longest_runs(code, 12)[0] <= 2 and longest_runs(code, 12)[1] <= 3 for code in spec.codes.values()
    )


def test_a_search_is_the_same_each_time() -> None:
    assert larger_set(8, 2, 3, (8, 8), trials=5) == larger_set(8, 2, 3, (8, 8), trials=5)


def test_words_of_a_hamming_code_differ_in_three_bits() -> None:
    words, length = hamming_codes(8)
    assert (length, len(words), words[1]) == (10, 64, 7)
    assert least_distance(words, 10, 1) == 3
    assert hamming_codes(12)[1] == 12


def test_distances_count_turned_codes() -> None:
    assert least_distance([0b000011, 0b001101], 6, 1) == 3
    assert least_distance([0b000011, 0b001101], 6, 6) == 1  # 001101 turned by 2 is 010011


def test_bits_of_a_class_tell_how_far_the_target_is_turned() -> None:
    spec = made("CERN", 12)
    name, code = next(iter(spec.codes.items()))
    assert (name, 5) in spec.turns[rotated(code, 12, 5)]


def test_names_of_other_bases_and_beginnings() -> None:
    spec = made("CERN", 14, base=16, before="T", digits=4, numbers={1, 20})
    assert list(spec.codes) == ["T0001", "T0014"]
    assert np.array_equal(list(spec.numbers.values()), [1, 20])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"family_name": "IGNIndor"}, "IGNIndoor"),
        ({"family_name": "IGNIndoor", "frequency": 5}, "frequency 5"),
        ({"family_name": "CERN", "bits": 13}, "even"),
        ({"family_name": "CERN", "bits": 40}, "40 bits"),
        ({"family_name": "CERN", "base": 40}, "base 40"),
        ({"family_name": "CERN", "numbers": [0]}, "no code is left"),
        ({"family_name": "IGNIndoor", "choice": "best"}, "choice"),
    ],
)
def test_what_makes_no_set_is_refused(arguments: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        made(**arguments)  # type: ignore[arg-type]
