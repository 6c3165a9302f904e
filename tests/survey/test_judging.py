"""Rules by which errors of networks are judged and told, one by one, where their outcome is plain."""

from types import SimpleNamespace

import numpy as np
import pytest

from obseq.diagnosis.policy import POLICY
from obseq.records.diagnosis import AccusedRecord, DiagnosisRecord, KnownRecord, PlaceRecord, SuspectRecord
from obseq.report.tables.units import METRIC
from obseq.survey import Quality
from obseq.survey.causes import names, other_system
from obseq.survey.causes.cause import Scope, grouped
from obseq.survey.diagnosing.rewritings import part_that_shows
from obseq.survey.diagnosing.snooping import CLEAN, INSEPARABLE, SHARED, UNEXPLAINED, Snooped, _end, snooped
from obseq.survey.diagnosing.words import told


@pytest.mark.parametrize("seed", range(4))
def test_pairs_within_a_radius_are_those_of_trying_all(seed):
    rng = np.random.default_rng(seed)
    places = rng.uniform(0.0, 10.0, (40, 3)) * [1.0, 3.0 * (seed % 2), 1.0]
    places[7] = places[30]
    distances = np.linalg.norm(places[:, None] - places, axis=2)
    wanted = [(i, j) for i in range(40) for j in range(i + 1, 40) if distances[i, j] <= 2.0]
    assert [tuple(pair) for pair in names._pairs_within(places, 2.0).tolist()] == wanted
    assert names._pairs_within(places, 0.0).tolist() == [[7, 30]]


@pytest.mark.parametrize("count", [0, 1])
def test_fewer_than_two_points_are_no_pair(count):
    assert names._pairs_within(np.zeros((count, 3)), 1.0).shape == (0, 2)


GIVEN = np.array(
    [[0.0, 0.0, 0.0], [900.0, 100.0, 10.0], [800.0, 950.0, 40.0], [-50.0, 700.0, 5.0], [400.0, 500.0, 90.0]]
)


def turned(degrees, scale):
    angle = np.radians(degrees)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    return 5000.0 + scale * GIVEN @ turn.T


@pytest.mark.parametrize(
    ("degrees", "scale"), [(2.5, 1.0), (-2.5, 1.0004), (30.0, 0.6), (0.0, 1.9), (170.0, 0.9996)]
)
def test_known_points_of_another_system_are_told_with_their_turn_and_scale(degrees, scale):
    said = other_system._change(GIVEN, turned(degrees, scale))
    assert said is not None
    assert f"turned by {abs(degrees):.4g} degrees and {1e6 * (scale - 1.0):+.0f} ppm larger" in said


def test_points_that_lie_otherwise_are_of_no_other_system():
    assert other_system._change(GIVEN, turned(10.0, 0.49)) is None
    assert other_system._change(GIVEN, turned(10.0, 2.01)) is None
    few = turned(2.5, 1.0)
    few[0] = np.nan
    assert other_system._change(GIVEN, few) is not None
    few[1] = np.nan
    assert other_system._change(GIVEN, few) is None  # of three points anything can be said
    moved = turned(2.5, 1.0)
    moved[4, 0] += 300.0
    assert other_system._change(GIVEN, moved) is None


def test_groups_are_of_one_label_and_large_enough():
    scope = Scope("any", None, None, "")
    labels, mask = np.array([3, 1, 3, -1, 1, 3, 2, 1, -1]), np.ones(9, bool)
    mask[7] = False
    found = grouped(scope, labels, mask, 2)
    assert found.labels.tolist() == [1, 3] and found.starts.tolist() == [0, 2, 5]
    assert found.rows.tolist() == [1, 4, 0, 2, 5]
    assert grouped(scope, labels, mask, 3).labels.tolist() == [3]
    assert grouped(scope, labels, np.zeros(9, bool), 1).starts.tolist() == [0]


def test_sizes_are_told_in_the_unit_in_which_they_are_small():
    assert told(METRIC, "", [25.4e-6]) == "25.4 ppm"
    assert told(METRIC, "m", [0.0999]).endswith("99.90 mm") and told(METRIC, "m", [-0.0999]).startswith(
        "-99.9"
    )
    assert told(METRIC, "m", [0.1]).endswith(" m") and "mm" not in told(METRIC, "m", [-0.1])
    assert told(METRIC, "m", [0.2, -0.05], ["in x", "in y"]) == (
        f"{told(METRIC, 'm', [0.2])} in x, {told(METRIC, 'm', [-0.05])} in y"
    )
    small, large = (told(METRIC, "rad", [size]) for size in (0.00159, 0.00161))
    assert small.split()[-1] != large.split()[-1]


def line_of(points):
    """A traverse along points, each seen by its neighbours; those that are called K are known."""
    n = len(points)
    rows = SimpleNamespace(
        active=np.ones(2 * (n - 1), bool),
        from_points=np.repeat(np.arange(n - 1), 2),
        to_points=np.repeat(np.arange(1, n), 2),
    )
    free = np.ones((n, 3), bool)
    free[[k for k, name in enumerate(points) if name == "K"]] = False

    def counts(chosen, size):
        ends = np.append(rows.from_points[chosen], rows.to_points[chosen])
        return np.bincount(ends, minlength=size)

    return SimpleNamespace(book=SimpleNamespace(observations=rows, counts=counts), points=Points(free))


class Points:
    def __init__(self, is_free):
        self.is_free = is_free

    def __len__(self):
        return len(self.is_free)


def test_a_part_of_a_network_is_about_the_worst_point_with_the_way_to_known_ones():
    notes = line_of("K.................K")
    off = np.zeros(19, int)
    off[9] = 4
    assert part_that_shows(notes, off, 36) is None  # it has no more observations
    kept = part_that_shows(notes, off, 8)
    assert kept[[0, 18]].all() and kept.all()  # the way to both ends is all there is
    notes.points.is_free[[0, 18]] = True
    notes.points.is_free[7] = False
    kept = np.flatnonzero(part_that_shows(notes, off, 8)).tolist()
    assert kept == list(range(kept[0], kept[-1] + 1)) and len(kept) == 6 and {7, 9, 11} <= set(kept)
    far = part_that_shows(line_of("K" + 17 * "." + "K"), 3 * (np.arange(19) == 16), 4)
    assert far.all()  # the way to the other end too
    notes.book.observations.active[10:] = False
    assert part_that_shows(notes, off, 10) is None


def accused(**about):
    about = {
        "observations": (PlaceRecord("a.obs", 1, 4),),
        "points": (),
        "text": "wrong",
        "size": (0.03,),
        "sigma": (0.002,),
        "unit": "m",
        "test": 60.0,
        "limit": 14.0,
        "others": (),
        "slips": (),
    } | about
    return AccusedRecord("S100", "Dist A -> B", **about)


def record(*found, status="explained", left=10.0, redundancy=12):
    return DiagnosisRecord(status, left, redundancy, found)


def left_out(*found, quality="w", factor=1.0, **about):
    asked = []
    result = snooped(
        lambda policy: asked.append(policy) or record(*found, **about),
        Quality(snooping=quality),
        lambda: factor,
    )
    return result, asked[0]


def test_observations_of_an_error_are_left_out_and_nothing_that_is_given_or_shared():
    point = (KnownRecord("P", "x"),)
    for kept in (accused(points=point), accused(observations=()), accused(test=0.0)):
        result, _ = left_out(kept, accused(size=(0.5,)))
        assert result.kept == (kept,) and len(result.gone) == 1
        assert np.flatnonzero(result.rows(9)).tolist() == [4]


def test_what_something_else_explains_as_well_stays_unless_that_is_of_the_same_observations():
    same = SuspectRecord("S2", "it", (PlaceRecord("a.obs", 1, 4),), ())
    other = SuspectRecord("S2", "it", (PlaceRecord("a.obs", 2, 5),), ())
    point = SuspectRecord("S2", "it", (), (KnownRecord("P", "x"),))
    assert left_out(accused(others=(same,)))[0].gone
    assert not left_out(accused(others=(other,)))[0].gone
    assert not left_out(accused(others=(same, point)))[0].gone


def test_the_end_of_snooping_is_told():
    assert _end(Snooped(record(), POLICY)) == CLEAN
    assert _end(Snooped(record(status="accepted"), POLICY)) == CLEAN
    assert _end(Snooped(record(status="unexplained"), POLICY)) == UNEXPLAINED
    point = accused(points=(KnownRecord("P", "x"),))
    assert _end(Snooped(record(point), POLICY)) == SHARED
    other = SuspectRecord("S2", "it", (PlaceRecord("a.obs", 2, 5),), ())
    assert _end(Snooped(record(point, accused(others=(other,))), POLICY)) == INSEPARABLE


def test_tau_takes_the_variance_factor_of_what_remains_and_trusts_only_what_that_lets_stand():
    result, policy = left_out(accused(), quality="tau", factor=4.0)
    assert policy.variance == 4.0 and len(result.gone) == 1
    assert left_out(accused(), quality="w", factor=4.0)[1].variance == 1.0
    assert left_out(accused(), quality="tau", factor=0.0)[1].variance == 1.0
    for sure, left, redundancy in ((True, 30.0, 30), (False, 60.0, 3), (False, 3000.0, 30), (True, 3.0, 8)):
        result, _ = left_out(accused(), quality="tau", left=left, redundancy=redundancy)
        assert bool(result.gone) == sure, (left, redundancy)
        assert result.diagnosis.accused == ((accused(),) if sure else ())
    asked = left_out(quality="w")[1]
    assert asked.false_alarm == Quality(snooping="w").snooping_level
