import gc
import json
import subprocess
import sys
from pathlib import Path

import pytest

from obseq.cli.main import main


def test_the_demo_is_the_documented_network(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    for _ in range(2):
        assert main(["demo"]) == 0
    out = capsys.readouterr().out
    assert out.count("sigma0            1.766  expected 0.35 to 1.67  too large") == 2
    record = json.loads((tmp_path / "obseq-demo" / "adjustment.json").read_text(encoding="utf-8"))
    assert record["frame"] == "RTL*657700*6860700*0*IGNF:LAMB93"
    assert record["points_crs"] == "IGNF:LAMB93"
    assert record["sigma0"] == pytest.approx(1.7655, abs=5e-4)
    assert sorted(path.name for path in (tmp_path / "obseq-demo").iterdir()) == [
        "adjustment.html",
        "adjustment.json",
        "adjustment.txt",
    ]


def test_the_demo_goes_where_it_is_told(tmp_path: Path, capsys) -> None:
    assert main(["demo", "--out", str(tmp_path / "a" / "b")]) == 0
    assert (tmp_path / "a" / "b" / "adjustment.html").is_file()


def test_a_run_makes_next_to_no_garbage(tmp_path: Path, capsys) -> None:
    """Which is why a command looks for it seldom (`obseq.cli.start.NEW_OBJECTS`)."""
    again = ["demo", "--out", str(tmp_path)]
    main(again)
    gc.collect()
    gc.disable()
    try:
        main(again)
        assert gc.collect() < 200
    finally:
        gc.enable()


def test_it_loads_no_masked_arrays_and_no_scipy(tmp_path: Path) -> None:
    """NumPy loads the former, in 13 ms, for `np.unique` of one argument."""
    script = (
        "import sys\nfrom obseq.cli.main import main\nmain(['demo'])\n"
        "sys.exit(', '.join({'numpy.ma', 'scipy.linalg', 'scipy.sparse'} & set(sys.modules)) or None)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
