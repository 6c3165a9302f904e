"""Explanations of whole blocks: which are tried, and which of those that fit are told."""

from types import SimpleNamespace

import numpy as np
import pytest

from obseq.diagnosis.policy import POLICY
from obseq.images.causes import axes
from obseq.images.causes.cameras import _words_of_focal_length
from obseq.images.causes.images import _where_of_camera
from obseq.images.causes.shared import SharedCause, Told, Trial
from obseq.images.control import ControlPoints
from obseq.images.diagnosing.trials import (
    Tries,
    due_for_missing,
    is_accepted,
    is_good,
    may_be_shared,
    squares,
)
from obseq.images.poses import Poses
from obseq.leastsquares.statistics.distributions import chi_square_limit

CENTRES = np.array([[0.0, 0, 0], [100, 0, 0], [0, 100, 0], [100, 100, 10]])
POSES = Poses.of(list("abcd"), CENTRES, np.tile(np.eye(3), (4, 1, 1)))


class Lens(SimpleNamespace):
    def project_with_jacobian(self, _):
        return None, np.eye(3)[None, :2]


def solution(left, redundancy=20, shift=0.0, moved=0.0, missing=0, converged=True, behind=0):
    """A solution that leaves a sum of squares, of four points in three images each."""
    given, found = (Lens(principal_point=np.array([500.0 + by, 400.0])) for by in (0.0, shift))
    measures = SimpleNamespace(
        point=np.repeat(np.arange(4), 3), point_names=tuple("PQRS"), joined=lambda other: measures
    )
    block = SimpleNamespace(
        cameras={"c": given},
        sets=[SimpleNamespace(measures=measures)],
        control=SimpleNamespace(names=("P",)),
        joined_points=(),
    )
    poses = Poses.of(POSES.images, np.add(CENTRES, [moved, 0.0, 0.0]), POSES.rotations)
    return SimpleNamespace(
        sigma0=(left / redundancy) ** 0.5,
        result=SimpleNamespace(redundancy=redundancy),
        converged=converged,
        is_behind=np.arange(4) < behind,
        cameras={"c": found},
        block=block,
        poses=poses,
        residuals=SimpleNamespace(point=np.zeros(12 - missing)),
    )


LIMIT = chi_square_limit(20, above=POLICY.false_alarm)


def cause(*found, rarity=6.0, words=None, images=(), **about):
    """A cause whose trials end in these solutions; each tells a letter."""
    made = []
    for letter, one in zip(words or "uvwxyz", found, strict=False):
        made.append(Trial.saying(f"trial {letter}", Told(letter and f"it is {letter}", images), one))
    return SharedCause("I1", "n", "a", "e", "r", rarity, lambda subject: iter(made), **about)


def told(*causes, before=None):
    """What explains a block, and what was tried."""
    tried = []
    tries = Tries(SimpleNamespace(given=POSES, solution=before), tried.append, {})
    tries.solved = lambda block: block
    return [fit.told.said[-1] for fit in tries.best(causes)], [text[-1] for text in tried]


def test_sums_of_squares_decide_whether_a_solution_is_accepted_or_good():
    assert squares(solution(50.0)) == pytest.approx(50.0)
    assert is_accepted(solution(LIMIT - 0.01)) and not is_accepted(solution(LIMIT + 0.01))
    assert not is_accepted(solution(10.0, converged=False)) and not is_accepted(solution(10.0, behind=3))
    assert is_accepted(solution(10.0, behind=2))
    assert is_good(solution(199.0)) and not is_good(solution(201.0))
    assert not is_good(solution(10.0, converged=False)) and not is_good(solution(10.0, behind=3))
    assert may_be_shared(11.0, 0) and not may_be_shared(9.0, 0)


def test_image_points_that_take_no_part_are_paid_for():
    assert due_for_missing(solution(10.0)) == 0.0
    each = chi_square_limit(2, above=POLICY.false_alarm / 12)
    assert due_for_missing(solution(10.0, missing=2)) == pytest.approx(2.0 * each)


def test_what_leaves_least_is_told_with_all_that_nothing_tells_from_it():
    near = 20.0 + 0.9 * POLICY.margin
    far = 20.0 + 1.1 * POLICY.margin * 1.0
    assert told(cause(solution(20.0), solution(near), solution(far)))[0] == ["u", "v"]
    assert told(cause(solution(20.0), rarity=6.0), cause(solution(20.5), rarity=2.0, words="v"))[0] == [
        "v",
        "u",
    ]
    assert told(cause())[0] == []
    assert told(cause(solution(20.0), words=[""]))[0] == []  # it fits, and tells nothing


def test_principal_points_and_poses_tell_explanations_that_leave_as_much():
    assert told(cause(solution(20.0, shift=1.0), solution(20.0, shift=7.9), solution(20.0, shift=8.1)))[
        0
    ] == ["u", "v"]
    extent = 0.2 * np.linalg.norm(np.ptp(CENTRES, axis=0))
    found = told(
        cause(solution(20.0), solution(20.0, moved=0.99 * extent), solution(20.0, moved=1.01 * extent))
    )
    assert found[0] == ["u", "v"]


def test_after_a_sure_cause_that_explains_all_nothing_else_is_tried():
    sure = cause(solution(20.0), is_sure=True)
    assert told(sure, cause(solution(1.0), words="v"))[1] == ["u"]
    assert told(cause(solution(20.0), images=("a",)), cause(solution(1.0), words="v"))[1] == ["u"]
    assert told(cause(solution(20.0)), cause(solution(1.0), words="v"))[1] == ["u", "v"]
    some = cause(solution(LIMIT + 1.0), is_sure=True)
    assert told(some, cause(solution(1.0), words="v"))[1] == ["u", "v"]


@pytest.mark.parametrize(
    ("before", "left", "fits"),
    [
        (None, 199.0, True),  # where there was no solution, what is good is one
        (None, 201.0, False),
        (10_000.0, 999.0, True),  # most of what was left is gone
        (10_000.0, 1001.0, False),
        (500.0, LIMIT - 0.1, True),
        (500.0, LIMIT + 11.0, False),
    ],
)
def test_an_explanation_takes_most_of_what_was_left(before, left, fits):
    given = None if before is None else solution(before)
    assert bool(told(cause(solution(left)), before=given)[0]) == fits


def test_a_mirror_image_explains_nothing_and_one_before_is_no_solution():
    assert told(cause(solution(10.0, behind=3)))[0] == []
    assert told(cause(solution(199.0)), before=solution(300.0, behind=3))[0] == ["u"]


def test_blocks_that_fit_are_asked_only_what_good_ones_may_have():
    good = solution(100.0)
    assert told(cause(solution(20.0)), before=good)[1] == []
    asked = cause(solution(20.0), solution(99.0), solution(101.0), is_of_good=lambda subject: True)
    assert told(asked, before=good)[1] == ["u", "v", "w"]
    assert told(asked, before=good)[0] == ["u"]
    assert told(cause(solution(99.0), is_of_good=lambda subject: True), before=good)[0] == ["u"]
    assert told(cause(solution(101.0), is_of_good=lambda subject: True), before=good)[0] == []
    accepted = solution(20.0)
    assert told(cause(solution(35.0), is_of_good=lambda subject: True), before=accepted)[0] == ["u"]


def test_what_a_solution_suggests_is_tried_in_its_place():
    further = [Trial.saying("trial z", Told("it is z"), solution(12.0))]
    first = Trial("trial u", solution(10.0), lambda found: Told("it is u"), then=lambda found: further)
    one = SharedCause("I1", "n", "a", "e", "r", 6.0, lambda subject: iter([first]))
    assert told(one) == (["z"], ["u", "z"])


@pytest.mark.parametrize(
    ("x", "y", "is_grid"),
    [
        (6.8e6, 6.5e5, True),
        (6.5e5, 6.8e6, False),
        (6.8e6, 1.1e6, False),
        (6.8e6, 0.9e5, False),
        (0.9e6, 6.5e5, False),
    ],
)
def test_northings_before_eastings_of_a_grid_look_like_that(x, y, is_grid):
    control = ControlPoints.of(list("PQR"), np.array([[x, y, 100.0]] * 3) + np.arange(9.0).reshape(3, 3))
    assert axes._are_northings_first(control) == is_grid


def test_coordinates_in_another_order_take_their_covariances_with_them():
    covariances = np.array(
        [np.arange(9.0).reshape(3, 3) + np.arange(9.0).reshape(3, 3).T + 20 * np.eye(3)] * 2
    )
    given = ControlPoints.of(["P", "Q"], [[1.0, 2, 3], [4, 5, 6]])
    control = axes.replace(given, covariances=covariances)
    changed = axes.with_exchanged_axes(control, (2, 1, 0))
    assert changed.coordinates.tolist() == [[3, 2, 1], [6, 5, 4]]
    assert changed.covariances[1].tolist() == covariances[1][::-1, ::-1].tolist()
    assert axes.with_exchanged_axes(control).coordinates.tolist() == [[2, 1, 3], [5, 4, 6]]


def test_principal_points_of_turned_images_are_turned_back_to_the_middle():
    # of 6000 x 4000, held upright: 4000 x 6000
    for point, turn in (([2010.0, 2980.0], axes._clockwise), ([2010.0, 2980.0], axes._anticlockwise)):
        camera = SimpleNamespace(width=6000, height=4000, principal_point=np.array(point))
        assert axes._off_middle(camera) > 0.1
        found = SimpleNamespace(width=6000, height=4000, principal_point=turn(camera))
        assert axes._off_middle(found) < 0.01
    assert axes._clockwise(camera).tolist() == [3020.0, 2010.0]
    assert axes._anticlockwise(camera).tolist() == [2980.0, 1990.0]
    assert axes._off_middle(SimpleNamespace(width=0, height=0, principal_point=np.array([9.0, 9.0]))) == 0.0


@pytest.mark.parametrize(
    ("cameras", "wanted"),
    [
        ([0, 0, 1, 1], [0, 1]),
        ([0, 0, 1, 2], [0]),
        ([0, 1, 2, 3], []),
        ([0, 0, 0, 0], []),
    ],
)
def test_images_of_a_camera_are_wrong_together_where_there_are_others(cameras, wanted):
    image = np.repeat(np.arange(4), 5)
    numbering = SimpleNamespace(camera=np.array(cameras), image=image, kept=np.arange(20) != 3)
    found = _where_of_camera(numbering)
    assert found.labels[:, 0].tolist() == wanted
    for k, camera in enumerate(wanted):
        rows = [row for row in range(20) if cameras[image[row]] == camera and row != 3]
        columns = found.columns[found.starts[k] : found.starts[k + 1]]
        assert sorted(columns.tolist()) == sorted([2 * row + axis for row in rows for axis in (0, 1)])


def test_a_focal_length_is_told_where_it_is_far_from_what_was_given():
    given = {"c": SimpleNamespace(focal=1000.0), "d": SimpleNamespace(focal=2000.0)}
    subject = SimpleNamespace(block=SimpleNamespace(cameras=given))
    for focal, is_told in ((1029.0, False), (1032.0, True), (971.0, False), (968.0, True)):
        found = SimpleNamespace(
            cameras={"c": SimpleNamespace(focal=focal), "d": SimpleNamespace(focal=2010.0)}
        )
        said = _words_of_focal_length(subject, found)
        assert bool(said) == is_told and ("camera c: 1000 px given" in said) == is_told
