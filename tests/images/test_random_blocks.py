"""Random blocks of images come out as an independent adjuster says, to 1e-3 standard deviations."""

import pytest
from referee.generated_blocks import block_case
from referee.judged_blocks import judge_block

SEEDS = (0, 2, 8, 9, 10, 11, 14, 87, 137, 266, 340)
"""Of `tools/benchmarks/bench_independent.py --blocks`: surveys, rigs, clinometers, lengths, free blocks."""


@pytest.mark.parametrize("seed", SEEDS)
def test_a_block_agrees_with_the_referee(tmp_path, seed):
    verdict = judge_block(seed, block_case(seed), tmp_path)
    assert verdict is not None
    assert verdict.said == ""
    assert verdict.worst() <= 1.0, verdict
    assert verdict.more <= 3


def test_a_free_block_with_clinometers_comes_back_by_a_turn_about_the_vertical(tmp_path):
    verdict = judge_block(23, block_case(23), tmp_path)
    assert verdict.worst() <= 1.0, verdict
    assert verdict.more <= 3
