"""Slips that a set-up, a target or a pair of readings makes: each is planted in a good network, and named."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from verdicts import alternatives, codes, lines

from obseq.survey import Network

PLACES = {"A": (1000.0, 2000.0, 100.0), "B": (1180.0, 2030.0, 104.0), "C": (1090.0, 2190.0, 97.0)}
PLACES |= {"P1": (1060.0, 2060.0, 101.5), "P2": (1130.0, 2110.0, 99.0), "P3": (1010.0, 2130.0, 98.2)}
PLACES |= {"P4": (1205.0, 2140.0, 102.7)}
GON = 200.0 / math.pi
ANGLE, LENGTH = 0.001, 0.002
"""Noise, gon and m."""


@dataclass(frozen=True)
class Line:
    """A line of an OBS file."""

    code: str
    origin: str
    target: str
    value: float
    sigma: float
    instrument: float
    prism: float

    @property
    def text(self):
        heights = f"0 {self.instrument:.4f} {self.prism:.4f}"
        return f"{self.code} {self.origin} {self.target} {self.value:.4f} {self.sigma} {heights}"


def sight(random, origin, target, zero, instrument, code="5"):
    """A direction, a zenith angle and a slope distance."""
    prism = round(random.uniform(1.3, 1.7), 3)
    east, north, up = np.subtract(PLACES[target], PLACES[origin])
    up += prism - instrument
    values = math.atan2(east, north) * GON - zero, math.atan2(math.hypot(east, north), up) * GON
    heights = instrument, prism
    hz, zen = (value + random.normal(0.0, ANGLE) for value in values)
    length = math.hypot(east, north, up) + random.normal(0.0, LENGTH)
    yield Line(code, origin, target, hz % 400.0, ANGLE, *heights)
    yield Line("6", origin, target, zen, ANGLE, *heights)
    yield Line("3", origin, target, length, LENGTH, *heights)


def measured(seed=1):
    """Every point observes all the others."""
    random = np.random.default_rng(seed)
    lines = []
    for origin in PLACES:
        zero, instrument = random.uniform(0.0, 400.0), round(random.uniform(1.4, 1.7), 3)
        for k, target in enumerate(name for name in PLACES if name != origin):
            lines += sight(random, origin, target, zero, instrument, "5" if k else "7")
    return lines


def network(folder, lines, known=("A", "B", "C")):
    texts = [f"1 {name} {' '.join(map(str, PLACES[name]))} 0.002" for name in known]
    (folder / "s.obs").write_text("\n".join(line.text for line in lines))
    (folder / "s.cor").write_text("\n".join(texts))
    return Network.read(folder / "s.obs", folder / "s.cor")


def spoilt(folder, change, **where):
    """The gross errors of the network with the lines changed that have these fields."""
    lines = [
        replace(line, **change(line)) if all(getattr(line, k) in v for k, v in where.items()) else line
        for line in measured()
    ]
    assert lines != measured()
    return network(folder, lines).gross_errors()


def test_an_honest_network_raises_no_alarm(tmp_path):
    assert network(tmp_path, measured()).gross_errors() == ()


@pytest.mark.parametrize(
    ("height", "code"), [(lambda h: 0.0, "W114"), (lambda h: -h, "W115"), (lambda h: h + 0.2, "S130")]
)
def test_a_wrong_height_of_instrument_is_named(tmp_path, height, code):
    (true,) = {line.instrument for line in measured() if line.origin == "A"}
    (error,) = spoilt(tmp_path, lambda line: {"instrument": height(line.instrument)}, origin=("A",))
    assert error.code == "S130" and code in codes(error)
    assert error.size[0] == pytest.approx(height(true) - true, abs=0.005)
    wrong = {k for k, line in enumerate(measured(), 1) if line.origin == "A" and line.code in "36"}
    assert lines(error) == wrong


def test_at_a_point_of_unknown_height_the_targets_on_it_may_be_wrong_instead(tmp_path):
    (error,) = spoilt(tmp_path, lambda line: {"prism": line.prism + 0.1}, target=("P4",))
    told = {one.code: lines(one) for one in alternatives(error)}
    assert {"S130", "S131"} <= told.keys() and len(told["S131"]) == len(told["S130"]) == 12


def test_a_forgotten_height_of_one_target_is_named(tmp_path):
    (error,) = spoilt(tmp_path, lambda line: {"prism": 0.0}, origin=("P2",), target=("P4",))
    wrong = {
        k
        for k, line in enumerate(measured(), 1)
        if (line.origin, line.target) == ("P2", "P4") and line.code in "36"
    }
    assert any(lines(one) == wrong and one.code == "S131" for one in alternatives(error))


def test_an_instrument_on_another_point_than_is_noted_is_named(tmp_path):
    found = [line for line in measured() if (line.origin, line.target) != ("P2", "P1")]
    noted = [replace(line, origin="P1") if line.origin == "P2" else line for line in found]
    (error,) = network(tmp_path, noted).gross_errors()
    assert error.code == "S161" and [slip.text for slip in error.slips] == ["the instrument stood on P2"]
    assert lines(error) == {k for k, line in enumerate(found, 1) if line.origin == "P2"}
