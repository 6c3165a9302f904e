"""Barycentres: points in the middle of others, in numbers that a person can follow."""

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.formats.tables.writer import table_text
from obseq.survey import Network

POINTS = """name,x,y,z,sx,sy,sz
A,0,0,10,0.001,0.001,0.001
B,30,0,10,0.001,0.001,0.001
C,0,60,40,0.001,0.001,0.001
M,,,,,,
N,,,,,,
"""
HEAD = "type,from,to,value,sigma,unit\n"
ROWS = HEAD + "Barycentre,M,A B C,0,0.002,m\nBarycentre,N,A B,0,0.002,m\n"


def network(folder, rows=ROWS, points=POINTS):
    (folder / "o.csv").write_text(rows)
    (folder / "p.csv").write_text(points)
    return Network.read_project([folder / "o.csv", folder / "p.csv"])


def test_barycentres_of_two_and_of_three_points(tmp_path):
    adjusted = network(tmp_path).adjust()
    rows = dict(zip(adjusted.points.names, adjusted.points.coordinates, strict=True))
    np.testing.assert_allclose(rows["M"], (10, 20, 20), atol=1e-9)
    np.testing.assert_allclose(rows["N"], (15, 0, 10), atol=1e-9)
    assert (adjusted.solution.n_unknowns, adjusted.solution.redundancy) == (15, 0)
    # the mean of three points of 1 mm, and 2 mm of its own
    covariance = adjusted.points.covariances[adjusted.points.names.index("M")]
    np.testing.assert_allclose(covariance, (1e-6 / 3 + 4e-6) * np.eye(3), rtol=1e-9, atol=1e-15)


def test_a_member_is_found_from_the_barycentre(tmp_path):
    # M is held in the middle of A, B and Q: Q is three times M, less A and B
    rows = HEAD + "Barycentre,M,A B Q,0,0.001,m\nDistHz,A,Q,47.4,5,m\nDH,A,Q,0,5,m\n"
    points = POINTS.replace("M,,,,,,", "M,10.1,15.9,10,0,0,0").replace("N,,,,,,", "Q,1,47,10,,,")
    adjusted = network(tmp_path, rows, points).adjust()
    found = adjusted.points.coordinates[adjusted.points.names.index("Q")]
    np.testing.assert_allclose(found, 3 * np.array([10.1, 15.9, 10]) - (30, 0, 20), atol=1e-3)


def test_offsets_and_single_coordinates(tmp_path):
    rows = HEAD + "BaryX,M,A B,1.5,0.002,m\nBaryY,M,A C,0,0.002,m\nBaryZ,M,B C,-500,2,mm\n"
    points = POINTS.replace("M,,,", "M,1,2,3").replace("N,,,,,,\n", "")
    adjusted = network(tmp_path, rows, points).adjust()
    found = adjusted.points.coordinates[adjusted.points.names.index("M")]
    np.testing.assert_allclose(found, (16.5, 30.0, 24.5), atol=1e-9)


def test_a_barycentre_goes_with_a_member_that_nothing_determines(tmp_path):
    rows = ROWS + "Barycentre,Q,A X,0,0.002,m\nDist,A,X,5,0.01,m\n"
    adjusted = network(tmp_path, rows).adjust()
    assert {item.name for item in adjusted.left_out} == {"X", "Q"}
    assert adjusted.solution.redundancy == 0


def test_tables_hold_them(tmp_path):
    book = network(tmp_path).book
    (tmp_path / "again.csv").write_text(table_text(book))
    again = Network.read_project([tmp_path / "again.csv", tmp_path / "p.csv"])
    assert table_text(again.book) == table_text(book)
    assert [group.members for group in again.book.groups] == [group.members for group in book.groups]


@pytest.mark.parametrize("cells", ["M,A", "M,A A", "A,A B", ",A B", "M,"])
def test_what_is_no_barycentre_is_refused(tmp_path, cells):
    with pytest.raises(InputError, match=r"o\.csv:2: x of a barycentre: from is a point, to two or more"):
        network(tmp_path, HEAD + f"Barycentre,{cells},0,0.001,m\n")


WEIGHTED = "type,from,to,value,sigma,unit,weights\n"


def test_members_have_weights(tmp_path):
    # M: three parts of A and one of B; N: beyond B on the line from A, as the tip of a rod with two targets
    rows = WEIGHTED + "Barycentre,M,A B,0,0.002,m,3 1\nBarycentre,N,A B,0,0.002,m,-0.5 1.5\n"
    adjusted = network(tmp_path, rows).adjust()
    found = dict(zip(adjusted.points.names, adjusted.points.coordinates, strict=True))
    np.testing.assert_allclose(found["M"], (7.5, 0, 10), atol=1e-9)
    np.testing.assert_allclose(found["N"], (45, 0, 10), atol=1e-9)
    covariance = adjusted.points.covariances[adjusted.points.names.index("N")]
    np.testing.assert_allclose(covariance, (2.5e-6 + 4e-6) * np.eye(3), rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("weights", ["1", "1 2 3", "1 -1", "-1 -2"])
def test_weights_are_one_for_each_member_with_a_positive_sum(tmp_path, weights):
    with pytest.raises(InputError, match=r"o\.csv:2: x of a barycentre: . weights of sum"):
        network(tmp_path, WEIGHTED + f"Barycentre,M,A B,0,0.002,m,{weights}\n")


def test_only_barycentres_have_weights(tmp_path):
    with pytest.raises(InputError, match="slope distance: only barycentres have weights"):
        network(tmp_path, WEIGHTED + "Dist,A,B,30,0.002,m,1 2\n")
