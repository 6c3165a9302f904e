"""What we write for gama-local against the published grammar of its files, as a table.

The table is that of the element and attribute lists of the schema 1.02 in Gama's manual (chapter "Input data
format"): order of children, attributes that must and may be there, and the unit and kind of each value.
It knows nothing of our writer or reader.
"""

import math
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from obseq.formats.conversion import write_gama
from obseq.survey import Network

SPACE = "{http://www.gnu.org/software/gama/gama-local}"
DATA = Path(__file__).parents[3] / "shared" / "data"
NETWORKS = sorted(path.relative_to(DATA).as_posix() for path in DATA.glob("gama-*/*.gkf"))

GON, SIZE, POSITIVE, HEIGHT, NAME, TEXT = "gon", "number", "positive", "number", "name", "text"
SIGHT = {"to": NAME, "val": GON}, {"stdev": POSITIVE, "from_dh": HEIGHT, "to_dh": HEIGHT, "extern": TEXT}
OTHER = {"to": NAME, "val": GON}, SIGHT[1] | {"from": NAME}
LENGTH = {"to": NAME, "val": POSITIVE}, OTHER[1]
GRAMMAR = {
    "gama-local": ({}, {"version": TEXT}),
    "network": (
        {},
        {"axes-xy": "ne|sw|es|wn|en|nw|se|ws", "angles": "left-handed|right-handed", "epoch": SIZE},
    ),
    "description": ({}, {}),
    "parameters": (
        {},
        {"sigma-apr": POSITIVE, "conf-pr": POSITIVE, "tol-abs": POSITIVE, "sigma-act": "aposteriori|apriori"},
    ),
    "points-observations": ({}, {}),
    "point": ({"id": NAME}, {"x": SIZE, "y": SIZE, "z": SIZE, "fix": "xy|z|xyz", "adj": "(?i:xy)?[zZ]?"}),
    "obs": ({}, {"from": NAME}),
    "direction": SIGHT,
    "azimuth": OTHER,
    "z-angle": OTHER,
    "distance": LENGTH,
    "s-distance": LENGTH,
    "angle": ({"bs": NAME, "fs": NAME, "val": GON}, {"from": NAME, "stdev": POSITIVE, "extern": TEXT}),
    "height-differences": ({}, {}),
    "dh": ({"from": NAME, "to": NAME, "val": SIZE}, {"stdev": POSITIVE, "dist": POSITIVE, "extern": TEXT}),
    "vectors": ({}, {}),
    "vec": (
        {"from": NAME, "to": NAME, "dx": SIZE, "dy": SIZE, "dz": SIZE},
        {"from_dh": HEIGHT, "to_dh": HEIGHT, "extern": TEXT},
    ),
    "coordinates": ({}, {"extern": TEXT}),
    "cov-mat": ({"dim": "[1-9][0-9]*", "band": "[0-9]+"}, {}),
}
"""Of each element: attributes that must be there, and those that may, with what they hold."""
CHILDREN = {
    "gama-local": r"network",
    "network": r"(description )?(parameters )*(points-observations ?)+",
    "points-observations": r"((point|obs|height-differences|vectors|coordinates) ?)*",
    "obs": r"((direction|distance|s-distance|angle|z-angle|azimuth) ?)+(cov-mat)?",
    "height-differences": r"(dh ?)+(cov-mat)?",
    "vectors": r"(vec )+cov-mat",
    "coordinates": r"(point )+cov-mat",
}
"""Of each element, its children in their order."""


def number(text):
    assert re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", text), text
    return float(text)


def check_value(kind, text):
    if kind in (GON, SIZE, POSITIVE):
        value = number(text)
        assert math.isfinite(value)
        assert kind != POSITIVE or value > 0.0
        assert kind != GON or 0.0 <= value < 400.0
    elif kind == NAME:
        assert text
        assert text == " ".join(text.split())
    elif kind != TEXT:
        assert re.fullmatch(kind, text), text


def check(element):
    name = element.tag.removeprefix(SPACE)
    assert element.tag.startswith(SPACE)
    wanted, allowed = GRAMMAR[name]
    assert set(wanted) <= set(element.attrib), (name, element.attrib)
    assert set(element.attrib) <= {*wanted, *allowed}, (name, element.attrib)
    for key, text in element.attrib.items():
        check_value((wanted | allowed)[key], text)
    children = " ".join(child.tag.removeprefix(SPACE) for child in element)
    assert re.fullmatch(CHILDREN.get(name, ""), children + " " * children.endswith("points-observations")), (
        name
    )
    for child in element:
        check(child)


def scalars(element):
    name = element.tag.removeprefix(SPACE)
    if name == "point":
        return sum(axis in element.attrib for axis in "xyz")
    return 3 if name == "vec" else 1


def covariances(root):
    """Each covariance matrix, with the number of scalars of its set."""
    for group in root.iter():
        matrix = group.find(SPACE + "cov-mat")
        if matrix is not None:
            size, band = int(matrix.get("dim")), int(matrix.get("band"))
            numbers = [number(text) for text in matrix.text.split()]
            yield size, band, numbers, sum(scalars(child) for child in group if child is not matrix)


@pytest.fixture(params=NETWORKS)
def written(request, shared_data, tmp_path):
    network = Network.read_project(shared_data / request.param)
    write_gama(tmp_path / "written.gkf", network)
    return network, ElementTree.parse(tmp_path / "written.gkf").getroot()


def test_files_follow_the_grammar(written):
    _, root = written
    check(root)
    points = root.find(f"{SPACE}network/{SPACE}points-observations").findall(SPACE + "point")
    for point in points:
        assert ("x" in point.attrib) == ("y" in point.attrib)
        assert point.get("fix") or point.get("adj")
    assert len({point.get("id") for point in points}) == len(points)


def test_matrices_are_whole_and_positive_definite(written):
    _, root = written
    for size, band, numbers, of_set in covariances(root):
        assert size == of_set
        assert len(numbers) == size * (band + 1) - band * (band + 1) // 2
        whole, at = np.zeros((size, size)), 0
        for row in range(size):
            last = min(row + band, size - 1) + 1
            whole[row, row:last] = numbers[at : at + last - row]
            at += last - row
        np.linalg.cholesky(whole + np.triu(whole, 1).T)


def test_observations_have_a_precision_of_their_own_or_a_matrix(written):
    _, root = written
    for group in root.find(f"{SPACE}network/{SPACE}points-observations"):
        if group.tag.removeprefix(SPACE) in ("obs", "height-differences"):
            has_matrix = group.find(SPACE + "cov-mat") is not None
            for child in group:
                if not child.tag.endswith("cov-mat"):
                    assert has_matrix != ("stdev" in child.attrib)


def test_figures_are_written_to_the_last_digit(written):
    """Lengths in metres, angles in gon (not radians), read with Python's own parser, unit by unit."""
    network, root = written
    rows = network.book.observations
    lengths = np.unique(rows.values[rows.active & np.isin(rows.types, (3, 101))])
    texts = [float(e.get("val")) for name in ("distance", "s-distance") for e in root.iter(SPACE + name)]
    np.testing.assert_array_equal(np.unique(texts), lengths)
    angles = [float(e.get("val")) for name in ("direction", "angle") for e in root.iter(SPACE + name)]
    given = rows.values[rows.active & np.isin(rows.types, (5, 111))] * 200.0 / np.pi % 400.0
    turns = np.remainder(np.sort(angles) - np.sort(given) + 200.0, 400.0) - 200.0
    assert np.abs(turns).max(initial=0.0) < 1e-11
