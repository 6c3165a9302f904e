"""Local systems whose axes point elsewhere than east and north."""

import numpy as np
import pytest

from obseq import crs
from obseq.errors import CrsError


def test_south_and_west_are_minus_north_and_minus_east():
    # 30 m east, 40 m north of the origin: -40 to the south, -30 to the west.
    to_file = crs.Transformer(crs.parse("Local"), crs.parse("Local*sw"))
    assert to_file.forward([[30.0, 40.0, 5.0]]).tolist() == [[-40.0, -30.0, 5.0]]
    assert to_file.inverse([[-40.0, -30.0, 5.0]]).tolist() == [[30.0, 40.0, 5.0]]


def test_two_pairs_of_axes_convert_to_each_other():
    turn = crs.Transformer(crs.parse("Local*ne"), crs.parse("Local*en")).turn
    assert np.array_equal(turn, [[0, 1, 0], [1, 0, 0], [0, 0, 1]])


@pytest.mark.parametrize("other", ["Local*ee", "LocalSite", "EPSG:4326"])
def test_other_systems_remain_apart(other):
    with pytest.raises(CrsError):
        crs.Transformer(crs.parse("Local"), crs.parse(other))
