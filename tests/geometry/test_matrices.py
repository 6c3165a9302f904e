"""Small matrices, and sums over owners."""

import numpy as np

from obseq.geometry import sums_by_owner


def test_sums_go_to_their_owners() -> None:
    parts = np.arange(12.0).reshape(3, 2, 2)
    found = sums_by_owner(parts, np.array([2, 0, 2]), 4)
    assert found.tolist() == [
        parts[1].tolist(),
        [[0, 0], [0, 0]],
        (parts[0] + parts[2]).tolist(),
        [[0, 0], [0, 0]],
    ]
