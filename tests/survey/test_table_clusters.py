"""Correlated rows of tables: their covariance is what the cells say, in the units of the rows."""

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.formats.tables.in_memory import observations_of
from obseq.formats.tables.writer import table_text
from obseq.survey import Network

POINTS = """name,x,y,z,sx,sy,sz
A,0,0,0,0,0,0
B,30,40,0,0,0,0
P,10,20,5,,,
"""
HEAD = "type,from,to,value,sigma,unit,cluster,covariances,correlations,active\n"
ROWS = """LX,A,P,10,0.002,m,a,,,
LY,A,P,20,3,mm,a,2e-3,,
Dist,B,P,28.7228,0.004,m,,,,
LZ,A,P,5,0.005,m,a,1e-6 4e-3,,
DH,B,P,5,0.001,m,b,,,
Zen,B,P,90,0.01,gon,b,,0.5,
"""


def network(folder, rows=ROWS, head=HEAD):
    (folder / "o.csv").write_text(head + rows)
    (folder / "p.csv").write_text(POINTS)
    return Network.read_project([folder / "o.csv", folder / "p.csv"], points_crs="Local")


def test_covariances_are_in_the_units_of_both_rows(tmp_path):
    first, second = network(tmp_path).book.clusters
    assert first.rows.tolist() == [0, 1, 3]
    # 2e-3 m mm is 2e-6 m2, and 4e-3 mm m is 4e-6 m2
    expected = [[4e-6, 2e-6, 1e-6], [2e-6, 9e-6, 4e-6], [1e-6, 4e-6, 25e-6]]
    np.testing.assert_allclose(first.covariance, expected, rtol=1e-14)
    zenith = 0.01 * np.pi / 200
    np.testing.assert_allclose(
        second.covariance, [[1e-6, 0.5e-3 * zenith], [0.5e-3 * zenith, zenith**2]], rtol=1e-14
    )


def test_a_correlated_vector_has_its_part_in_the_adjustment(tmp_path):
    # x and y of P by a vector, and x once more: what x moves, y follows by its correlation
    rows = (
        "LX,A,P,10,0.002,m,a,,,\nLY,A,P,20,0.003,m,a,,0.6,\nLZ,A,P,5,0.001,m,,,,\nPx,P,,10.005,0.002,m,,,,\n"
    )
    adjusted = network(tmp_path, rows).adjust()
    # both have the same weight for x: halfway; y by 0.6 * 3 mm / 2 mm of 2.5 mm
    place = adjusted.points.coordinates[2]
    np.testing.assert_allclose(place, (10.0025, 20 + 0.6 * 1.5 * 0.0025, 5), atol=1e-9)


def test_clusters_come_back_as_they_are(tmp_path):
    before = network(tmp_path, ROWS.replace("Zen,B,P,90,0.01,gon,b,,0.5,", "Zen,B,P,90,0.01,gon,b,,0.5,0"))
    (tmp_path / "again.csv").write_text(table_text(before.book))
    again = Network.read_project([tmp_path / "again.csv", tmp_path / "p.csv"])
    for was, found in zip(before.book.clusters, again.book.clusters, strict=True):
        assert was.rows.tolist() == found.rows.tolist()
        np.testing.assert_allclose(found.covariance, was.covariance, rtol=1e-15)


def test_rows_of_formulas_are_correlated_with_others(tmp_path):
    (tmp_path / "f.csv").write_text(
        "formula,p1,p2,D,sigma,cluster,correlations\nDist3D,A,P,22.9,0.002,b,0.3 0.2\n"
    )
    network(tmp_path)
    paths = [tmp_path / name for name in ("o.csv", "f.csv", "p.csv")]
    cluster = Network.read_project(paths, points_crs="Local").book.clusters[1]
    assert cluster.rows.tolist() == [4, 5, 6]
    assert cluster.covariance[2, 0] == pytest.approx(0.3 * 0.001 * 0.002)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("1e-6 4e-3", "1e-6"), r"o\.csv:5: 1 covariances, and 2 rows of cluster a before"),
        (("1e-6 4e-3", "1e-6 x"), r"o\.csv:5: column covariances: 'x' is not a number"),
        (("mm,a,2e-3,", "mm,a,2e-3,0.1"), r"o\.csv:3: a row has covariances or correlations"),
        (("m,,,,", "m,,0.1,,"), r"o\.csv:4: a row has covariances or correlations, and the name"),
        (
            ("0.5", "1.5"),
            r"o\.csv:6: the covariance of cluster b, which begins here, is not positive definite",
        ),
        (("LX,A,P", "Barycentre,P,A B"), r"o\.csv:2: a barycentre in a cluster: write rows BaryX"),
    ],
)
def test_what_is_no_covariance_is_refused(tmp_path, change, message):
    with pytest.raises(InputError, match=message):
        network(tmp_path, ROWS.replace(*change, 1))


def test_a_sigma_with_a_relative_part_is_refused_in_a_cluster(tmp_path):
    head = "type,from,to,value,sigma,cluster,relative_sigma\n"
    with pytest.raises(InputError, match=r"o\.csv:2: a row of a cluster has no relative_sigma"):
        network(tmp_path, "Dist,A,P,22,0.001,a,1e-6\n", head)


def test_tables_in_memory_have_clusters():
    table = {"type": ["LX", "LY", "Zen"], "from": "A", "to": "P", "value": [10, 20, 100]}
    table |= {"sigma": [0.002, 0.003, 0.01], "cluster": ["a", "a", "a"], "covariances": ["", 1e-6, "0 2e-6"]}
    (cluster,) = observations_of(table, "gon").clusters
    assert cluster.covariance[0, 1] == 1e-6
    assert cluster.covariance[2, 1] == pytest.approx(2e-6 * np.pi / 200)
    with pytest.raises(InputError, match=r"observations, row 1 \(A -> P\): the covariance of cluster a"):
        observations_of(table | {"covariances": ["", 1e-6, [0, 1]]}, "gon")


def test_tables_in_memory_have_barycentres_and_units():
    table = {"type": ["barycentre", "Dist"], "from": ["P", "A"], "to": ["A B", "P"], "value": [0, 5.0]}
    table |= {"sigma": [0.001, 2.0], "weights": ["1 3", None], "unit": [None, "mm"]}
    book = observations_of(table)
    assert [group.weights for group in book.groups] == [(1.0, 3.0)] * 3
    assert book.observations.values[3:].tolist() == [0.005]
    assert book.observations.sigmas[3:].tolist() == [0.002]


def test_a_cell_that_nobody_could_read_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"o\.csv:8: this is no row of a table"):
        network(tmp_path, ROWS + "Dist,A,P,1,1,m,a," + "1 " * 80_000 + ",,\n")
