"""What hangs together, and the way from one node to the others."""

import numpy as np

from obseq.graphs import outwards, parts

JOINS = np.array([[0, 2], [5, 2], [1, 3], [3, 1], [0, 2]]).T
"""0 - 2 - 5 and 1 - 3, some said twice; 4 is alone."""


def test_parts_are_what_joins_hold_together() -> None:
    found = parts(6, *JOINS)
    assert len(set(found.tolist())) == 3
    assert found[0] == found[2] == found[5] and found[1] == found[3] and found[4] not in found[:4]
    assert sorted(parts(2, *JOINS[:, :0]).tolist()) == [0, 1]


def test_the_nearest_come_first() -> None:
    order, before = outwards(6, *JOINS, 5)
    assert order.tolist() == [5, 2, 0]
    assert before[2] == 5 and before[0] == 2


def test_of_several_starts_each_leads_to_what_is_nearest_to_it() -> None:
    order, before = outwards(6, *JOINS, [5, 3])
    assert sorted(order[:2].tolist()) == [3, 5] and set(order.tolist()) == {0, 1, 2, 3, 5}
    assert (before[2], before[0], before[1]) == (5, 2, 3)
