"""Tables with named columns."""

from dataclasses import replace

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.errors import InputError
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


def test_only_observations_of_one_equation_are_correlated(tmp_path):
    given = network(tmp_path)
    cluster = Cluster(np.array([2, 4]), np.array([[1e-6, 5e-7], [5e-7, 1e-6]]))
    mixed = replace(given, book=replace(given.book, clusters=(cluster,)))
    with pytest.raises(InputError, match=r"DH A -> P \(.*o.csv:6\): it is correlated with Dist A -> P"):
        mixed.adjust()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("type,from", "typ,from"), "o.csv:1: column name is missing"),
        (("Hz,A,B", "Hx,A,B"), "o.csv:2: type 'Hx' is unknown"),
        (("64031.2", "64031,2"), "o.csv:4: 9 cells for 8 columns"),
        (("42.9548", "42.95x"), "o.csv:3: column value: '42.95x' is not a number"),
        (("1,mm", "1,gon"), "o.csv:4: unit 'gon' is none of m, mm, km"),
        (("DH,A,P,0,0.001", "DH,A,P,0,0"), "o.csv:6: column sigma: it is not positive"),
        (("Dist,A,P", "Dist,A,A"), "o.csv:4: slope distance: it needs 2 different points"),
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


def test_both_tables_are_needed(tmp_path):
    network(tmp_path)
    with pytest.raises(InputError, match="no table of points is given"):
        Network.read_project(tmp_path / "o.csv")
    with pytest.raises(InputError, match=r"p\.csv:2: a sigma is empty"):
        network(tmp_path, points=POINTS.replace("0.001", "-1", 1))
