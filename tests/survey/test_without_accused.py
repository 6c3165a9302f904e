"""A second adjustment without what is accused: on request only, from all the rest, and it says so."""

import json
from dataclasses import replace

import numpy as np
import pytest
from msgspec import structs

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.survey import Network
from obseq.survey.points import CoordinateCovariance

POINTS = "1 A 0 0 100.000 0.001\n1 B 300 0 102.000 0.001\n1 C 300 300 101.000 0.001\n"
POINTS += "".join(f"0 {name} {x} {y} 0\n" for name, x, y in [("P", 90, 40), ("Q", 210, 60), ("R", 150, 180)])
PLACES = {
    "A": (0.0, 0.0, 100.0),
    "B": (300.0, 0.0, 102.0),
    "C": (300.0, 300.0, 101.0),
    "P": (90.0, 40.0, 101.5),
    "Q": (210.0, 60.0, 100.5),
    "R": (150.0, 180.0, 103.0),
}
WRONG = 7
"""The line of the distance that is made wrong."""


def written(folder, wrong=0.0, x_of_c=300.0):
    """Distances (5 mm) between all points, with seeded noise; one is off, or a known coordinate."""
    random, names, lines = np.random.default_rng(5), list(PLACES), []
    for i, a in enumerate(names):
        for b in names[i + 1 :]:
            for _ in range(2):
                length = float(np.linalg.norm(np.subtract(PLACES[a], PLACES[b])))
                off = wrong if len(lines) + 1 == WRONG else 0.0
                lines.append(f"3 {a} {b} {length + random.normal(0.0, 0.005) + off:.4f} 0.005\n")
            rise = PLACES[b][2] - PLACES[a][2] + random.normal(0.0, 0.001)
            lines.append(f"4 {a} {b} {rise:.4f} 0.001\n")
    (folder / "site.obs").write_text("".join(lines), encoding="utf-8")
    (folder / "site.cor").write_text(POINTS.replace("C 300 ", f"C {x_of_c} "), encoding="utf-8")
    return Network.read(folder / "site.obs", folder / "site.cor", frame="Local")


def run(folder, *options):
    files = ["--obs", str(folder / "site.obs"), "--cor", str(folder / "site.cor"), "--frame", "Local"]
    return main(["adjust", *files, *options])


def test_the_rest_is_adjusted_as_if_the_line_were_switched_off(tmp_path):
    network = written(tmp_path, 0.2)
    first = network.adjust()
    assert first.diagnosis.status == "explained" and first.solution.sigma0 > 2.0
    second = network.without_accused(first.diagnosis).adjust()
    assert not second.book.observations.active[WRONG - 1]
    assert second.book.observations.active.sum() == first.book.observations.active.sum() - 1
    lines = (tmp_path / "site.obs").read_text(encoding="utf-8").splitlines(keepends=True)
    del lines[WRONG - 1]
    (tmp_path / "site.obs").write_text("".join(lines), encoding="utf-8")
    other = Network.read(tmp_path / "site.obs", tmp_path / "site.cor", frame="Local").adjust()
    np.testing.assert_allclose(second.points.coordinates, other.points.coordinates, atol=1e-7)
    assert second.sigma0 == pytest.approx(other.sigma0, rel=1e-6)
    assert other.is_complete and not second.is_complete
    (told,) = second.record().unused
    assert told.observations == (first.diagnosis.accused[0].what,) and "asked for" in told.reason


def test_an_accused_known_coordinate_is_unknown(tmp_path):
    network = written(tmp_path, x_of_c=300.3)
    first = network.adjust()
    assert [(one.name, one.coordinate) for one in first.diagnosis.accused[0].points] == [("C", "x")]
    rest = network.without_accused(first.diagnosis)
    row = rest.points.index["C"]
    assert rest.points.is_free[row].tolist() == [True, False, False]
    second = rest.adjust()
    assert second.points.coordinates[row, 0] == pytest.approx(300.0, abs=0.02)
    assert not second.is_complete and "known x of C" in second.record().unused[0].observations[0]


def test_the_covariance_of_the_other_known_coordinates_stays(tmp_path):
    network = written(tmp_path, x_of_c=300.3)
    diagnosis = network.adjust().diagnosis
    matrix = 1e-6 * (np.eye(3) + 0.5)
    given = CoordinateCovariance((("C", 0), ("C", 1), ("B", 0)), matrix)
    rest = replace(network, points=replace(network.points, covariance=given)).without_accused(diagnosis)
    assert rest.points.covariance.coordinates == (("C", 1), ("B", 0))
    np.testing.assert_array_equal(rest.points.covariance.matrix, matrix[1:, 1:])


def test_where_nothing_tells_apart_the_others_are_named(tmp_path):
    network = written(tmp_path, 0.2)
    diagnosis = network.adjust().diagnosis
    (one,) = diagnosis.accused
    other = structs.replace(one, what="another line")
    doubtful = structs.replace(diagnosis, accused=(structs.replace(one, others=(other,)),))
    (told,) = network.without_accused(doubtful).book.unused
    assert "or another line: nothing tells these apart" in told.observations[0]


def test_it_is_refused_where_nothing_is_accused_or_explained(tmp_path):
    network = written(tmp_path)
    clean = network.adjust().diagnosis
    for diagnosis in (clean, None):
        with pytest.raises(InputError, match="nothing is accused"):
            network.without_accused(diagnosis)
    wrong = written(tmp_path, 0.2)
    unexplained = structs.replace(wrong.adjust().diagnosis, status="unexplained")
    with pytest.raises(InputError, match="does not explain"):
        wrong.without_accused(unexplained)


def test_the_command_writes_both_and_returns_1(tmp_path, capsys):
    written(tmp_path, 0.2)
    out = tmp_path / "results"
    assert run(tmp_path, "--out", str(out)) == 1
    capsys.readouterr()
    assert sorted(path.stem for path in out.iterdir()) == 3 * ["adjustment"]  # never unless asked
    assert run(tmp_path, "--out", str(out), "--without-accused", "--text", str(tmp_path / "a.txt")) == 1
    shown = capsys.readouterr().out
    assert "Because an adjustment without what is accused was asked for" in " ".join(shown.split())
    first, second = (
        json.loads((out / f"adjustment{end}.json").read_text(encoding="utf-8"))
        for end in ("", "-without-accused")
    )
    assert first["diagnosis"]["accused"] and not second["diagnosis"]["accused"]
    assert second["sigma0"] < 0.6 * first["sigma0"] and second["redundancy"] == first["redundancy"] - 1
    assert second["title"] == "Without the accused" and first["title"] is None
    assert (tmp_path / "a-without-accused.txt").exists() and (tmp_path / "a.txt").exists()


def test_the_command_keeps_the_first_result_where_there_is_no_second(tmp_path, capsys):
    written(tmp_path)
    assert run(tmp_path, "--json", str(tmp_path / "a.json"), "--without-accused") == 0
    assert "nothing is accused" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.glob("*.json")) == ["a.json"]


def test_two_results_do_not_go_to_standard_output(tmp_path, capsys):
    written(tmp_path, 0.2)
    assert run(tmp_path, "--json", "-", "--without-accused") == 2
    out, err = capsys.readouterr()
    assert not out and "name a file" in err


def test_results_of_earlier_runs_do_not_stand_beside_new_ones_in_silence(tmp_path, capsys):
    written(tmp_path, 0.4)
    out = tmp_path / "out"
    assert run(tmp_path, "--out", str(out), "--without-accused") == 1
    assert (out / "adjustment-without-accused.html").is_file()
    written(tmp_path)
    assert run(tmp_path, "--out", str(out), "--without-accused") == 0
    assert not list(out.glob("*-without-accused*")) and (out / "adjustment.html").is_file()
    capsys.readouterr()
    assert run(tmp_path, "--out", str(out), "--points-crs", "none") == 2
    assert (
        f"note: {out / 'adjustment.html'} and the files beside it are of an earlier run"
        in capsys.readouterr().err
    )


def test_a_wrong_system_of_the_points_comes_before_what_is_suspected_in_it(tmp_path, capsys) -> None:
    (tmp_path / "p.cor").write_text("1 A 1000 5000 100 0.001\n1 B 1250 5010 102 0.001\n0 P 1174 5261 104\n")
    (tmp_path / "o.obs").write_text(
        "3 A P 313.5 0.003\n3 B P 262.4 0.003\n3 A B 250.2 0.003\n3 B A 250.2 0.003\n4 A P 4 0.003\n"
        "4 B P 2 0.003\n"
    )
    files = ["adjust", str(tmp_path / "o.obs"), str(tmp_path / "p.cor")]
    assert main([*files, "--points-crs", "EPSG:2154"]) == 1
    out = capsys.readouterr().out
    assert "Suspected first: the system of the points: A, B: outside the area" in " ".join(out.split())
    assert out.index("Suspected first") < out.index("off by") and out.count("outside the area") == 1
    main(files)
    assert "Suspected first" not in capsys.readouterr().out


def test_robust_weights_are_an_option_as_in_python(tmp_path, capsys):
    network = written(tmp_path, 0.4)
    run(tmp_path, "--loss", "huber", "--json", str(tmp_path / "r.json"))
    found = json.loads((tmp_path / "r.json").read_text())["sigma0"]
    assert found == pytest.approx(network.adjust(loss="huber").sigma0, rel=1e-9)
    assert found != pytest.approx(network.adjust().sigma0, rel=1e-3)
