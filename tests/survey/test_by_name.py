"""What people do with a network by names: leave out, weigh, ask for covariances, draw, save and load."""

from importlib.resources import files

import numpy as np
import pytest

import obseq
from obseq.errors import InputError
from obseq.survey import Datum, Network


@pytest.fixture(scope="module")
def network() -> Network:
    data = files("obseq.survey") / "data"
    return Network.read(str(data / "demo.obs"), str(data / "demo.cor"), points_crs="IGNF:LAMB93")


@pytest.fixture(scope="module")
def adjustment(network):
    return network.adjust()


def switched_off(network: Network) -> list[str]:
    rows = network.book.observations
    return [network.book.label(row).partition(" (")[0] for row in np.flatnonzero(~rows.active)]


def test_observations_are_left_out_by_name(network):
    assert switched_off(network) == []
    assert switched_off(network.without("PtA -> PtB", kind="Hz")) == ["Hz PtA -> PtB"]
    assert switched_off(network.without("demo.obs:15")) == ["Dist PtD -> PtC"]
    assert switched_off(network.without("PtD", kind="Dist")) == ["Dist PtD -> PtB", "Dist PtD -> PtC"]
    assert len(switched_off(network.without(kind="Zen"))) == 4
    assert switched_off(network) == []


def test_names_that_nothing_has_are_refused(network):
    for what, kind, message in (
        ("X9", None, "no observation names a point X9"),
        ("PtA", "DH", "no observation is of kind DH; there are Dist, Hz, Zen"),
        ("PtB -> PtA", None, "no observation is PtB -> PtA"),
    ):
        with pytest.raises(InputError, match=message):
            network.without(what, kind=kind)
    with pytest.raises(InputError, match="must be positive"):
        network.weights(kind="Dist", factor=0.0)
    for odd in ({"factor": 1e-300}, {"sigma": 1e300}):
        with pytest.raises(InputError, match=r"must be positive, at most 1e\+12"):
            network.weights(**odd)
    for odd in ({}, {"factor": 2.0, "sigma": 0.1}):
        with pytest.raises(InputError, match="either a factor of the sigmas or a sigma"):
            network.weights(**odd)


def test_sigmas_are_changed_by_name(network):
    before = network.book.observations.sigmas
    after = network.weights("PtA", kind="Dist", factor=2.0).book.observations.sigmas
    changed = [network.book.label(row).partition(" (")[0] for row in np.flatnonzero(after != before)]
    assert changed == ["Dist PtA -> PtB", "Dist PtA -> PtC"]
    np.testing.assert_allclose(after[after != before], 2.0 * before[after != before])
    same = network.weights(kind="Hz", sigma=1e-5).book
    hz = [row for row in range(len(before)) if same.label(row).startswith("Hz")]
    assert set(same.observations.sigmas[hz].tolist()) == {1e-5}


def test_covariances_of_points_together(adjustment):
    both = adjustment.covariance("PtB", "PtC")
    rows = [adjustment.points.names.index(name) for name in ("PtB", "PtC")]
    for k, row in enumerate(rows):
        at = slice(3 * k, 3 * k + 3)
        np.testing.assert_allclose(both[at, at], adjustment.points.covariances[row], rtol=1e-9)
    assert np.abs(both[:3, 3:]).max() > 0.0
    np.testing.assert_allclose(both, both.T)
    np.testing.assert_allclose(
        both, adjustment.covariance("PtC", "PtB")[np.ix_([3, 4, 5, 0, 1, 2], [3, 4, 5, 0, 1, 2])]
    )
    assert adjustment.covariance().shape == (12, 12)
    with pytest.raises(InputError, match="X9 is no point of this adjustment; its points are PtA"):
        adjustment.covariance("X9")


def test_an_ellipse_at_a_level(adjustment):
    standard, large = adjustment.ellipse("PtC", None), adjustment.ellipse("PtC", 0.95)
    block = adjustment.covariance("PtC")[:2, :2]
    assert standard.semi_major**2 == pytest.approx(np.linalg.eigvalsh(block)[1])
    assert large.semi_major > 2.0 * standard.semi_major
    assert large.bearing == pytest.approx(standard.bearing)


def test_robust_weights_hold_a_blunder_down(tmp_path):
    """A levelling of which every difference is measured: one is 0.1 m off, the heights hardly move."""
    heights = {"A": 0.0, "B": 1.0, "C": 3.0, "D": 2.0, "E": 5.0}
    pairs = [(a, b) for a in heights for b in heights if a < b]
    lines = [f"4 {a} {b} {heights[b] - heights[a] + (0.1 if a + b == 'BD' else 0.0)} 0.001" for a, b in pairs]
    (tmp_path / "level.obs").write_text("\n".join(lines) + "\n", encoding="utf-8")
    points = ["5 A 0 0 0 0.001", *(f"4 {name} 0 0 0" for name in "BCDE")]
    (tmp_path / "level.cor").write_text("\n".join(points) + "\n", encoding="utf-8")
    network = Network.read(tmp_path / "level.obs", tmp_path / "level.cor", frame="Local")
    plain, robust = network.adjust(), network.adjust(loss="tukey")
    off = []
    for found in (plain, robust):
        places = dict(zip(found.points.names, found.points.places[:, 2].tolist(), strict=True))
        off.append(max(abs(places[name] - height) for name, height in heights.items()))
    assert off[0] > 0.01
    assert off[1] < 1e-5
    assert robust.warnings[-1].startswith("robust weights (tukey): 1 observations have less than")
    with pytest.raises(InputError, match="no loss is named 'huge'"):
        network.adjust(loss="huge")


def test_results_are_saved_and_loaded(adjustment, tmp_path):
    for name in ("r.json", "r.html", "r.txt"):
        adjustment.save(tmp_path / name)
    assert obseq.load(tmp_path / "r.json") == adjustment.record()
    assert "Dist" in (tmp_path / "r.txt").read_text()
    with pytest.raises(InputError, match=r"r\.odt: a result is saved as \.json, \.html, \.txt"):
        adjustment.save(tmp_path / "r.odt")


def test_the_plan_is_drawn(adjustment):
    matplotlib = pytest.importorskip("matplotlib", reason="no matplotlib (pip install 'obseq[plot]')")
    matplotlib.use("Agg")
    axes = adjustment.plot(residuals=True)
    ellipses = axes.collections[-1]
    assert len(ellipses.get_offsets()) == len(adjustment.points.names)
    assert [text.get_text() for text in axes.texts] == list(adjustment.points.names)
    assert "ellipses 95 %" in axes.get_title()


def test_a_datum_may_be_a_word(network, adjustment):
    free, said = network.adjust(datum="inner"), network.adjust(datum=Datum("inner"))
    np.testing.assert_array_equal(free.points.coordinates, said.points.coordinates)
    assert free.covariance("PtA")[0, 0] != pytest.approx(adjustment.covariance("PtA")[0, 0])
    with pytest.raises(InputError, match="'flat' is unknown; there are given, fixed, inner"):
        network.adjust(datum="flat")


def test_a_loaded_result_has_the_tables(adjustment, tmp_path):
    adjustment.save(tmp_path / "r.json")
    loaded = obseq.load(tmp_path / "r.json")
    assert loaded.table("observations")["residual"] == adjustment.table("observations")["residual"]
    assert len(loaded.table("observations").where(origin="PtA", type="Hz").rows) == 2
