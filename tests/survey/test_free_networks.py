"""Free networks of which one coordinate, one height or one length at height 0 is known."""

import pytest
from free_networks import SEEDS_OF_ALL, fault, free_case


@pytest.mark.parametrize("seed", range(SEEDS_OF_ALL))
def test_a_free_network_of_which_one_thing_is_known(seed):
    """`tools/benchmarks/bench_free.py` does 240: right are all."""
    assert fault(free_case(seed)) == ""
