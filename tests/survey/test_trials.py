"""How much of a network is unexplained, before causes are tried and with them, and what is not tried."""

from types import SimpleNamespace

import numpy as np
import pytest

from obseq.survey import fieldwork
from obseq.survey.kinds.directions import ZEN
from obseq.survey.screening.groups import group_cause
from obseq.survey.screening.known_points import known_point_cause
from obseq.survey.screening.robust import estimate
from obseq.survey.screening.trials import Trials


def of_network(network):
    """The trials of a network as it is."""
    work = network.fieldwork
    model = work.model()
    return Trials(model, estimate(model, work.points, work.book))


def with_mistake(planted, folder, mistake, seed=1):
    """The network of a site with a mistake."""
    random = np.random.default_rng(seed)
    site = planted.made_site(random)
    getattr(planted, mistake)(site, random)
    return site.read(folder)


def test_contradictions_and_what_is_lost_make_the_disagreement(planted, tmp_path):
    found = of_network(with_mistake(planted, tmp_path, "one_digit")).found
    assert found.disagreement(10.0) == pytest.approx(found.contradictions(10.0).sum())
    found.misfits[0] = np.nan
    assert found.contradictions(10.0)[0] == 0.0
    assert found.disagreement(10.0) == pytest.approx(found.contradictions(10.0).sum() + 1.0)


def replace_lost(estimate, lost):
    """The same estimate, if fewer observations of it were lost."""
    return SimpleNamespace(lost=lost, disagreement=estimate.disagreement)


def test_noise_is_what_an_honest_network_contradicts(planted, tmp_path):
    """So that causes of few observations explain them among thousands of good ones."""
    site = planted.made_site(np.random.default_rng(4), planted.LARGE)
    trials = of_network(site.read(tmp_path))
    assert trials.before == pytest.approx(trials.found.noise, rel=0.2)
    trials.before += 8.0
    left = {share: trials.found.noise + share * 8.0 for share in (0.2, 0.5)}
    few, many = (SimpleNamespace(lost=0, disagreement=lambda _, one=one: one) for one in left.values())
    assert trials.explains(few) and not trials.explains(many)
    trials.found.misfits[:20] = np.nan
    trials.before += 20.0
    lost = SimpleNamespace(lost=20, disagreement=lambda _: left[0.2] + 20.0)
    assert trials.explains(lost), "what is lost before and after says nothing"
    assert not trials.explains(replace_lost(lost, 0))


@pytest.fixture
def tried(monkeypatch):
    """Points and observations that are tried, in vain."""
    networks = []
    monkeypatch.setattr(Trials, "explaining", lambda _, *network: networks.append(network))
    return networks


@pytest.mark.parametrize("mistake", ["exchanged_known_points", "mistyped_coordinate"])
def test_angles_are_not_put_right_to_what_no_instrument_reads(planted, tmp_path, tried, mistake):
    """Zenith angles beyond 200 gon, and circles that turn as a whole, fit nothing wherever the points are."""
    network = with_mistake(planted, tmp_path, mistake)
    assert group_cause(of_network(network)) is None
    rows = network.book.observations
    moves = [book.observations.values - rows.values for _, book in tried]
    assert moves and all(np.ptp(move[move != 0.0]) > 1e-6 for move in moves)
    changed = [(rows.types == ZEN.code) & (move != 0.0) for move in moves]
    zeniths = [(rows.values + move)[mask] for move, mask in zip(moves, changed, strict=True) if mask.any()]
    assert zeniths and all(0.0 <= np.median(angles) <= np.pi for angles in zeniths)


@pytest.mark.parametrize(
    ("mistake", "is_tried"), [("mistyped_coordinate", False), ("swapped_coordinates", True)]
)
def test_a_good_point_is_not_put_right_to_another_country(planted, tmp_path, tried, mistake, is_tried):
    """Easting and northing of a point are exchanged where that does not take it away from all others."""
    network = with_mistake(planted, tmp_path, mistake)
    assert known_point_cause(of_network(network), network.point_system) is None
    given = network.points.coordinates
    moves = [np.linalg.norm(points.coordinates - given, axis=1) for points, _ in tried]
    assert moves and any(np.count_nonzero(move > 1e6) == 1 for move in moves) == is_tried


def test_a_search_begins_with_the_initial_values_of_the_adjustment(planted, tmp_path, monkeypatch):
    """They are computed once; those of trials are others."""
    work, began, values = with_mistake(planted, tmp_path, "one_digit").fieldwork, [], fieldwork.values_by

    def computed(graphs, points, book, vertical, **options):
        same = np.array_equal(points.coordinates, work.points.coordinates, equal_nan=True)
        began.append(book is work.book and same)
        return values(graphs, points, book, vertical, **options)

    monkeypatch.setattr(fieldwork, "values_by", computed)
    work.initial_values()
    assert work.search().errors
    assert began.count(True) == 1


def test_where_all_else_contradicts_nothing_is_put_right(planted, tmp_path, tried):
    """A station counted anticlockwise leads most of a network astray: without another station it still is."""
    network = with_mistake(planted, tmp_path, "station_anticlockwise", seed=15)
    trials, rows = of_network(network), network.book.observations
    assert not trials.is_mostly_right
    sources = {point: np.flatnonzero(rows.from_points == point) for point in set(rows.from_points.tolist())}
    without = {point for point, source in sources.items() if not trials.may_be_among(source)}
    assert 3 <= len(without) < len(sources)
    assert group_cause(trials) is None
    moved = [set(rows.from_points[book.observations.values != rows.values].tolist()) for _, book in tried]
    assert not any(points <= without for points in moved)
    assert any(len(points) == 1 for points in moved)


def test_the_station_that_leads_a_network_astray_is_named(planted, tmp_path):
    trials = of_network(with_mistake(planted, tmp_path, "station_anticlockwise", seed=15))
    error, corrected = group_cause(trials)
    assert "counted anticlockwise" in error.text and not corrected.suspects.size
