import io
import json
from pathlib import Path

import pytest

from obseq.cli.main import main
from obseq.cli.parsing import coloured

FRAME = "RTL*657700*6860700*0*IGNF:LAMB93"
POINTS = """\
1 PtA 657700 6860700 10 0.001
0 PtB 657710 6860700 10
0 PtC 657710 6860710 10
1 PtD 657700 6860690 10 0.001
"""
OBSERVATIONS = """\
7 PtA PtB 0 0.001
6 PtA PtB 100 0.001
3 PtA PtB 10.05 0.005
5 PtA PtC -40.62 0.001
6 PtA PtC 100 0.001
3 PtA PtC 14.88 0.005
7 PtD PtB 0 0.001
6 PtD PtB 100 0.001
3 PtD PtB 14.88 0.005
5 PtD PtC -14.96 0.001
6 PtD PtC 100 0.001
3 PtD PtC 22.82 0.005
"""


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the demo network, which is the current folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "site.obs").write_text(OBSERVATIONS, encoding="utf-8")
    (tmp_path / "site.cor").write_text(POINTS, encoding="utf-8")
    return tmp_path


def adjust(*options: str) -> int:
    frame = [] if "--frame" in options else ["--frame", FRAME, "--points-crs", "IGNF:LAMB93"]
    return main(["adjust", "--obs", "site.obs", "--cor", "site.cor", *frame, *options])


def names_in(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*"))


def test_results_are_written_and_summarised(site: Path, capsys) -> None:
    assert adjust("--out", "results") == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert "Written: results/adjustment.json, results/adjustment.html, results/adjustment.txt" in out
    assert names_in(site / "results") == ["adjustment.html", "adjustment.json", "adjustment.txt"]
    record = json.loads((site / "results" / "adjustment.json").read_text(encoding="utf-8"))
    assert (record["format"], record["version"]) == ("obseq-adjustment", 1)
    assert (record["n_observations"] + record["n_constraints"], record["n_unknowns"]) == (18, 14)
    assert record["iterations"][0]["sigma0"] == pytest.approx(5443.87, abs=0.01)
    assert record["sigma0"] == pytest.approx(1.7655, abs=5e-4)
    assert record["global_test"]["passed"] is False  # and nothing single is suspected: the exit code is 0
    found = {point["name"]: (point["crs_x"], point["crs_y"], point["crs_z"]) for point in record["points"]}
    assert found["PtC"] == pytest.approx((657711.001208, 6860710.002857, 10.000024), abs=1e-5)
    assert [phase["name"] for phase in record["phases"]][:2] == ["load", "read"]


def test_each_result_can_be_asked_for(site: Path, capsys) -> None:
    assert adjust("--json", "a.json", "--html", "b.html", "--text", "c.txt") == 0
    assert names_in(site) == ["a.json", "b.html", "c.txt", "site.cor", "site.obs"]


def test_nothing_is_written_when_nothing_is_asked_for(site: Path, capsys) -> None:
    assert adjust() == 0
    assert names_in(site) == ["site.cor", "site.obs"]
    assert "Written: nothing" in capsys.readouterr().out


def test_iterations_that_did_not_converge_are_exit_code_1(site: Path, capsys) -> None:
    assert adjust("--iterations", "1", "--json", "a.json") == 1
    assert "NOT CONVERGED" in capsys.readouterr().out
    assert json.loads((site / "a.json").read_text(encoding="utf-8"))["converged"] is False


def test_a_sigma_for_known_points_that_give_none(site: Path, capsys) -> None:
    (site / "site.cor").write_text(POINTS.replace(" 0.001", ""), encoding="utf-8")
    assert adjust() == 2
    assert "site.cor:1" in capsys.readouterr().err
    assert adjust("--point-sigma", "0.001") == 0


def test_several_files_are_put_together(site: Path, capsys) -> None:
    lines = OBSERVATIONS.splitlines(keepends=True)
    (site / "site.obs").write_text("".join(lines[:6]), encoding="utf-8")
    (site / "second.obs").write_text("".join(lines[6:]), encoding="utf-8")
    assert main(["adjust", "--obs", "site.obs", "second.obs", "--cor", "site.cor", "--frame", FRAME,
                 "--points-crs", "IGNF:LAMB93"]) == 0  # fmt: skip
    assert "sigma0            1.766  expected 0.35 to 1.67" in capsys.readouterr().out


BAD = {
    "unknown code": ("obs", "99 PtA PtB 1 0.001\n", "site.obs:13"),
    "missing field": ("obs", "3 PtA PtB 10\n", "site.obs:13"),
    "angle out of range": ("obs", "5 PtA PtB 401 0.001\n", "site.obs:13"),
    "negative distance": ("obs", "3 PtA PtB -10 0.001\n", "site.obs:13"),
    "zero sigma": ("obs", "3 PtA PtB 10 0\n", "site.obs:13"),
    "duplicate point": ("cor", "0 PtB 657710 6860700 10\n", "PtB"),
    "unknown flag": ("cor", "9 PtE 657710 6860700 10\n", "site.cor:5"),
}


def test_an_option_given_again_adds_its_files(site: Path, capsys) -> None:
    (site / "more.obs").write_text("3 PtD PtC 22.83 0.005\n", encoding="utf-8")
    assert adjust("--obs", "more.obs", "--json", "again.json") == 0
    count = json.loads((site / "again.json").read_text(encoding="utf-8"))["n_observations"]
    assert count == 13
    capsys.readouterr()
    assert adjust("--obs", "site.obs") == 2
    assert "site.obs: is the same file as site.obs" in capsys.readouterr().err


def assert_refused(site: Path, capsys, expected: str, *options: str) -> None:
    before = names_in(site)
    assert adjust("--out", "results", *options) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("obseq: ")
    assert expected in err
    assert "Traceback" not in err
    assert names_in(site) == before


@pytest.mark.parametrize("case", BAD)
def test_bad_lines_are_refused(case: str, site: Path, capsys) -> None:
    kind, line, expected = BAD[case]
    with (site / f"site.{kind}").open("a", encoding="utf-8") as file:
        file.write(line)
    assert_refused(site, capsys, expected)


@pytest.mark.parametrize(
    ("kind", "content", "expected"),
    [
        ("obs", b"", "site.obs: the file is empty"),
        ("cor", b"", "site.cor: the file is empty"),
        ("obs", b"7 PtA PtB\x00\x01\x02 0 0.001\n", "binary"),
        ("obs", "7 Pté PtB 0 0.001\n".encode("latin-1"), "UTF-8"),
        ("cor", POINTS.encode("utf-16-be"), "UTF-16"),
        ("cor", b"0 PtA 657700 6860700 10\n0 PtB 657710 6860700 10\n", "known"),
    ],
)
def test_bad_files_are_refused(kind: str, content: bytes, expected: str, site: Path, capsys) -> None:
    (site / f"site.{kind}").write_bytes(content)
    assert_refused(site, capsys, expected)


@pytest.mark.parametrize("coefficient", ["12", "-1.5"])
def test_a_refraction_that_no_air_has_is_refused(coefficient: str, site: Path, capsys) -> None:
    expected = f"refraction coefficient {coefficient}: air bends rays by -1 to 1"
    assert_refused(site, capsys, expected, f"--refraction={coefficient}")


def test_a_file_that_is_absent_is_named(site: Path, capsys) -> None:
    (site / "site.obs").unlink()
    assert_refused(site, capsys, "site.obs: there is no such file")


@pytest.mark.parametrize("frame", ["EPSG:0", "nonsense", "RTL*1*2", "RTL*0*0*0*EPSG:999999"])
def test_an_unknown_coordinate_system_is_named(frame: str, site: Path, capsys) -> None:
    assert_refused(site, capsys, frame.rpartition("*")[2], "--frame", frame)


def test_options_that_lack_another_one_are_refused(site: Path, capsys) -> None:
    assert_refused(site, capsys, "--snooping-level goes with --snooping", "--snooping-level", "0.1")
    assert main(["adjust", "site.cor"]) == 2
    assert "Files of observations and of points" in capsys.readouterr().err


def test_what_hangs_on_nothing_is_left_out_or_refused(site: Path, capsys) -> None:
    with (site / "site.obs").open("a", encoding="utf-8") as file:
        file.write("7 X1 X2 0 0.001\n6 X1 X2 100 0.001\n3 X1 X2 10 0.005\n5 X1 X3 50 0.001\n")
    assert adjust() == 1
    assert "3 points left out: point X1, point X2, point X3: " in capsys.readouterr().out
    assert adjust("--strict") == 2
    assert "point X1: not connected to any known point" in capsys.readouterr().err


def test_a_target_on_the_vertical_of_its_station_is_refused(site: Path, capsys) -> None:
    (site / "site.cor").write_text(POINTS + "1 Top 657700 6860700 20 0.001\n", encoding="utf-8")
    with (site / "site.obs").open("a", encoding="utf-8") as file:
        file.write("5 PtA Top 10 0.001\n")
    assert_refused(site, capsys, "Top")


def test_outputs_are_refused_before_the_work(site: Path, capsys, monkeypatch) -> None:
    monkeypatch.setattr("obseq.survey.Network.read", None)  # whoever calls it fails otherwise
    (site / "results").write_text("a file", encoding="utf-8")
    assert_refused(site, capsys, "the results cannot be written there")


def test_inputs_are_not_overwritten(site: Path, capsys) -> None:
    assert adjust("--json", "site.obs") == 2
    assert "would replace an input" in capsys.readouterr().err
    assert adjust("--json", "a.json") == 0
    assert main(["report", "a.json", "--text", "site.obs"]) == 2
    assert "would replace an input" in capsys.readouterr().err
    assert (site / "site.obs").read_text(encoding="utf-8") == OBSERVATIONS


def test_included_files_are_not_overwritten(tmp_path: Path, capsys) -> None:
    main_file, included = tmp_path / "main.dat", tmp_path / "rest.dat"
    main_file.write_text(".2D\n.INCLUDE rest.dat\nC A 0 0 ! !\nC B 10 0 ! !\n")
    included.write_text("D A-P 7.1 0.01\nD B-P 7.1 0.01\n")
    assert main(["adjust", str(main_file), "--text", str(included)]) == 2
    assert "rest.dat: writing the results here would replace an input" in capsys.readouterr().err
    assert included.read_text().startswith("D A-P")


def test_an_interruption_leaves_the_old_results(site: Path, capsys, monkeypatch) -> None:
    def interrupted(_) -> None:
        raise KeyboardInterrupt

    (site / "a.json").write_text("old", encoding="utf-8")
    monkeypatch.setattr("os.fsync", interrupted)
    assert adjust("--json", "a.json", "--html", "b.html") == 130
    assert (site / "a.json").read_text(encoding="utf-8") == "old"
    assert names_in(site) == ["a.json", "site.cor", "site.obs"]


def test_the_files_of_one_run_carry_its_identifier_and_another_run_has_another(site: Path, capsys) -> None:
    found = []
    for _ in range(2):
        assert adjust("--out", "results") == 0
        texts = [path.read_text(encoding="utf-8") for path in sorted((site / "results").iterdir())]
        (run,) = {json.loads(texts[1])["run"]["identifier"]}
        assert all(run in text for text in texts)
        found.append(run)
    assert found[0] != found[1]


EVIL = "\x1b]0;evil\x07\x1b[2J"


def test_marks_of_direction_in_names_are_written_as_what_they_are(site: Path, capsys) -> None:
    for path in (site / "site.obs", site / "site.cor"):
        path.write_text(path.read_text(encoding="utf-8").replace("PtB", "P\u202e"), encoding="utf-8")
    assert adjust("--out", "results") == 0
    texts = {path.suffix: path.read_text(encoding="utf-8") for path in (site / "results").iterdir()}
    for text in (*texts.values(), *capsys.readouterr()):
        assert all(c.isprintable() or c in "\n\t" for c in text)
    assert "P\\u202e" in texts[".txt"]
    assert json.loads(texts[".json"])["points"][1]["name"] == "P\u202e"


def test_control_characters_in_a_refused_line_do_not_reach_the_terminal(site: Path, capsys) -> None:
    with (site / "site.obs").open("a", encoding="utf-8") as file:
        file.write(f"3 PtA P{EVIL} 10 0.01\n")
    assert adjust("--strict") == 2
    err = capsys.readouterr().err
    assert "\\x1b" in err
    assert all(c.isprintable() or c == "\n" for c in err)


def test_an_output_that_is_a_link_to_nothing_is_refused_before_the_work(
    site: Path, capsys, monkeypatch
) -> None:
    monkeypatch.setattr("obseq.survey.Network.read", None)
    (site / "a.json").symlink_to(site / "gone" / "b.json")
    assert adjust("--json", "a.json") == 2
    assert "a link to something that does not exist" in capsys.readouterr().err
    (site / "out").symlink_to(site / "gone")
    assert adjust("--out", "out") == 2
    assert "a link to something that does not exist" in capsys.readouterr().err


@pytest.mark.parametrize("kind", ["obs", "cor"])
def test_a_name_as_long_as_a_book_is_refused_shortly(kind: str, site: Path, capsys) -> None:
    line = {"obs": "3 PtA {} 10 0.01\n", "cor": "0 {} 1 2 3\n"}[kind]
    with (site / f"site.{kind}").open("a", encoding="utf-8") as file:
        file.write(line.format("x" * 5_000_000))
    assert adjust() == 2
    err = capsys.readouterr().err
    assert "5000000 characters" in err
    assert len(err) < 1000


@pytest.mark.parametrize("sigma", ["1e200", "1e-200", "1e10", "nan", "inf"])
def test_a_sigma_of_points_that_means_nothing_is_refused(sigma: str, site: Path, capsys) -> None:
    (site / "site.cor").write_text(POINTS.replace(" 0.001", ""), encoding="utf-8")
    try:
        code = adjust("--point-sigma", sigma)
    except SystemExit as end:
        code = end.code
    assert code == 2
    err = capsys.readouterr().err
    assert "Traceback" not in err
    assert "point-sigma" in err


@pytest.mark.parametrize("sigma", ["1e200", "1e-200"])
def test_such_a_sigma_is_refused_for_points_in_a_free_format_too(sigma: str, site: Path, capsys) -> None:
    assert adjust("--point-format", "ANXYZBla", "--comment", "*", "--point-sigma", sigma) == 2
    err = capsys.readouterr().err
    assert err.startswith("obseq: the sigma of the points (--point-sigma")
    assert err.count("\n") == 1


def test_names_of_the_field_case_terminal_escape(shared_data: Path, capsys) -> None:
    folder = shared_data / "field-cases" / "terminal-escape"
    files = ["--obs", str(folder / "e.obs"), "--cor", str(folder / "c.cor")]
    assert main(["adjust", *files, "--frame", "RTL*2.4*48.8*0*EPSG:4326"]) == 2  # a point with one distance
    out, err = capsys.readouterr()
    assert "\\x1b]0;evil\\x07" in err
    assert all(c.isprintable() or c == "\n" for c in out + err)


def test_what_is_wanted_of_the_quality_is_said_on_the_command_line(site: Path, capsys) -> None:
    wanted = ["--snooping", "w", "--level", "0.01", "--ellipses", "0.95", "--relative", "--a-priori"]
    assert adjust(*wanted, "--json", "a.json") == 1  # something was left out
    out = capsys.readouterr().out
    assert "Data snooping with w, overall level 5 %: 1 left out" in out
    assert "limit 2.58" in out
    record = json.loads((site / "a.json").read_text(encoding="utf-8"))
    assert (record["precision"], record["ellipse_level"]) == ("a priori", 0.95)
    assert record["observations"][11]["rejected"] is True
    assert len(record["relative"]) == 4
    assert adjust("--no-reliability", "--json", "a.json") == 0
    assert json.loads((site / "a.json").read_text(encoding="utf-8"))["reliability"] is None
    assert "largest residual / sigma" in capsys.readouterr().out


def test_variance_components_that_nothing_determines_are_told_and_lose_nothing(site: Path, capsys) -> None:
    assert adjust("--variance-components", "--json", "site.json") == 1
    assert "no variance component" in capsys.readouterr().out
    assert Path("site.json").is_file()


def test_a_result_on_standard_output_is_alone_there(site: Path, capsys) -> None:
    for name in ("-", "/dev/stdout"):
        assert adjust("--json", name) == 0
        out, err = capsys.readouterr()
        assert json.loads(out)["format"] == "obseq-adjustment"
        assert "Written: /dev/stdout" in err
    assert adjust("--json", "-", "--text", "-") == 2
    assert "two results cannot be written" in capsys.readouterr().err
    assert names_in(site) == ["site.cor", "site.obs"]


def test_messages_name_what_to_write(site: Path, capsys) -> None:
    (site / "site.cor").write_bytes(POINTS.encode().replace(b"PtA", b"Pt\xe9"))
    assert adjust() == 2
    assert "--encoding latin-1 on the command line" in capsys.readouterr().err
    (site / "a.dat").write_text("C A 0 0 0 ! ! !\nC B 100 0 0 ! ! !\nD A-P 50.0\n", encoding="utf-8")
    assert main(["adjust", "a.dat"]) == 2
    assert "--sigmas distance=2mm (sigmas=['distance=2mm'] in Python)" in capsys.readouterr().err
    assert main(["adjust", "a.dat", "--sigmas", "direction=3"]) == 2
    said = capsys.readouterr().err
    assert "a number with its unit (sec, arcsec, cc, mgon, gon, deg, rad) is needed" in said
    assert main(["adjust", "--sigmas", "distance=2mm", "a.dat"]) == 2
    assert "What to adjust? Files of observations and of points" in capsys.readouterr().err


@pytest.mark.parametrize("strategy", ["gauss-newton", "levenberg-marquardt", "dogleg", "qr"])
def test_a_strategy_and_a_tolerance_lead_to_the_same_solution(shared_data, tmp_path, strategy):
    project = str(shared_data / "comp3d-modane/project.comp")
    usual, chosen = tmp_path / "usual.json", tmp_path / "chosen.json"
    assert main(["adjust", project, f"--json={usual}"]) == 0
    options = [f"--strategy={strategy}", "--tolerance=1e-9", f"--json={chosen}"]
    assert main(["adjust", project, *options]) == 0
    one, other = (json.loads(path.read_text()) for path in (usual, chosen))
    assert other["sigma0"] == pytest.approx(one["sigma0"], rel=1e-10)
    for first, second in zip(one["points"], other["points"], strict=True):
        assert [second[axis] for axis in "xyz"] == pytest.approx([first[axis] for axis in "xyz"], abs=1e-8)


def test_how_much_is_printed_is_chosen(site: Path, capsys) -> None:
    assert adjust("-q") == 0
    quiet = capsys.readouterr().out
    assert len(quiet.splitlines()) == 1
    adjust("-v", "--show", "points")
    told = capsys.readouterr().out
    assert "Seconds: " in told and "Points. Coordinates in " in told
    assert quiet.splitlines()[0] in told
    assert adjust("-q", "-v") == 2
    assert "--quiet prints the verdict alone" in capsys.readouterr().err


def test_a_verdict_has_a_colour_on_a_terminal_only(monkeypatch) -> None:
    stream = io.StringIO()
    assert coloured("second", "bad", stream) == "second"
    monkeypatch.setattr(stream, "isatty", lambda: True)
    monkeypatch.delenv("NO_COLOR", raising=False)
    assert coloured("second", "bad", stream) == "\x1b[1;31msecond\x1b[0m"
    assert coloured("first", "", stream) == "first"
    monkeypatch.setenv("NO_COLOR", "1")
    assert coloured("second", "bad", stream) == "second"
