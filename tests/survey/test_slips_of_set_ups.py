"""Slips that a set-up, a target or a pair of readings makes: each is planted in a good network, and named."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from obseq.report import summary
from obseq.survey import Network, Quality
from obseq.survey.screening.findings import Cause

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


def exchanged(folder, *codes):
    """The gross errors when the readings from P2 to P3 and P4 are exchanged."""
    values = {
        (line.code, line.target): line.value
        for line in measured()
        if line.origin == "P2" and line.target in ("P3", "P4")
    }
    other = {"P3": "P4", "P4": "P3"}
    return spoilt(
        folder,
        lambda line: {"value": values[line.code, other[line.target]]},
        origin=("P2",),
        target=("P3", "P4"),
        code=codes,
    )


def test_an_honest_network_raises_no_alarm(tmp_path):
    assert network(tmp_path, measured()).gross_errors() == ()


@pytest.mark.parametrize("codes", [("5",), ("6",), ("3",), ("5", "6")])
def test_exchanged_readings_are_named(tmp_path, codes):
    (error,) = exchanged(tmp_path, *codes)
    assert error.cause is Cause.SWAPPED_NAMES and set(error.points) == {"P3", "P4"}
    assert error.text == "the two readings are exchanged: each fits in place of the other"
    assert len(error.rows) == 2 * len(codes)


def test_readings_of_whole_sights_may_be_names(tmp_path):
    (error,) = exchanged(tmp_path, "5", "6", "3")
    assert error.text.startswith("the names P") and error.text.endswith(" are exchanged, or the two readings")


@pytest.mark.parametrize(
    ("height", "words"),
    [
        (lambda h: 0.0, ": likely it was left out"),
        (lambda h: h / 0.3048, "likely: feet instead of metres"),
        (lambda h: h + 0.2, "m fits"),
    ],
)
def test_a_wrong_height_of_instrument_is_named(tmp_path, height, words):
    (true,) = {line.instrument for line in measured() if line.origin == "A"}
    (error,) = spoilt(tmp_path, lambda line: {"instrument": height(line.instrument)}, origin=("A",))
    assert error.cause is Cause.HEIGHT and "height of the instrument" in error.what and "from A" in error.what
    assert f"{height(true):.4f} m is written" in error.text and words in error.text
    fits = float(error.text.partition("written, ")[2].partition(" m fits")[0])
    assert abs(fits - true) < 0.005
    assert "nothing tells" not in error.text  # the height of A is known


def test_at_a_point_of_unknown_height_the_targets_on_it_may_be_wrong_instead(tmp_path):
    (error,) = spoilt(tmp_path, lambda line: {"prism": line.prism + 0.1}, target=("P4",))
    assert error.cause is Cause.HEIGHT
    assert "height of the target of 12 observations to P4" in error.text + error.what
    assert "height of the instrument of 12 observations from P4" in error.text + error.what
    assert error.text.endswith("nothing tells these apart")


@pytest.mark.parametrize(("off", "may_be_target"), [(3.0, False), (-30.0, False), (-3.0, True)])
def test_a_target_under_the_ground_or_in_the_sky_is_not_thought_of(tmp_path, monkeypatch, off, may_be_target):
    """C is a target only: its height may be wrong, or that of all targets on it, where that can be."""
    lines = [line for line in measured() if line.origin != "C"]
    monkeypatch.setitem(PLACES, "C", (1090.0, 2190.0, 97.0 + off))
    (error,) = network(tmp_path, lines).gross_errors()
    assert error.points == ("C",) and "known point C" in error.what
    assert ("height of the target" in error.text) == may_be_target


def test_a_forgotten_height_of_one_target_is_named(tmp_path):
    (error,) = spoilt(tmp_path, lambda line: {"prism": 0.0}, origin=("P2",), target=("P4",))
    assert error.what.startswith("height of the target of 2 observations from P2 to P4")
    assert error.text.endswith("likely it was left out")


@pytest.mark.parametrize("where", [{"origin": ("P2",)}, {"target": ("P4",)}])
def test_the_constant_of_one_prism_is_named(tmp_path, where):
    (error,) = spoilt(tmp_path, lambda line: {"value": line.value - 0.0344}, code=("3",), **where)
    assert error.cause is Cause.DISTANCES and len(error.rows) == 6
    assert "likely the constant of the prism" in error.text
    assert abs(float(error.text.split()[0]) - 0.0344) < 0.003


@pytest.mark.parametrize(
    ("change", "words"), [(lambda v: v / 1000.0, "kilometres"), (lambda v: v / 0.3048, "feet")]
)
def test_one_distance_in_another_unit(tmp_path, change, words):
    where = {"code": ("3",), "origin": ("P2",), "target": ("P4",)}
    (error,) = spoilt(tmp_path, lambda line: {"value": change(line.value)}, **where)
    assert error.cause is Cause.UNITS and f"{words} instead of metres" in error.text


def small_errors(count):
    """The lines with some errors of eight sigmas or so: too small to be announced before the adjustment."""
    wrong = {("3", "P2", "P4"): 0.018, ("6", "P3", "B"): -0.007, ("5", "P1", "C"): 0.008}
    wrong = dict(list(wrong.items())[:count])
    return [
        replace(line, value=line.value + wrong.get((line.code, line.origin, line.target), 0.0))
        for line in measured()
    ]


def test_several_gross_errors_are_listed_in_the_order_of_their_removal(tmp_path):
    adjustment = network(tmp_path, small_errors(3)).adjust()
    assert adjustment.gross_errors == () and adjustment.suspicion is not None
    told = adjustment.warnings[0]
    assert told.startswith("3 gross errors, each found once those before it are left out: 1. ")
    first, second, third = (told.index(name) for name in ("Dist P2 -> P4", "Zen P3 -> B", "Hz P1 -> C"))
    assert first < second < third
    assert adjustment.suspicion.observations[0].startswith("Dist P2 -> P4")


@pytest.mark.parametrize("count", [0, 1])
def test_one_gross_error_needs_no_list(tmp_path, count):
    assert network(tmp_path, small_errors(count)).adjust().warnings == ()


def test_without_reliability_it_is_said_that_nothing_is_tested(tmp_path):
    record = network(tmp_path, small_errors(3)).adjust(quality=Quality(reliability=False)).record()
    assert record.suspicion is None
    assert "single observations are not tested without reliability" in summary(record)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda v: 0.99978 * v, "ppm to add): likely coordinates of a map"),
        (lambda v: v + 0.012, "a constant added to all of them fits"),
    ],
)
def test_what_all_distances_share_is_named_though_none_stands_out(tmp_path, change, words):
    lines = [replace(line, value=change(line.value)) if line.code == "3" else line for line in measured()]
    made = network(tmp_path, lines)
    assert made.gross_errors() == ()  # no misfit of ten sigmas
    (error,) = made.adjust().gross_errors
    assert error.cause == Cause.DISTANCES and words in error.text and "nothing tells apart" not in error.text


def test_a_scale_between_two_known_points_may_be_theirs(tmp_path):
    lines = [replace(line, value=0.9996 * line.value) if line.code == "3" else line for line in measured()]
    (error,) = network(tmp_path, lines, known=("A", "B")).adjust().gross_errors
    assert "one scale for all of them fits (4" in error.text
    assert "or, which nothing tells apart, a gross error in one of known x of A" in error.text


def test_a_known_point_is_not_taken_for_a_scale(tmp_path):
    made = network(tmp_path, measured())
    text = (tmp_path / "s.cor").read_text().replace("2190.0", "2190.025")
    (tmp_path / "s.cor").write_text(text)
    adjustment = Network.read(tmp_path / "s.obs", tmp_path / "s.cor").adjust()
    assert made.adjust().suspicion is None and adjustment.gross_errors == ()
    assert adjustment.suspicion.observations[0].startswith("known y of C")


def test_an_error_of_the_index_is_one_finding(tmp_path):
    """All zenith angles of a set-up are off by the same: they were listed one by one."""
    (error,) = spoilt(tmp_path, lambda line: {"value": line.value + 40.0}, origin=("P2",), code=("6",))
    assert error.cause is Cause.INDEX and len(error.rows) == len(PLACES) - 1
    assert error.what.startswith("the 6 zenith angles from P2 ")
    assert float(error.text.split()[0]) == pytest.approx(-40.0, abs=0.003)
