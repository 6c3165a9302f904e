"""A sigma out of line with those of its kind is named where it decides what is said of its observation."""

import pytest

from obseq.survey import Network, network_from_tables

RISES = [("A", "P", 1.5004), ("P", "Q", 1.6993), ("Q", "B", -1.2002), ("B", "R", -2.7003), ("R", "A", 0.7003)]
RISES += [("P", "B", 0.5005), ("P", "R", -2.1995)]


def notes(off: float, sigma: float) -> list[str]:
    """What is said of the sigmas of a levelling whose last line is off and has a sigma of its own (m)."""
    points = {"name": ["A", "B", "P", "Q", "R"], "x": [0.0] * 5, "y": [0.0] * 5, "z": [100.0] + [None] * 4}
    points |= {"sx": [0.0] * 5, "sy": [0.0] * 5, "sz": [0.0] + [None] * 4}
    begin, end, values = zip(*RISES, strict=True)
    rows = {"type": ["DH"] * 7, "from": begin, "to": end, "value": [*values[:-1], values[-1] + off]}
    adjustment = network_from_tables(points, rows | {"sigma": [0.001] * 6 + [sigma]}).adjust()
    return [text for text in adjustment.notes if text.startswith("the sigma of ")]


@pytest.mark.parametrize(
    ("off", "sigma", "words"),
    [
        (0.1, 1.0, ("1000 times larger", "hides a misfit of 100.9", "101 times the usual one")),
        (-0.005, 1e-6, ("1000 times smaller", "lets the tests reject a misfit of -4.0", "DH P -> R")),
    ],
)
def test_a_sigma_that_decides_is_named(off, sigma, words):
    (said,) = notes(off, sigma)
    assert all(word in said for word in words) and "usual one of DH observations (1.00 mm)" in said


@pytest.mark.parametrize(("off", "sigma"), [(0.0, 1.0), (0.0, 1e-6), (0.1, 0.02), (0.1, 0.001), (10.0, 1.0)])
def test_a_sigma_is_not_named_where_nothing_depends_on_it_or_the_tests_see_the_error(off, sigma):
    assert notes(off, sigma) == []


KNOWN = ["1 A 0 0 10 0.001", "1 B 100 0 12 0.001", "1 C 90 80 11 0.001", "1 E 0 90 9 0.001", "0 D 40 50 14"]
LINES = ["3 A D 64.1545 0.002", "3 B D 78.1276 0.002", "3 C D 58.3889 0.002", "3 E D 56.7974 0.002"]


@pytest.mark.parametrize(
    ("points", "lines", "told"),
    [
        (KNOWN, LINES, []),
        ([*KNOWN[:1], "1 B 100 0 12 2019", *KNOWN[2:]], LINES, ["p.cor:2: the sigma of the known point B"]),
        (KNOWN, [*LINES[:3], "3 E D 56.7974 2019"], ["Dist E -> D (o.obs:4) is 2019 m: it has next to no"]),
        (KNOWN, [*LINES[:3], "3 E D 56.7974 20"], ["Dist E -> D (o.obs:4) is 20 m"]),
        (KNOWN, [f"{line[:-5]}{year}" for year, line in enumerate(LINES, 2000)], ["and 3 more are like it"]),
        ([f"{line[:-5]}20" for line in KNOWN[:4]] + KNOWN[4:], LINES, []),
    ],
)
def test_a_year_or_a_code_in_the_place_of_a_sigma_is_told(tmp_path, monkeypatch, points, lines, told):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "p.cor").write_text("\n".join(points))
    (tmp_path / "o.obs").write_text("\n".join(lines))
    found = [text for text in Network.read("o.obs", "p.cor").book.warnings if "sigma" in text]
    assert len(found) == len(told)
    assert all(words in text for words, text in zip(told, found, strict=True))
