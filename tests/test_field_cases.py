"""Field cases: every row of their README is held by a test, here or where `ELSEWHERE` says.

The scripts of `engine` run as they are, in place; what has moved since is put where they look for it.
"""

import re
import runpy
import sys
from pathlib import Path
from types import ModuleType

import pytest

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.leastsquares.loops import blocks_to_matrix
from obseq.leastsquares.problem import losses
from obseq.leastsquares.statistics import reliability
from obseq.survey import read_obs

TESTS = Path(__file__).parent

ELSEWHERE = {
    "not-converged-levelling": "survey/test_plumb.py",
    "height-constraint": "survey/test_known_coordinates.py",
    "bad-approximation": "survey/test_random_networks.py",
    "centring-zero": "survey/test_random_networks.py",
    "deflection-ignored": "survey/test_plumb.py",
    "units": "survey/test_known_coordinates.py",
    "trilateration": "survey/test_random_networks.py",
    "terminal-escape": "cli/test_adjust.py",
}

REFUSED = {
    "masked": "row 0 is masked; leave masked rows out",
    "silent_attributes": "no group is called 'typo'",
}
"""Engine scripts that are refused, and how."""

COMPILATION = {
    "cache_corrupt": "compilation/test_cache.py",
    "stale_probe": "compilation/test_stale_code.py",
}
"""Scripts about the cache of compiled code: it has another form now, and tests of its own."""

SAME = r"ratio to the right ones( (1\.0|1\.0{9}\d+|0\.9{9}\d+)){2}"

LAST_WORDS = {
    "lm_overflow_at_minimum": r"100 True STEP 1\.06083\d+ 4\.05545316\d+",
    "lm_trilateration": r"^\s*$",
    "dogleg_never_stops": r"^True STEP \d\d? 1\.2275",
    "rounding_not_recognised": r"^(\S+ 1e-0[678] True (STEP|ROUNDING) 4 sigma0 1\.043 .*\n){9}$",
    "lm_free_gauge_redundancy": r"free  True redundancy 3 sigma0 (0\.820933774).*\ndatum .* sigma0 \1",
    "one_id_for_all_rows": r"^$",
    "interrupt_analysis": r"interrupted\n(solved again \d\S+e-1\d\n){2}$",
    "interrupt_pour": r"interrupted\nbefore (converged True .*)\nafter  \1\nthird  \1\n",
    "interrupt_covariance": rf"interrupted .*\nafter converged True .*{SAME}\nthird .* True .*{SAME}\n",
    "sigma_alias": r"plain untouched (.*)\nplain reused    \1\nrobust untouched (.*)\nrobust reused    \2\n",
    "two_threads_one_system": r"^(?!.*WRONG)(?s:.)*\b\d+ right",
}
"""Engine scripts that run, and what they print."""


def table(path):
    """Names in the first column of the table of a README."""
    rows = re.findall(r"^\| ([\w, -]+?) \|", path.read_text(encoding="utf-8"), re.MULTILINE)
    return {name for row in rows for name in row.split(", ")} - {"folder", "script", "---"}


def test_every_row_of_both_tables_has_a_test(shared_data):
    folder = shared_data / "field-cases"
    if not (folder / "README.md").is_file():
        pytest.skip("the whole collection, with its tables, is not beside the repository")
    here = {"azimuth-hint", "point-sigma", "engine"}
    assert table(folder / "README.md") <= set(ELSEWHERE) | here
    if (folder / "engine").is_dir():
        assert table(folder / "engine" / "README.md") == set(REFUSED) | set(COMPILATION) | set(LAST_WORDS)
    for name, test in ELSEWHERE.items():
        assert f'"{name}"' in (TESTS / test).read_text(encoding="utf-8")
    assert all((TESTS / test).is_file() for test in COMPILATION.values())


def test_an_azimuth_inside_a_round(shared_data, tmp_path):
    path = shared_data / "field-cases" / "azimuth-hint" / "a.obs"
    assert read_obs(path).observations.stations.tolist() == [0, 1, 2]  # a keyword closes the round
    lines = path.read_text(encoding="utf-8").replace("#FIX\n5 A B 100", "8 A B 100").replace("#VERT\n", "")
    (tmp_path / "a.obs").write_text(lines)
    assert read_obs(tmp_path / "a.obs").observations.stations.tolist() == [0, 1, 0]


def test_a_sigma_of_points_without_meaning_is_refused(shared_data, capsys):
    folder = shared_data / "field-cases" / "point-sigma"
    files = ["--obs", str(folder / "in.obs"), "--cor", str(folder / "in.cor")]
    options = ["--point-format", "ANXYZBla", "--comment", "*", "--point-sigma", "1e200"]
    assert main(["adjust", *files, *options, "--frame", "RTL*657700*6860700*0*IGNF:LAMB93"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("obseq: the sigma of the points (--point-sigma")
    assert error.count("\n") == 1


class Pouring(ModuleType):
    """`obseq.leastsquares.pouring` as the scripts know it: they read and replace the loop of today."""

    @property
    def pour_diagonal(self):
        return blocks_to_matrix.add_diagonal_blocks

    @pour_diagonal.setter
    def pour_diagonal(self, loop):
        blocks_to_matrix.add_diagonal_blocks = loop


def run(shared_data, monkeypatch, name):
    folder = shared_data / "field-cases" / "engine"
    if not folder.is_dir():
        pytest.skip(f"the scripts of the field cases are not beside the repository: {folder}")
    monkeypatch.setattr(sys, "argv", [name])
    monkeypatch.setitem(sys.modules, "obseq.leastsquares.pouring", Pouring("pouring"))
    monkeypatch.setitem(sys.modules, "obseq.leastsquares.losses", losses)
    monkeypatch.setitem(sys.modules, "obseq.leastsquares.reliability", reliability)
    monkeypatch.setattr(blocks_to_matrix, "add_diagonal_blocks", blocks_to_matrix.add_diagonal_blocks)
    runpy.run_path(str(folder / f"{name}.py"))


@pytest.mark.parametrize("name", LAST_WORDS)
def test_engine_scripts_print_what_must_come_out(shared_data, monkeypatch, capsys, name):
    run(shared_data, monkeypatch, name)
    printed = capsys.readouterr().out
    assert re.search(LAST_WORDS[name], printed), printed


@pytest.mark.parametrize("name", REFUSED)
def test_engine_scripts_that_are_refused(shared_data, monkeypatch, name):
    with pytest.raises(InputError, match=REFUSED[name]):
        run(shared_data, monkeypatch, name)
