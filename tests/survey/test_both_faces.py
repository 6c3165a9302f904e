"""Sights in both faces of the telescope: refused by name, not adjusted as if all were of the first."""

import pytest

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.survey import Network, network_from_tables

POINTS = "".join(
    f"1 {name} {x} {y} {z} 0.002\n"
    for name, x, y, z in (("A", 0, 0, 10), ("B", 200, 0, 14), ("C", 180, 150, 8))
)
DIRECTIONS = {"A": 226.0337, "B": 96.5170, "C": 20.3483}
ZENITHS = {"A": 101.5912, "B": 99.2883, "C": 102.1286}


def lines(turns=(), complements=()):
    """A free station; of some targets the direction, or the zenith angle, is read in the second face too."""
    for code, name in zip((7, 5, 5), DIRECTIONS, strict=True):
        yield f"{code} S {name} {DIRECTIONS[name]} 0.0008"
        yield f"6 S {name} {ZENITHS[name]} 0.0012 0 1.5 0"
    yield from (f"5 S {name} {(DIRECTIONS[name] + 200.0007) % 400.0:.4f} 0.0008" for name in turns)
    yield from (f"6 S {name} {400.0 - ZENITHS[name]:.4f} 0.0012 0 1.5 0" for name in complements)


def written(tmp_path, *given):
    (tmp_path / "s.cor").write_text(POINTS)
    (tmp_path / "s.obs").write_text("\n".join(lines(*given)) + "\n")
    return tmp_path / "s.obs", tmp_path / "s.cor"


@pytest.mark.parametrize("given", [("AB", ""), ("", "AC"), ("B", "B"), ("ABC", "ABC")])
def test_sights_in_both_faces_are_refused(tmp_path, given, capfd):
    obs, cor = written(tmp_path, *given)
    assert main(["adjust", "--obs", str(obs), "--cor", str(cor)]) == 2
    said = capfd.readouterr().err
    assert f"S sights {', '.join(dict.fromkeys(given[0] + given[1]))} in both faces" in said
    assert "s.obs:7" in said and "400 gon" in said


def test_one_slip_is_left_to_the_search_of_gross_errors(tmp_path):
    obs, cor = written(tmp_path, "", "B")
    assert "Zen" in Network.read(obs, cor).adjust().gross_errors[0].what


def test_sights_near_the_vertical_and_other_set_ups_are_no_second_face(tmp_path):
    obs, cor = written(tmp_path)
    turned = [
        f"{code} S {name} {DIRECTIONS[name] - 200} 0.001" for code, name in zip((7, 5), "AB", strict=True)
    ]
    plumb = ["6 S Z 0.0021 0.01", "6 S Z -0.0018 0.01", "6 S N 199.9985 0.01", "6 S N 200.0013 0.01"]
    obs.write_text(obs.read_text() + "\n".join([*turned, *plumb]) + "\n")
    assert len(Network.read(obs, cor).book.observations) == 12


def test_tables_and_files_of_other_programs_are_looked_at_too():
    known = {"name": ["A", "B", "C"], "x": [0, 200, 180], "y": [0, 0, 150], "z": [10, 14, 8]}
    rows = {"type": ["Hz"] * 4, "from": ["S"] * 4, "to": ["A", "B", "A", "B"], "sigma": [1e-5] * 4}
    values = {"value": [0.1, 1.2, 0.1 + 3.14159, 1.2 + 3.14159]}
    with pytest.raises(InputError, match=r"S sights A, B in both faces .*Hz S -> A .*code 7"):
        network_from_tables(known, rows | values)
