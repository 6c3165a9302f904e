"""Commands that bring things into a project tree, and the survey network that is adjusted there."""

import json

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.project import read_control_points, read_rules, read_system
from obseq.project.topo import read_topo
from obseq.survey import read_obs

CHANTIER = "RTL*657700*6860700*0*IGNF:LAMB93"


@pytest.fixture
def project(tmp_path, monkeypatch):
    """An empty project, where commands run."""
    (tmp_path / "MMVII-PhgrProj").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path / "MMVII-PhgrProj"


def test_the_rules_of_the_training_text_are_made_by_its_two_commands(project, capsys):
    first = ["--modify", r"IGN2_.*-cam-223..1(25|30|38)-.*.jpg", "8", "0", "--save"]
    second = ["--modify", r"IGN2_.*-cam-.*.jpg", "12", "1", "--save"]
    for words in (first, second):
        assert main(["edit-metadata", "Std", "Focalmm", *words]) == 0
    rules = read_rules(project / "MetaData/Std/CalcMTD.xml")
    assert rules.value("Focalmm", "IGN2_x-cam-223ab130-1.jpg") == "8"
    assert rules.value("Focalmm", "IGN2_x-cam-9-1.jpg") == "12"
    assert (project / "MetaData/Std/BckUp_00001_CalcMTD.xml").is_file()
    capsys.readouterr()
    main(["edit-metadata", "Std", "Focalmm", "--test", "IGN2_x-cam-9-1.jpg"])
    assert capsys.readouterr().out.splitlines()[-1] == "IGN2_x-cam-9-1.jpg: 12"


def test_ranks_put_rules_where_they_say_and_nothing_is_written_unasked(project):
    def edit(value, rank, *more):
        main(["edit-metadata", "Std", "ModelCam", "--modify", ".*", value, rank, *more])

    for value, rank in (("a", "0"), ("b", "5"), ("c", "-1"), ("d", "1")):
        edit(value, rank, "--save")
    path = project / "MetaData/Std/CalcMTD.xml"
    assert [value for _, value in read_rules(path).rules("ModelCam")] == ["c", "d", "b"]
    edit("z", "0")
    assert [value for _, value in read_rules(path).rules("ModelCam")] == ["c", "d", "b"]
    edit("e", "-2", "--save")
    assert [value for _, value in read_rules(path).rules("ModelCam")] == ["e"]


def test_points_are_imported_with_their_information_and_system(project, capsys):
    rows = "1 7 657700 6860700 10\n0 12 657710 6860701 10 # free\n1 7b 657711 6860710 12\n"
    (project.parent / "points.txt").write_text(rows)
    words = "import-gcp points.txt ANXYZ Gnd --free 0 --sigma 0.002 --name-digits 3"
    assert main([*words.split(), "--systems", "IGNF:LAMB93", CHANTIER]) == 0
    assert "3 points, 1 of them free" in capsys.readouterr().out
    control = read_control_points(project / "ObjCoordWorld/Gnd")
    assert control.names == ("007", "012", "7b")
    assert control.sigmas[0].tolist() == pytest.approx([0.002] * 3)
    assert control.is_free[1].all()
    np.testing.assert_allclose(control.coordinates[0], [0, 0, 10], atol=1e-4)
    assert read_system(project / "ObjCoordWorld/Gnd") == CHANTIER
    chosen = read_control_points(project / "ObjCoordWorld/Gnd", is_chosen=lambda name, info: info == "0")
    assert chosen.names == ("012",)


def test_a_new_local_frame_is_kept_under_its_name(project):
    (project.parent / "points.txt").write_text("A 657700 6860700 10\nB 657710 6860720 12\n")
    words = ["import-gcp", "points.txt", "NXYZ"]
    main([*words, "One", "--systems", "IGNF:LAMB93", "RTL"])
    one = read_control_points(project / "ObjCoordWorld/One").coordinates
    np.testing.assert_allclose(one.mean(axis=0), 0.0, atol=1e-4)
    (project.parent / "points.txt").write_text("A 657700 6860700 10\nC 657800 6860720 12\n")
    main([*words, "Two", "--systems", "IGNF:LAMB93", "RTL"])
    two = read_control_points(project / "ObjCoordWorld/Two").coordinates
    np.testing.assert_allclose(two[0], one[0], atol=1e-9)


def test_the_training_network_is_imported_and_adjusted(project, shared_data, capsys):
    data = shared_data / "mmvii-topomini"
    words = ["import-gcp", str(data / "coords.txt"), "ANXYZ", "Known", "--free", "0", "--comment", "*"]
    assert main([*words, "--sigma", "0.001", "--systems", "IGNF:LAMB93", CHANTIER]) == 0
    assert main(["import-obs", str(data / "meas.obs"), "Field"]) == 0
    assert (project / "Topo/Field/meas.obs").read_bytes() == (data / "meas.obs").read_bytes()
    words = ["topo-adjust", "Field", "Out", "GCP3D=[[Known,1,New]]", "--json", "r.json"]
    assert main(words) == 0
    assert main(["change-sysco", "IGNF:LAMB93", "New", "Back"]) == 0
    found = read_control_points(project / "ObjCoordWorld/Back")
    place = found.coordinates[found.names.index("PtC")]
    np.testing.assert_allclose(place, [657711.001208, 6860710.002860, 10.000024], atol=2e-5)
    spread = found.sigmas[found.names.index("PtB")]
    np.testing.assert_allclose(spread, [0.006959, 0.013631, 0.001272], rtol=2e-2)
    sigma0 = json.loads((project.parent / "r.json").read_text())["sigma0"]
    assert sigma0 == pytest.approx(1.765647361, abs=2e-3)
    said = capsys.readouterr().out
    assert "too large" in said and "NOT CONVERGED" not in said
    assert "Topo/Out/" in said.partition("Written: ")[2] and "r.json" in said


@pytest.mark.parametrize("ending", [".xml", ".json"])
def test_what_was_adjusted_is_read_again_as_observations(project, shared_data, ending):
    data = shared_data / "mmvii-topomini"
    words = ["import-gcp", str(data / "coords.txt"), "ANXYZ", "Known", "--free", "0", "--comment", "*"]
    main([*words, "--sigma", "0.001", "--systems", "IGNF:LAMB93", CHANTIER])
    main(["import-obs", str(data / "meas.obs"), "Field"])
    files = [] if ending == ".xml" else ["--json-files"]
    main(["topo-adjust", "Field", "Out", "GCP3D=[[Known,1]]", *files])
    book, given = read_topo(project / "Topo/Out"), read_obs(data / "meas.obs")
    assert [path.suffix for path in (project / "Topo/Out").iterdir()] == [ending]

    def described(book):
        rows = book.observations
        ends = zip(rows.from_points, rows.to_points, strict=True)
        names = [(book.point_names[a], book.point_names[b]) for a, b in ends]
        return sorted(
            zip(rows.types.tolist(), names, rows.values.tolist(), rows.sigmas.tolist(), strict=True)
        )

    assert described(book) == described(given)
    assert len(book.stations) == len(given.stations)
    (project / "Topo/Out/more.obs").write_text("3 PtB PtC 9.1 0.01\n")
    more = read_topo(project / "Topo/Out")
    assert len(more.observations) == len(given.observations) + 1
    assert more.observations.stations[0] == -1


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["edit-metadata", "Std", "Focal"], "unknown mode 'Focal'"),
        (["edit-metadata", "Std", "Focalmm", "--modify", "(", "8", "0"], "no regular expression"),
        (["edit-metadata", "Std", "Focalmm", "--modify", "a", "8", "x"], "the rank is"),
        (["import-gcp", "points.txt", "NXY", "Out"], "Z missing"),
        (["import-gcp", "points.txt", "NXYZ", "Out", "--free", "0"], "needs the field A"),
        (["import-obs", "points.txt", "Out"], "that end in .obs"),
        (["import-obs", "none.obs", "Out"], "none.obs"),
        (["topo-adjust", "Field", "Out", "GCP3D=[[In,1]]"], "there are none"),
        (["topo-adjust", "Field", "Out", "BRW=[1,1]"], "is no option"),
    ],
)
def test_what_cannot_be_done_is_said_and_writes_nothing(project, capsys, words, reason):
    (project.parent / "points.txt").write_text("A 1 2 3\n")
    assert main(words) == 2
    assert reason in capsys.readouterr().err
    assert not list(project.rglob("*"))
