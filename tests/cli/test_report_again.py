"""Reports of stored plans and comparisons are those that were written with them."""

import json
from pathlib import Path

import pytest

from obseq.cli.main import main

SIDES = """.UNITS FeetUS DMS
.2D
C 1 5000 5000 ! !
C 2 5000 5300 ! !
C 3 5400 5000
M 1-2-3 -90-00-00 400.02 5 0.02
M 2-1-3 53-07-48 500.01 5 0.02
"""


@pytest.fixture
def sides(tmp_path: Path) -> Path:
    (tmp_path / "sides.dat").write_text(SIDES)
    (tmp_path / "later.dat").write_text(SIDES.replace("400.02", "400.22"))
    return tmp_path / "sides.dat"


@pytest.mark.parametrize("kind", ["plan", "comparison"])
def test_they_are_made_again(sides, tmp_path, capsys, kind) -> None:
    folder, again = tmp_path / "out", tmp_path / "again"
    later = ["--project-2", str(tmp_path / "later.dat")] if kind == "comparison" else ["--no-gains"]
    code = main([{"comparison": "compare"}.get(kind, kind), str(sides), *later, "--out", str(folder)])
    assert main(["report", str(folder / f"{kind}.json"), "--out", str(again)]) == code
    for suffix in ("json", "html"):
        name = f"{kind}.{suffix}"
        assert (again / name).read_text() == (folder / name).read_text()
    assert " us-ft" in (again / f"{kind}.txt").read_text()
    main(["report", str(folder / f"{kind}.json"), "--units", "m", "--html", str(again / "m.html")])
    assert '"units":{"length":"m"' in (again / "m.html").read_text()
    plain = json.loads((folder / f"{kind}.json").read_text()) | {"version": 99}
    (tmp_path / "new.json").write_text(json.dumps(plain))
    capsys.readouterr()
    assert main(["report", str(tmp_path / "new.json")]) == 2
    assert "another version than 1; make it again" in capsys.readouterr().err
