"""Names that were mistyped are told by what fits, and nothing is said of names that are merely alike."""

from dataclasses import replace
from unicodedata import normalize

import pytest
from test_slips_of_set_ups import PLACES, measured, network

from obseq.errors import InputError
from obseq.survey import Datum, Network, compare, network_from_tables
from obseq.survey.causes.names import are_alike


@pytest.mark.parametrize(
    ("a", "b"),
    [("P12", "p12"), ("P12", "P1Z"), ("P12", "PI2"), ("P.01", "P1"), ("P12", "P21"), ("P1", "P12")],
)
def test_names_with_one_slip_are_alike(a, b):
    assert are_alike(a, b) and are_alike(b, a)


@pytest.mark.parametrize(("a", "b"), [("P12", "P34"), ("P1", "P123"), ("A", "P1"), ("BM10", "BM023")])
def test_other_names_are_not(a, b):
    assert not are_alike(a, b) and not are_alike(b, a)


def renamed(name, **where):
    return [
        replace(line, target=name) if all(getattr(line, k) in v for k, v in where.items()) else line
        for line in measured()
    ]


def test_an_honest_network_is_told_nothing(tmp_path):
    adjustment = network(tmp_path, measured()).adjust()
    assert adjustment.warnings == () and not any("known" in note for note in adjustment.notes)


def test_what_a_left_out_point_may_be_is_what_its_observations_fit(tmp_path):
    lines = renamed("P12", origin=("P1",), target=("P2",), code=("3",))
    adjustment = network(tmp_path, lines).adjust()
    assert [item.name for item in adjustment.left_out] == ["P12"]
    assert adjustment.warnings[0] == "P12: did you mean P2? The observations to P12 fit it"
    adjustment = network(
        tmp_path, [*measured(), replace(lines[0], code="3", target="P12", value=50.0)]
    ).adjust()
    assert [item.name for item in adjustment.left_out] == ["P12"]
    assert not any("did you mean" in text for text in adjustment.warnings)


def test_one_point_under_two_names_is_told(tmp_path):
    adjustment = network(tmp_path, renamed("p2", origin=("P1",), target=("P2",))).adjust()
    assert adjustment.warnings[0].startswith("P2 and p2 are adjusted as two points ")
    assert adjustment.warnings[0].endswith("likely one point under two names")


def with_known(folder, *lines, known="ABC"):
    network(folder, measured(), known)
    with (folder / "s.cor").open("a") as file:
        file.writelines(f"\n{line}" for line in lines)
    return Network.read(folder / "s.obs", folder / "s.cor")


def test_a_mistyped_known_point_is_told_with_the_point_that_is_there(tmp_path):
    line = f"1 a {' '.join(map(str, PLACES['A']))} 0.002"
    adjustment = with_known(tmp_path, line, known="BC").adjust()
    (told,) = adjustment.warnings
    assert (
        told.startswith("known point a (")
        and "is in no observation; A, which is adjusted as an unknown" in told
    )
    others = "1 a 1 2 3 0.002", "1 P22 1 2 4 0.002", "0 p2 1 2 5"
    adjustment = with_known(tmp_path, *others, known="BC").adjust()
    hint, left_out = adjustment.warnings
    assert hint.startswith("p2 (") and hint.endswith(" is in no observation; did these mean P2?")
    assert left_out.startswith("point p2 is left out")
    assert adjustment.notes[-1] == "2 known points are in no observation, and control nothing: a, P22"


def test_a_network_that_fails_for_a_name_says_so(tmp_path):
    line = f"1 b {' '.join(map(str, PLACES['B']))} 0.002"
    with pytest.raises(InputError, match=r"known point b \(.*\) is in no observation; did these mean B\?"):
        with_known(tmp_path, line, known="A").adjust()


def test_names_that_look_the_same_are_one_point(tmp_path):
    """macOS writes an accent as a character of its own; other systems mostly do not."""
    one, two = normalize("NFC", "Été"), normalize("NFD", "Été")
    assert one != two
    (tmp_path / "p.cor").write_text(f"1 {two} 0 0 0 0.001\n1 B 10 0 0 0.001\n0 C 5 5 1\n")
    lines = [f"3 {name} C {length} 0.001\n" for name, length in ((one, 7.1414), ("B", 7.1414))]
    (tmp_path / "o.obs").write_text("".join([*lines, f"4 {one} C 1 0.001\n"]))
    network = Network.read(tmp_path / "o.obs", tmp_path / "p.cor")
    assert network.points.names == (one, "B", "C")
    rows = {"type": ["DH"], "from": [one], "to": ["C"], "value": [1.0], "sigma": [0.001]}
    from_memory = network_from_tables({"name": [two], "x": [0.0], "y": [0.0], "z": [0.0]}, rows)
    assert from_memory.points.names == (one, "C")
    assert Datum("inner", points=(two, "B")) == Datum("inner", points=(one, "B"))
    with pytest.raises(InputError, match="Datum: points must be"):
        Datum("inner", points="AB")  # a text is no list of names
    epoch = network.adjust()
    assert compare(epoch, epoch, points=[two, "C"]).displacements.names == (one, "C")
