"""Reference positions of cameras in projects of Metashape."""

import numpy as np
import pytest
import scenes

from obseq import crs
from obseq.formats.metashape.reader import read_metashape
from obseq.formats.metashape.writer import metashape_files

ORIGIN = [5.0, 44.0, 300.0]


@pytest.fixture(scope="module")
def solved():
    block, _, _ = scenes.block(n_points=12)
    block.freeze_parameters("b.")
    return block.solve()


def _document(solved, path, references, more="", system=None):
    """The document that is written, with references of its first cameras."""
    (text,) = metashape_files(solved, path).values()
    for number, attributes in references.items():
        tag = f'<camera id="{number}" '
        head, _, tail = text.partition(tag)
        place = tail.index("</camera>")
        text = f"{head}{tag}{tail[:place]}<reference {attributes}/>{tail[place:]}"
    if system:
        start = text.index("<reference>LOCAL_CS")
        text = (
            text[:start] + f"<reference>{system}</reference>" + text[text.index("</reference>", start) + 12 :]
        )
    path.write_text(text.replace("<settings>", f"<settings>{more}"))
    return path


def test_cameras_keep_their_names(solved, tmp_path):
    first, _ = read_metashape(_document(solved, tmp_path / "a.xml", {}))
    again = metashape_files(first.solve(), tmp_path / "b.xml")
    (tmp_path / "b.xml").write_text(*again.values())
    assert list(read_metashape(tmp_path / "b.xml")[0].cameras) == list(first.cameras)


def test_positions_have_their_accuracy_or_that_of_the_chunk(solved, tmp_path):
    references = {
        0: 'x="1" y="2" z="3" sx="0.02" sy="0.03" sz="0.05"',
        1: 'x="4" y="5" z="6" sxyz="0.1" yaw="90" pitch="0" roll="0"',
        2: 'x="7" y="8" z="9"',
        3: 'x="0" y="0" z="0" enabled="false"',
    }
    accuracy = '<property name="accuracy_cameras" value="2"/>'
    block, _ = read_metashape(_document(solved, tmp_path / "a.xml", references, accuracy))
    (antenna,) = block.antennas
    assert antenna.images == ("i0", "i1", "i2")
    np.testing.assert_array_equal(antenna.positions, [[1, 2, 3], [4, 5, 6], [7, 8, 9]])
    np.testing.assert_allclose(antenna.sigmas, [[0.02, 0.03, 0.05], [0.1] * 3, [2.0] * 3])
    assert antenna.is_central
    assert any("reference angles of images are not taken" in note and ": i1" in note for note in block.notes)


def test_positions_on_the_earth_come_into_the_frame(solved, tmp_path):
    frame = crs.rtl_at(np.array(ORIGIN), crs.parse("Geog"))
    places = solved.poses.centres[:4]
    ground = crs.Transformer(frame, crs.parse("EPSG:4326")).forward(places)
    references = {
        k: f'x="{x!r}" y="{y!r}" z="{z!r}" sxyz="0.02"'
        for k, (x, y, z) in enumerate(np.asarray(ground).tolist())
    }
    path = _document(solved, tmp_path / "a.xml", references, system="EPSG:4326")
    text = path.read_text()
    begin = text.index("<markers>")
    path.write_text(text[:begin].rstrip() + "\n<markers>" + _without_references(text[begin + 9 :]))
    block, definition = read_metashape(path)
    (antenna,) = block.antennas
    again = crs.Transformer(crs.parse(definition), frame).forward(antenna.positions)
    np.testing.assert_allclose(again, places, atol=1e-6)
    np.testing.assert_allclose(antenna.sigmas, 0.02, rtol=1e-6)


def _without_references(text):
    """Markers whose coordinates are not known."""
    head, _, tail = text.partition("</markers>")
    lines = [
        line.partition("<reference")[0] + ("</marker>" if "<reference" in line else "")
        for line in head.split("\n")
    ]
    return "\n".join(lines) + "</markers>" + tail
