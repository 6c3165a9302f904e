"""Tables with named columns."""

from dataclasses import replace

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.formats.tables.writer import table_text
from obseq.survey import Network
from obseq.survey.model import Cluster

POINTS = "name,x,y,z,sx,sy,sz\nA,0,0,10,0.001,0.001,0.001\nB,0,100,10,0,0,0\nP,39,51,10,,,\n"
ROWS = [
    "type,from,to,value,sigma,unit,set,active",
    "Hz,A,B,0,0.001,gon,1,",
    "Hz,A,P,42.9548,0.001,gon,1,1",
    "Dist,A,P,64031.2,1,mm,,",
    "dist,B,P,64.0312,0.001,,,",
    "DH,A,P,0,0.001,m,,",
    "Zen,A,P,90,0.01,deg,1,0",
]


def network(folder, rows=ROWS, points=POINTS, **options):
    paths = [folder / "o.csv", folder / "p.csv"]
    for path, text in zip(paths, ("\n".join(rows), points), strict=True):
        path.write_text(text)
    return Network.read_project(paths, **options)


def test_points_and_observations(tmp_path):
    given = network(tmp_path)
    rows = given.book.observations
    assert [given.book.label(k).split()[0] for k in range(6)] == ["Hz", "Hz", "Dist", "Dist", "DH", "Zen"]
    assert rows.values[2] == pytest.approx(64.0312)
    assert rows.values[5] == pytest.approx(np.pi / 2)
    assert rows.active.tolist() == [True] * 5 + [False]
    assert rows.stations[0] == rows.stations[1]
    assert given.points.is_held[1].all()
    adjusted = given.adjust()
    np.testing.assert_allclose(adjusted.points.coordinates[2], (40, 50, 10), rtol=0, atol=2e-3)


def test_separators_and_all_columns(tmp_path):
    rows = ["type;from;to;backsight;value;sigma;relative_sigma;from_height;to_height;remark"]
    rows += ["Angle;A;P;B;42.9548;0.001;0;0;0;by hand", "Dist;A;P;;64.0312;0.001;1e-6;1.5;1.5;"]
    book = network(tmp_path, rows).book
    assert book.label(0).startswith("Angle B -> A -> P")
    assert book.observations.relative_sigmas[1] == 1e-6
    assert book.observations.from_heights[1] == 1.5


def test_observations_of_two_equations_may_be_correlated(tmp_path):
    given = network(tmp_path)
    cluster = Cluster(np.array([1, 2]), np.array([[2.5e-10, 1.2e-8], [1.2e-8, 1e-6]]))
    mixed = replace(given, book=replace(given.book, clusters=(cluster,))).adjust()
    alone = given.adjust()
    assert mixed.solution.redundancy == alone.solution.redundancy
    assert mixed.solution.variance_factor != pytest.approx(alone.solution.variance_factor, rel=1e-3)


def test_some_observations_alone_keep_what_binds_them(tmp_path):
    given = network(tmp_path).book
    rows, k = np.arange(len(given.observations)) > 0, len(given.observations) - 1
    cluster = Cluster(np.array([0, 1, k]), np.diag([1.0, 2.0, 3.0]))
    book = replace(given, clusters=(cluster,)).only(rows)
    assert [book.label(row) for row in range(k)] == [given.label(row) for row in range(1, k + 1)]
    assert book.observations.values.tolist() == given.observations.values[1:].tolist()
    for station in range(len(book.stations)):
        members = given.stations.observations(station)
        assert book.stations.observations(station).tolist() == [m - 1 for m in members.tolist() if m]
    (left,) = book.clusters
    assert left.rows.tolist() == [0, k - 1] and np.diag(left.covariance).tolist() == [2.0, 3.0]


EVERY = [
    "type;from;to;backsight;value;sigma;unit;set;orientation;instrument;relative_sigma;from_height;to_height;active",
    "Hz;A;B;;0;0.001;gon;1;;TS 15;;1.5;1.6;",
    "Hz;A;P;;42.9548;0.001;gon;1;;TS 15;;;;1",
    "Dist;A;P;;64031.2;1;mm;;;TS 15;1e-6;1.5;1.5;",
    "Angle;A;P;B;42.9548;0.001;gon;;;;;;;",
    "Azim;A;P;;42.9548;0.001;gon;;;;;;;",
    "DX;B;P;;39.9;0.01;m;f;FIX;;;;;",
    "DH;A;P;;0;0.001;m;;;level;;;;",
    "Zen;A;P;;90;0.01;deg;1;;TS 15;0.001;;;0",
    "DistHz;B;P;;64.0312;0.001;m;;;;;;;",
]


def test_tables_of_observations_come_back_as_they_are(tmp_path):
    before = network(tmp_path, EVERY).book
    (tmp_path / "again.obs.csv").write_text(table_text(before))
    after = Network.read_project([tmp_path / "again.obs.csv", tmp_path / "p.csv"]).book
    assert after.point_names == before.point_names
    for name in before.observations.__dataclass_fields__:
        if name not in ("file_indices", "groups", "lines"):
            np.testing.assert_array_equal(
                getattr(after.observations, name), getattr(before.observations, name), name
            )
    named = [after.groups[k].name if k >= 0 else "" for k in after.observations.groups]
    assert named == [row.split(";")[9] for row in EVERY[1:]]
    np.testing.assert_array_equal(after.stations.orientations, before.stations.orientations)
    assert table_text(after) == table_text(before)


def test_a_network_is_converted_to_tables(tmp_path, capsys):
    given = network(tmp_path)
    paths = [str(tmp_path / name) for name in ("q.csv", "q.obs.csv")]
    assert main(["convert", str(tmp_path / "p.csv"), str(tmp_path / "o.csv"), "--to", *paths]) == 0
    assert "adjust them with --points-crs 'Local' --refraction 0.12" in capsys.readouterr().out
    again = Network.read_project(paths, points_crs="Local")
    assert again.adjust().sigma0 == pytest.approx(given.adjust().sigma0, rel=1e-12)


def test_the_system_of_a_table_of_points_is_given(tmp_path):
    points = POINTS.replace("0,0,10", "700000,6600000,10").replace("0,100,10", "700000,6600100,10")
    points = points.replace("39,51,10", "700039,6600051,10")
    adjusted = network(tmp_path, points=points, points_crs="EPSG:2154").adjust()
    assert adjusted.frame.startswith("RTL*")
    np.testing.assert_allclose(adjusted.points.crs_coordinates[2], (700040, 6600050, 10), atol=0.1)


def test_empty_cells_at_the_end_of_rows_are_those_of_spreadsheets(tmp_path):
    plain = network(tmp_path).book.observations.values.tolist()
    assert network(tmp_path, [f"{row},," for row in ROWS]).book.observations.values.tolist() == plain
    assert network(tmp_path, [*ROWS[:4], f"{ROWS[4]},", *ROWS[5:]]).book.observations.values.tolist() == plain


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("type,from", "typ,from"), "o.csv:1: column name is missing"),
        (("Hz,A,B", "Hx,A,B"), "o.csv:2: type 'Hx' is unknown"),
        (("64031.2", "64031,2"), "o.csv:4: 9 cells for 8 columns; the comma separates cells: write decimals"),
        (("42.9548", "42.95x"), "o.csv:3: column value: '42.95x' is not a number"),
        (("1,mm", "1,gon"), "o.csv:4: unit 'gon' is none of m, mm, cm, km, ft, us-ft"),
        (("DH,A,P,0,0.001", "DH,A,P,0,0"), "o.csv:6: column sigma: it is not positive"),
        (("Dist,A,P", "Dist,A,A"), "o.csv:4: slope distance: it needs 2 different points"),
        (("1,mm,,", "1,mm,,,x"), "o.csv:4: 9 cells for 8 columns"),
        (("deg,1,0", "deg,1,perhaps"), "o.csv:7: active is 'perhaps'"),
        (("Dist,A,P,64031.2", "Dist,A,P,-64031.2"), "o.csv:4: the slope distance is not positive"),
    ],
)
def test_bad_tables_are_refused_by_file_and_line(tmp_path, change, message, capsys):
    rows = [row.replace(*change, 1) for row in ROWS]
    with pytest.raises(InputError) as caught:
        network(tmp_path, rows)
    assert message in str(caught.value)
    assert main(["adjust", str(tmp_path / "o.csv"), str(tmp_path / "p.csv")]) == 2
    capsys.readouterr()


@pytest.mark.parametrize("empty", ["o.csv", "p.csv"])
def test_a_table_without_rows_is_named(tmp_path, empty):
    rows, points = (ROWS[:1], POINTS) if empty == "o.csv" else (ROWS, POINTS.partition("\n")[0])
    with pytest.raises(InputError, match=f"{empty}:1: the table holds no row below the names"):
        network(tmp_path, rows, points)


def test_tables_in_utf_16_are_read(tmp_path):
    expected = network(tmp_path).points.coordinates
    for path in tmp_path.glob("*.csv"):
        path.write_text(path.read_text(), encoding="utf-16")
    found = Network.read_project([tmp_path / "o.csv", tmp_path / "p.csv"]).points
    np.testing.assert_array_equal(found.coordinates, expected)


def test_networks_and_adjustments_are_printed_in_a_few_lines(tmp_path):
    made = network(tmp_path)
    assert repr(made).startswith("Network: 3 points (2 known), 6 observations, 1 stations; frame Local")
    first, *others = str(made.adjust()).split("\n")
    assert first.startswith("Adjustment: 3 points, 2 known; 5 observations, 1 not used; redundancy ")
    assert any(line.startswith("  sigma0 ") for line in others) and len(others) < 12


def test_both_tables_are_needed(tmp_path):
    network(tmp_path)
    with pytest.raises(InputError, match=r"o\.csv: only observations; name the table of points too"):
        Network.read_project(tmp_path / "o.csv")
    with pytest.raises(InputError, match=r"p\.csv:2: a sigma is empty"):
        network(tmp_path, points=POINTS.replace("0.001", "-1", 1))


def test_columns_of_one_name_are_named(tmp_path):
    with pytest.raises(InputError, match="two columns have the name unit "):
        network(tmp_path, [f"{ROWS[0]},Unit", *ROWS[1:]])
