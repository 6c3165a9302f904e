"""Rules by which causes of blocks are told, one by one: poses that were given otherwise, sigmas, points."""

from types import SimpleNamespace

import numpy as np
import pytest

from obseq.diagnosis.protocol import Change
from obseq.geometry import exponential
from obseq.images.causes import control_sigmas
from obseq.images.causes.comparison import angles_of, common, moved, turns
from obseq.images.causes.evidence import Evidence
from obseq.images.causes.pixels import slips_of_a_pixel
from obseq.images.causes.points import slips_of_a_coordinate, slips_of_a_point
from obseq.images.causes.pose_rewritings import compared, exchanges, rewritings_of, without_rotations
from obseq.images.diagnosing.diagnosis import _is_cheaper, _may_be_mirrored
from obseq.images.parts import PoseObservations
from obseq.images.poses import Poses
from obseq.records.diagnosis import AccusedRecord, DiagnosisRecord

NAMES = [f"i{k}" for k in range(6)]
CENTRES = np.array([[0, 0, 100], [60, 5, 104], [120, -4, 98], [3, 80, 101], [62, 84, 105], [118, 79, 97.0]])
VECTORS = np.random.default_rng(4).uniform([1.7, -0.9, -0.9], [3.5, 0.9, 0.9], (6, 3))
FOUND = Poses.of(NAMES, CENTRES, np.array([exponential(v) for v in VECTORS]))


def given(centres=CENTRES, rotations=FOUND.rotations):
    return Poses.of(NAMES, centres, rotations)


def noisy(poses, metres=2.0, radians=0.05, seed=1):
    rng = np.random.default_rng(seed)
    small = np.array([exponential(v) for v in rng.normal(0.0, radians, (6, 3))])
    return given(poses.centres + rng.normal(0.0, metres, (6, 3)), poses.rotations @ small)


def said(poses, *, centres=True, rotations=True):
    sigmas = np.full((6, 3), 1.0 if centres else np.inf)
    observed = PoseObservations(poses, sigmas, 0.1 if rotations else None)
    return list(rewritings_of(FOUND, observed))


def test_nothing_is_wrong_with_poses_that_are_where_they_are_found_nearly():
    assert said(noisy(FOUND)) == [] and compared(FOUND, noisy(FOUND), True).said == ""
    assert compared(FOUND, noisy(FOUND), False).said == "the given poses are too rough to start from"


@pytest.mark.parametrize(
    ("vector", "words"),
    [
        ([0, 0, 90], "by 90 degrees about the viewing axis"),
        ([0, 0, -90], "by -90 degrees about the viewing axis"),
        ([0, 0, 180], "by 180 degrees about the viewing axis"),
        ([180, 0, 0], "by 180 degrees about x"),
        ([0, 180, 0], "by 180 degrees about y"),
    ],
)
def test_rotations_that_share_a_turn_are_turned_back(vector, words):
    turn = exponential(np.radians(np.array(vector, float)))
    wrong = given(rotations=noisy(FOUND).rotations @ turn.T)
    (one,) = said(wrong)
    assert words in one.told.said
    assert turns(one.change(wrong), FOUND).max() < 0.3 and one.scale == 1.0
    assert said(wrong, rotations=False) == []
    assert words in compared(FOUND, wrong, True).said
    one_right = wrong.rotations.copy()
    one_right[2] = FOUND.rotations[2]
    assert said(given(rotations=one_right)) == []


def test_rotations_from_the_world_to_the_camera_are_turned_round():
    wrong = given(rotations=np.swapaxes(noisy(FOUND).rotations, 1, 2))
    (one,) = said(wrong)
    assert "from the world to the camera, not back" in one.told.said
    assert turns(one.change(wrong), FOUND).max() < 0.3


@pytest.mark.parametrize(
    ("order", "words"),
    [
        ([1, 0, 2], "x and y of the given"),
        ([0, 2, 1], "y and z of the given"),
        ([2, 1, 0], "x and z of the given"),
    ],
)
def test_centres_in_another_order_are_put_right(order, words):
    wrong = given(noisy(FOUND).centres[:, order])
    found = [one for one in said(wrong) if words in one.told.said]
    assert len(found) == 1 and np.abs(found[0].change(wrong).centres - CENTRES).max() < 10.0
    assert not any("exchanged (" in one.told.said for one in said(wrong, centres=False))


def test_heights_of_centres_that_count_downwards_are_put_right():
    wrong = given(noisy(FOUND).centres * [1, 1, -1])
    found = [one for one in said(wrong) if "count downwards" in one.told.said]
    assert len(found) == 1 and np.abs(found[0].change(wrong).centres - CENTRES).max() < 10.0


@pytest.mark.parametrize(("factor", "unit"), [(1000.0, "millimetres"), (100.0, "centimetres")])
def test_centres_in_another_unit_than_the_control_points_are_told_with_it(factor, unit):
    wrong = given(CENTRES / factor)
    (one,) = [one for one in said(wrong) if one.scale != 1.0]
    assert one.scale == factor and unit in one.told.said and f"{factor:.6g} times as large" in one.told.said
    np.testing.assert_allclose(one.change(wrong).centres, CENTRES)
    assert not [one for one in said(given(CENTRES / (1.2 * factor))) if one.scale != 1.0]


def test_images_at_the_places_of_each_other_are_exchanged_and_put_back():
    order = [0, 4, 2, 3, 1, 5]
    wrong = given(noisy(FOUND, 1.0).centres[order], FOUND.rotations[order])
    assert exchanges(FOUND, wrong) == {"i1": "i4", "i4": "i1"}
    one = said(wrong)[0]
    assert one.told.images == ("i1", "i4")
    assert (
        "images i1 and i4 look exchanged: i1 is where i4 was given, i4 is where i1 was given" in one.told.said
    )
    put_right = one.change(wrong)
    assert np.abs(put_right.centres - CENTRES).max() < 5.0 and turns(put_right, FOUND).max() < 1e-6
    assert exchanges(FOUND, given(CENTRES[order] + 25.0 * np.eye(3)[0])) == {}  # too rough to tell
    two_at_one = CENTRES.copy()
    two_at_one[1] = CENTRES[4]
    assert exchanges(FOUND, given(two_at_one)) == {}


def test_many_exchanged_images_are_counted_and_the_first_listed():
    wrong = given(CENTRES[::-1])
    told = said(wrong)[0].told
    assert "i0 and i1 and i2 and i3, ... (6 in all) look exchanged" in told.said and len(told.images) == 6
    assert "i3 is where i2 was given" in told.said and "i4 is where" not in told.said


def test_single_images_far_from_where_they_were_given_are_listed():
    wrong = CENTRES.copy()
    wrong[3] += [0.0, 300.0, 0.0]
    rotations = FOUND.rotations.copy()
    rotations[5] = rotations[5] @ exponential(np.array([0.0, 0.6, 0.0]))
    told = compared(FOUND, given(wrong, rotations), True).said
    assert told == (
        "given poses are not those of the measures: i3 (by 300 and 0 degrees), i5 (by 0 and 34 degrees)"
    )
    most = CENTRES + np.outer([1, 1, 1, 1, 0, 0], [0.0, 300.0, 0.0])
    assert compared(FOUND, given(most), True).said == ""  # a system of their own
    assert "i0 (by 300" in compared(FOUND, given(most), False).said


def test_an_image_alone_is_compared_by_its_rotation():
    alone = FOUND.select(["i2"])
    turned = Poses.of(["i2"], alone.centres + 1e6, alone.rotations @ exponential(np.array([0.0, 0.6, 0.0])))
    assert "i2 (by" in compared(alone, turned, False).said
    near = Poses.of(["i2"], alone.centres + 1e6, alone.rotations)
    assert "too rough" in compared(alone, near, False).said


def test_centres_of_antennas_have_no_rotations_to_be_wrong():
    observed = without_rotations(NAMES, CENTRES[:, [1, 0, 2]], np.ones((6, 3)))
    told = [one.told.said for one in rewritings_of(FOUND, observed)]
    assert any("x and y of the given centres" in words for words in told)
    assert not any("rotations" in words for words in told)


def test_poses_are_compared_by_name_and_by_the_extent_of_all():
    other = Poses.of(["x", "i4", "i1"], CENTRES[[0, 4, 1]] + [10.0, 0.0, 0.0], FOUND.rotations[[0, 4, 1]])
    first, second = common(FOUND, other)
    assert first.images == second.images == ("i1", "i4")
    extent = np.linalg.norm(np.ptp(CENTRES, axis=0))
    assert moved(FOUND, other) == pytest.approx(10.0 / extent)
    angle = exponential(np.array([0.0, 0.25, 0.0]))
    assert moved(FOUND, given(rotations=FOUND.rotations @ angle)) == pytest.approx(0.25)
    assert moved(FOUND, Poses.of(["x"], CENTRES[:1], FOUND.rotations[:1])) == 0.0
    assert angles_of(np.array([np.eye(3), angle, np.diag([1.0, -1.0, -1.0])])) == pytest.approx(
        [0, 0.25, np.pi]
    )


def control_solution(factor, count=4, sigma=0.01, off=0.0):
    """A block whose control points lie as their sigmas say, times a factor; one is farther off."""
    rng = np.random.default_rng(2)
    residuals = factor * sigma * rng.choice([-1.0, 1.0], (count, 3))
    residuals[0, 0] += off * sigma
    sigmas = np.full((count, 3), sigma)
    sigmas[-1, 2] = np.inf
    control = SimpleNamespace(sigmas=sigmas, coordinates=100.0 * rng.normal(size=(count, 3)))
    chosen = SimpleNamespace(sigmas=sigmas)
    control.select = lambda names: chosen
    return SimpleNamespace(block=SimpleNamespace(control=control), control_residuals=lambda: ([], residuals))


def test_residuals_of_control_points_are_compared_with_their_sigmas():
    assert control_sigmas.ratio(control_solution(0.5)) == pytest.approx(0.5 * np.sqrt(11 / 4))
    assert control_sigmas.ratio(control_solution(1.0, count=2)) is None  # the block takes seven
    root = np.sqrt(4 / 11)  # of eleven squares what is left of four
    for factor, agree in ((1.0, True), (0.57, True), (0.54, False), (1.78, True), (1.82, False)):
        assert control_sigmas._agree(control_solution(factor * root)) == agree, factor
    assert not control_sigmas._agree(control_solution(0.5, off=4.0))
    assert control_sigmas._are_large(control_solution(0.17 * root))
    assert not control_sigmas._are_large(control_solution(0.19 * root))


def test_sigmas_are_fine_beside_the_extent_of_the_points():
    solution = control_solution(1.0)
    extent = np.linalg.norm(np.ptp(solution.block.control.coordinates, axis=0))
    control = ControlStub(solution.block.control.coordinates, None)
    subject = SimpleNamespace(block=SimpleNamespace(control=control), solution=None)
    for factor, fine in ((0.9, True), (1.1, False)):
        control.sigmas = np.full((4, 3), factor * 1e-6 * extent)
        control.sigmas[0] = 0.0, np.inf, 1.0
        assert control_sigmas._are_fine(subject) == control_sigmas._are_odd(subject) == fine
    control.sigmas = np.zeros((4, 3))
    assert not control_sigmas._are_fine(subject)


class ControlStub:
    def __init__(self, coordinates, sigmas):
        self.coordinates, self.sigmas = coordinates, sigmas
        self.names = tuple("ABCDEFGH"[: len(coordinates)])

    def __len__(self):
        return len(self.coordinates)


def start_of(coordinates, sigma=0.01):
    n = len(coordinates)
    return SimpleNamespace(
        coordinates=np.array(coordinates, float),
        covariances=np.tile(sigma**2 * np.eye(3), (n, 1, 1)),
        is_control=np.ones(n, bool),
        points=tuple("ABCDEFGH"[:n]),
    )


def evidence_of(coordinates, places):
    axes = np.array([[p, k] for p in range(len(places)) for k in range(3)])
    numbering = SimpleNamespace(equations=SimpleNamespace(start=start_of(coordinates)), coordinates=axes)
    return SimpleNamespace(numbering=numbering, coordinates=np.array(places, float))


TRUE = [[120.0, 45.0, 10.0], [40.0, 80.0, 12.0], [75.0, 20.0, 11.0]]


def slips(finder, coordinates, label, size, sigma=0.005):
    change = Change(0, np.atleast_1d(size).astype(float), np.full(np.size(size), sigma))
    return [(one.code, one.text) for one in finder(evidence_of(coordinates, TRUE), label, change)]


def test_a_control_coordinate_has_a_wrong_sign_or_digit():
    wrong = [[-120.0, 45.0, 10.0], *TRUE[1:]]
    for sigma in (0.005, 0.3):  # a sign is told where the others determine the place poorly too
        ((code, text),) = slips(slips_of_a_coordinate, wrong, (0, 0), -240.0, sigma)
        assert code == "W105" and "sign" in text
    assert slips(slips_of_a_coordinate, wrong, (0, 0), -239.9) == []
    assert slips(slips_of_a_coordinate, wrong, (0, 0), -238.0, 0.3) == []
    ((code, _),) = slips(slips_of_a_coordinate, [TRUE[0], [40.0, 60.0, 12.0]], (1, 1), -20.0)
    assert code == "W109"


@pytest.mark.parametrize(
    ("wrong", "wanted"),
    [
        ([TRUE[0], [80.0, 40.0, 12.0], TRUE[2]], [("W123", "x and y are exchanged")]),
        ([TRUE[0], TRUE[2], TRUE[1]], [("W133", "exchanged with C")]),
        ([TRUE[0], [75.0, 20.0, 14.0], TRUE[1]], [("W133", "it is where C should be")]),
        ([TRUE[0], [75.0, 20.0, 14.0], TRUE[2]], []),
        ([TRUE[0], [80.0, 40.0, 12.2], TRUE[2]], []),
    ],
)
def test_a_control_point_has_its_coordinates_exchanged_or_is_exchanged_with_another(wrong, wanted):
    assert slips(slips_of_a_point, wrong, (1,), np.subtract(wrong[1], TRUE[1])) == wanted


class Points(Evidence):
    """Image points of one image: where they are, and where they were measured."""

    def pixels(self, image, points=None):
        return self.coordinates

    def written(self, measures):
        return self.cameras[measures], np.full((len(measures), 2), 0.5)


def pixel_slips(places, written, wrong):
    n = len(places)
    numbering = SimpleNamespace(
        image=np.zeros(n, int),
        point=np.arange(n),
        kept=np.ones(n, bool),
        equations=SimpleNamespace(start=SimpleNamespace(points="ABCDEFGHIJ")),
    )
    evidence = Points(numbering, None, np.array(written, float), np.array(places, float))
    change = Change(0, np.subtract(written[wrong], places[wrong]), np.full(2, 0.3))
    return [(one.code, one.text, one.is_strong) for one in slips_of_a_pixel(evidence, (wrong,), change)]


SEEN = [[100.0, 200.0], [3000.0, 2100.0], [1500.0, 900.0], [2200.0, 300.0]]


def test_an_image_point_is_exchanged_with_another_or_is_where_another_is():
    exchanged = [SEEN[0], SEEN[2], SEEN[1], SEEN[3]]
    assert pixel_slips(SEEN, exchanged, 1) == [("W113", "exchanged with point C", True)]
    other = [SEEN[0], np.add(SEEN[3], [1.0, -0.5]), SEEN[2], SEEN[3]]
    assert pixel_slips(SEEN, other, 1) == [("W112", "it is where point D is", False)]
    near = [SEEN[0], np.add(SEEN[3], [5.0, 0.0]), SEEN[2], SEEN[3]]
    assert pixel_slips(SEEN, near, 1) == []
    hidden = [SEEN[0], SEEN[1], SEEN[2], [np.nan, np.nan]]
    assert pixel_slips(hidden, other, 1) == []


def test_a_wrong_digit_of_an_image_point_is_told_with_its_axis():
    wrong = [SEEN[0], [3000.0, 2700.0], SEEN[2], SEEN[3]]
    ((code, text, _),) = pixel_slips(SEEN, wrong, 1)
    assert code == "W109" and text.endswith(" in y")
    both = [SEEN[0], [5000.0, 2700.0], SEEN[2], SEEN[3]]
    assert pixel_slips(SEEN, both, 1) == []


def accused(*points, limit=14.0):
    return AccusedRecord("I110", "x", points=points, text="", limit=limit)


def test_points_off_a_plane_tell_a_mirror_image():
    flat = np.array([[0, 0, 0], [50, 0, 0.01], [0, 60, -0.01], [50, 60, 0.02], [20, 30, 8.0]])
    control = ControlStub(flat, np.full((5, 3), 0.01))
    block = SimpleNamespace(control=control)
    points = [SimpleNamespace(name=name) for name in "ABCDE"]

    def found(*which):
        return SimpleNamespace(accused=[SimpleNamespace(points=[points[k]] if k >= 0 else []) for k in which])

    assert _may_be_mirrored(block, found(4)) and not _may_be_mirrored(block, found(0))
    assert not _may_be_mirrored(block, found()) and not _may_be_mirrored(block, found(4, -1))
    assert _may_be_mirrored(block, found(0, 1, 2))  # two are left
    control.sigmas = np.full((5, 3), 0.001)
    assert not _may_be_mirrored(block, found(4))
    control.sigmas = np.full((5, 3), 0.01)
    control.sigmas[1:3, 2] = np.inf
    assert _may_be_mirrored(block, found(4))


def test_a_mistake_that_all_share_is_told_where_it_costs_less_than_single_errors():
    def fit(left):
        return SimpleNamespace(left=left, cause=SimpleNamespace(rarity=4.0))

    single = DiagnosisRecord("explained", 50.0, 20, (accused(limit=14.0), accused(limit=10.0)))
    assert _is_cheaper(fit(69.0), single) and not _is_cheaper(fit(71.0), single)
    assert _is_cheaper(fit(1e6), DiagnosisRecord("unexplained", 50.0, 20))
