"""A result whose precisions fail where the iterations have led is returned without precisions."""

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.errors import SingularSystemError
from obseq.report.result_file import read_json
from obseq.survey import Network, network_from_tables

POINTS = {
    "name": ["A", "B", "C", "P", "Q"],
    "x": [0.0, 100.0, 50.0, 50.0, 60.0],
    "y": [0.0, 0.0, 80.0, 20.0, 50.0],
    "z": [0.0] * 5,
} | {f"s{axis}": [0.0, 0.0, 0.0, None, None] for axis in "xyz"}
ROWS = [("DistHz", "A", "P", 40.0), ("DistHz", "B", "P", 40.0), ("DH", "A", "P", 0.0)]
"""Two distances that do not reach each other: the point ends between, where nothing holds it across."""
OTHERS = [("DistHz", "A", "Q", 78.102), ("DistHz", "B", "Q", 64.031), ("DistHz", "C", "Q", 31.623)]
OTHERS += [("DH", "A", "Q", 0.0)]


def _network(rows) -> Network:
    columns = dict(zip(("type", "from", "to", "value"), map(list, zip(*rows, strict=True)), strict=True))
    return network_from_tables(POINTS, columns | {"sigma": [0.002] * len(rows)})


def test_coordinates_stay_and_what_is_weak_is_named():
    found = _network([*ROWS, *OTHERS]).adjust()
    assert not found.left_out and not found.is_complete
    places = dict(zip(found.points.names, found.points.coordinates, strict=True))
    assert places["P"] == pytest.approx((50.0, 0.0, 0.0), abs=1e-3)
    assert places["Q"] == pytest.approx((60.0, 50.0, 0.0), abs=1e-3)
    (told,) = (text for text in found.failures if text.startswith("precisions are withheld"))
    assert "the position along y of P" in told
    assert np.isnan(found.points.covariances).all()
    assert found.residuals[:2] == pytest.approx([10.0, 10.0], abs=1e-3)


def test_strict_refuses_it():
    with pytest.raises(SingularSystemError, match="along y of P"):
        _network([*ROWS, *OTHERS]).adjust(strict=True)


def test_the_same_where_it_is_all_that_is_unknown():
    found = _network(ROWS).adjust()
    assert [text.startswith("precisions are withheld") for text in found.failures] == [True]


def test_files_are_written_with_exit_code_1(tmp_path):
    lines = [f"{name},{x},{y},0,{s},{s},{s}" for name, x, y, s in _of_file()]
    (tmp_path / "p.csv").write_text("\n".join(["name,x,y,z,sx,sy,sz", *lines]) + "\n")
    rows = [",".join(map(str, row)) + ",0.002" for row in [*ROWS, *OTHERS]]
    (tmp_path / "o.csv").write_text("\n".join(["type,from,to,value,sigma", *rows]) + "\n")
    out = [f"--{kind}={tmp_path / f'r.{kind}'}" for kind in ("json", "html", "text")]
    assert main(["adjust", str(tmp_path / "p.csv"), str(tmp_path / "o.csv"), *out]) == 1
    record = read_json(tmp_path / "r.json")
    assert [point.sx for point in record.points] == [None] * 5
    assert "precisions are withheld" in (tmp_path / "r.text").read_text()


def _of_file():
    sigmas = ["" if sigma is None else sigma for sigma in POINTS["sx"]]
    return zip(POINTS["name"], POINTS["x"], POINTS["y"], sigmas, strict=True)
