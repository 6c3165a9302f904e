"""One rule for all readers of blocks: what is left out, or made unknown, is counted and named."""

import importlib
import sys
from pathlib import Path

import pytest

from obseq.errors import InputError, ObseqError

BENCHMARKS = Path(__file__).parents[2] / "tools" / "benchmarks"

SEEN = "100 0.1 0\n1 0 0\n0 1 0\n0 0 1\n0 0 0\n"
LOST = SEEN.replace("100 0.1", "0 0")
IMAGE = 'label="lost"/>'
OFF = 'label="lost" enabled="false"/>'
CHANGES = {
    "bundler": (
        "f.txt",
        "1 1\n100 0.1 0\n1 0 0\n0 1 0\n0 0 1\n0 0 0",
        "2 1\n" + SEEN + LOST,
        "their focal length is 0: image 1",
    ),
    "colmap": ("images.txt", "1000 700 5 3 3 -1", "1000 700 5 3 3 5", "image a.jpg point 5"),
    "colmap rigs": ("rigs.txt", "", "# rigs\n", "rigs.txt: rigs are not read"),
    "metashape": (
        "f.xml",
        'label="lost"/>',
        'label="lost" enabled="false"/>',
        "1 images are not enabled: lost",
    ),
    "metashape invalid": ("f.xml", 'pinned="true"', 'pinned="true" valid="false"', "M in a"),
    "metashape predicted": ("f.xml", 'pinned="true"', 'pinned="false"', "M in a"),
    "metashape fixed": (
        "f.xml",
        "<calibration",
        '<property name="fixed" value="1"/><calibration',
        "fixed in the file: X 0",
    ),
    "metashape guessed": ("f.xml", "", "", "unknown here are F, PPx, PPy, K1, K2, K3, p1, p2, b1"),
    "metashape reference": ("f.xml", 'sz="0.02"', 'sz="0.02" enabled="false"', "not enabled: M"),
    "metashape bar": (
        "f.xml",
        'accuracy="0.001"',
        'accuracy="0.001" enabled="0"',
        "scale bars are not enabled: 0",
    ),
    "dbat": (
        "s.xml",
        "<images>",
        '<check_pts><file format="id,x,y,z">c.txt</file></check_pts><images>',
        "check points are free points, whose known coordinates take no part: 1",
    ),
    "photomodeler": ("f.txt", "1 0 0 0 0.1 0.1 0.2", "1 0 0 0 0.1 0.1 0.2", "no observations here"),
    "photomodeler mark": (
        "f.txt",
        "0 1 1000 750 0.1 0.2",
        "0 1 1000 750 0.1 0.2\n0 9 10 10 0 0",
        "9 in a.jpg",
    ),
    "photomodeler lines": ("f.txt", "750 0.1 0.2\n", "750 0.1 0.2\n\n1 2 3\n", "lines and other features"),
    "aicon image": ("b.eor", "0 1 3", "0 0 3", "images are not active, or not oriented, and are left out: i"),
    "aicon measures": ("b.eor", "0 1 3", "0 0 3", "P in i, Q in i"),
    "aicon point": (
        "b.obc",
        "Q 5 2 3 0 0 0 4 1",
        "Q 5 2 3 0 0 0 4 0",
        "points are not active and are left out: Q",
    ),
    "aicon bar": ("b.scl", "0.01 1", "0.01 0", "scale bars of b.scl are not active: P - Q"),
}
"""Reader (and what): the file that changes, what of it, into what, and what is told then."""

ONE = {"F", "PPx", "PPy"}
FREE = {
    "bal": {"F", "K1", "K2"},
    "bundler": {"F", "K1", "K2"},
    "colmap": ONE | {"b1", "K1", "K2", "p1", "p2"},
    "colmap binary": ONE | {"b1", "K1", "K2", "p1", "p2"},
    "dbat": ONE | {"b1", "K1", "K2", "K3", "p1", "p2"},
    "photomodeler": ONE | {"b1", "K1", "K2", "K3", "p1", "p2"},
    "metashape": ONE | {"b1", "K1", "K2", "K3", "p1", "p2"},
    "micmac": ONE | {"b1", "b2", "K1", "p1", "p2"},
    "aicon": ONE | {"b1", "b2", "K1", "K2", "K3", "p1", "p2"},
}
"""What the cameras of each program have, of ours."""


@pytest.fixture(scope="module")
def seeds():
    sys.path.insert(0, str(BENCHMARKS))
    yield importlib.import_module("block_seeds").exchange_seeds()
    sys.path.remove(str(BENCHMARKS))


def written(folder, files, change=("", "", "")):
    name, old, new = change
    texts = {**dict.fromkeys([name] if name else [], b""), **files}
    for path, data in texts.items():
        place = folder / path
        place.parent.mkdir(parents=True, exist_ok=True)
        assert path != name or old.encode() in data
        place.write_bytes(data.replace(old.encode(), new.encode(), 1) if path == name and old else data)
    return folder


def block_of(found):
    return found[0] if isinstance(found, tuple) else found


@pytest.mark.parametrize("case", CHANGES)
def test_what_is_left_out_is_counted_and_named(seeds, tmp_path, case):
    (files, read), (*change, told) = seeds[case.split()[0]], CHANGES[case]
    block = block_of(read(written(tmp_path, files, change)))
    assert [note for note in block.notes if told in note], block.notes


@pytest.mark.parametrize("kind", FREE)
def test_what_a_camera_has_not_is_no_unknown(seeds, tmp_path, kind):
    files, read = seeds[kind]
    block = block_of(read(written(tmp_path, files)))
    (name, camera), *_ = block.cameras.items()
    assert {term for term in camera.parameter_names if not block.is_frozen(name, term)} == FREE[kind]


def test_notes_survive_an_error_of_the_reader(seeds, tmp_path):
    files, read = seeds["metashape"]
    change = ("f.xml", IMAGE, OFF)
    folder = written(tmp_path, files, change)
    text = (folder / "f.xml").read_text()
    (folder / "f.xml").write_text(text.replace('distance="1.5"', 'distance="x"'))
    with pytest.raises(InputError) as caught:
        read(folder)
    assert "1 images are not enabled: lost" in caught.value.__notes__


def test_notes_survive_an_error_after_the_reader(seeds, tmp_path, capsys):
    from obseq.cli.guard import guarded
    from obseq.cli.main import main

    files, _ = seeds["colmap"]
    folder = written(tmp_path, files, ("images.txt", "1000 700 5 3 3 -1", "1000 700 5 3 3 5"))
    code = guarded("obseq", lambda: main(["bundle", f"--colmap={folder}", "--datum=centres"]))
    told = capsys.readouterr().err
    assert code == 2
    assert "note: 1 features are left out" in told and "image a.jpg point 5" in told


def test_an_error_tells_each_note_once():
    from obseq.errors import noting

    notes = ["one"]
    with pytest.raises(ObseqError) as caught, noting(notes), noting(notes):
        notes.append("two")
        raise ObseqError("wrong")
    assert caught.value.__notes__ == ["one", "two"]


def test_warnings_of_a_network_survive_its_error(tmp_path):
    """A data line that is switched off is told, though the network that is left has no known point."""
    from obseq.survey import Network

    (tmp_path / "a.dat").write_text(
        ".UNITS METERS\n.2D\nC A 0 0\nC B 100 0\n.DATA OFF\nC D 5 5 ! !\n.DATA ON\nD A-B 100 0.001\n"
    )
    network = Network.read_project(tmp_path / "a.dat")
    with pytest.raises(ObseqError, match="nothing remains to be adjusted") as caught:
        network.adjust()
    assert any("1 lines are switched off by .DATA OFF" in note for note in caught.value.__notes__)


def test_warnings_of_a_network_are_printed_before_its_error(tmp_path, capsys):
    from obseq.cli.guard import guarded
    from obseq.cli.main import main

    (tmp_path / "a.dat").write_text(".2D\nC A 0 0\nC B 100 0\nD A-B 100 0.001\n")
    assert guarded("obseq", lambda: main(["adjust", str(tmp_path / "a.dat")])) == 2
    said = capsys.readouterr().err
    assert "note: " in said and "no .UNITS: metres and degrees are taken" in said
