import itertools
import math

import numpy as np
import pytest
from sketch import GON, A, B, C, P, Q, Sketch

from obseq.errors import InputError
from obseq.survey import Orientation


def test_polar_point_from_a_plumb_station_gives_g0(tmp_path):
    solution = Sketch(tmp_path, A=A, B=B, P=P).hz("A", "B", g0=2.2).full("A", "P", g0=2.2).solve("A", "B")
    solution.assert_true("azimuth and distance")
    assert solution.values.g0[0] == pytest.approx(2.2, abs=1e-9)
    # R0 is instrument -> frame: the y axis of the instrument (its zero) points to azimuth G0
    np.testing.assert_allclose(solution.values.rotations[0] @ [0, 1, 0], [math.sin(2.2), math.cos(2.2), 0])


def test_distance_measured_from_the_target_counts(tmp_path):
    sketch = Sketch(tmp_path, A=A, B=B, P=P).hz("A", "B", "P", g0=1.0).zen("A", "P").dist("P", "A")
    sketch.solve("A", "B").assert_true("azimuth and distance")


def test_zenith_angle_of_another_station_set_on_the_same_point_counts(tmp_path):
    sketch = (
        Sketch(tmp_path, A=A, B=B, P=P).hz("A", "B", "P", g0=1.0).write("#NEW").zen("A", "P").dist("A", "P")
    )
    solution = sketch.solve("A", "B")
    solution.assert_true("azimuth and distance")
    assert list(solution.values.orientations) == [Orientation.VERT, Orientation.FIX]


def test_reciprocal_zenith_angle_gives_the_height(tmp_path):
    sketch = Sketch(tmp_path, A=A, B=B, P=P).hz("A", "B", "P", g0=1.0).zen("P", "A").dist("A", "P")
    sketch.solve("A", "B").assert_true("azimuth and distance")


def test_fix_station_needs_no_target(tmp_path):
    sketch = Sketch(tmp_path, A=A, P=P).write("#FIX").full("A", "P")
    solution = sketch.solve("A")
    solution.assert_true("azimuth and distance")
    assert solution.values.g0[0] == 0.0


def test_fix_station_in_a_frame_without_vertical(tmp_path):
    Sketch(tmp_path, A=A, P=P).write("#FIX").dxyz("A", "P").solve("A", vertical=None).assert_true()


def test_fix_station_on_the_unknown_point(tmp_path):
    Sketch(tmp_path, A=A, P=P).write("#FIX").full("P", "A").solve("A").assert_true("azimuth and distance")


def test_intersection_of_two_directions(tmp_path):
    sketch = (
        Sketch(tmp_path, A=A, B=B, P=P).hz("A", "B", "P", g0=1.0).hz("B", "A", "P", g0=-2.0).zen("A", "P")
    )
    sketch.solve("A", "B").assert_true("intersection")


def test_intersection_with_a_levelled_height(tmp_path):
    sketch = Sketch(tmp_path, A=A, B=B, P=P, Q=Q).hz("A", "B", "P").hz("B", "A", "P", "Q").hz("A", "Q")
    sketch.dh("B", "Q").dh("P", "Q").solve("A", "B").assert_true("intersection")


def test_intersection_in_the_vertical_plane_of_the_stations(tmp_path):
    sketch = Sketch(tmp_path, A=(0, 0, 0), B=(100, 0, 0), C=C, P=(150.0, 0.0, 60.0))
    for station in "AB":
        sketch.hz(station, "C", "P", g0=0.5).zen(station, "P")
    sketch.solve("A", "B", "C").assert_true("intersection in space")


def test_resection_from_three_directions(tmp_path):
    sketch = Sketch(tmp_path, A=A, B=B, C=C, P=P).hz("P", "A", "B", "C", g0=0.7).zen("P", "C")
    solution = sketch.solve("A", "B", "C")
    solution.assert_true("resection")
    assert solution.values.g0[0] == pytest.approx(0.7, abs=1e-9)


def test_resection_on_the_circle_of_the_targets_is_refused(tmp_path):
    circle = {
        n: (50 * math.sin(a), 50 * math.cos(a), 10.0) for n, a in zip("ABCP", (0, 1, 2.5, 4), strict=True)
    }
    solution = Sketch(tmp_path, **circle).hz("P", "A", "B", "C").zen("P", "A").solve("A", "B", "C")
    assert "too weak" in solution.reason("P")
    assert "circle" in solution.reason("P")


def test_free_station_on_two_vectors(tmp_path):
    sketch = Sketch(tmp_path, A=A, B=B, P=P, Q=Q).full("P", "A", "B", "Q", g0=-1.1)
    sketch.solve("A", "B").assert_true("free station", "azimuth and distance")


def test_trilateration_with_a_fourth_distance(tmp_path):
    truth = {"A": A, "B": B, "C": C, "P": P, "Q": Q}
    Sketch(tmp_path, **truth).dist("P", "A", "B", "C", "Q").solve("A", "B", "C", "Q").assert_true(
        "trilateration"
    )


def test_trilateration_alone_is_ambiguous_and_a_hint_decides(tmp_path):
    sketch = Sketch(tmp_path, A=A, B=B, C=C, P=P).dist("P", "A", "B", "C")
    reason = sketch.solve("A", "B", "C").reason("P")
    assert "several positions" in reason
    assert "(55.000, 35.000, 20.000)" in reason
    near = {"P": np.array([50.0, 30.0, 22.0])}
    sketch.solve("A", "B", "C", hints=near, recompute=True).assert_true("trilateration")


def test_free_point_keeps_the_coordinates_of_the_file(tmp_path):
    sketch = Sketch(tmp_path, A=A, B=B, C=C, P=P).dist("P", "A", "B", "C")
    solution = sketch.solve("A", "B", "C", hints={"P": np.array([50.0, 30.0, 22.0])})
    assert list(solution.values.coordinates[3]) == [50.0, 30.0, 22.0]
    assert solution.method("P") == "given"


def test_steps_name_the_observations_of_each_point_and_station(tmp_path):
    sketch = Sketch(tmp_path, A=A, B=B, P=P).full("A", "B", "P", g0=0.7)
    values = sketch.solve("A", "B").values
    # Hz, zenith angle and distance of each target, in the order of the sketch: to B are rows 0, 2, 4
    assert values.point_steps[2] == ("azimuth and distance", (1, 3, 5))
    assert values.point_steps[:2] == (("given", ()), ("given", ()))
    assert [step.method for step in values.station_steps] == ["azimuth of a known point"]
    assert values.station_steps[0].observations == (0,)


def test_two_distances_and_heights_with_a_deciding_direction(tmp_path):
    sketch = Sketch(tmp_path, A=A, B=B, P=P).dist("P", "A", "B").dh("A", "P")
    assert "several positions" in sketch.solve("A", "B").reason("P")
    sketch.hz("A", "B", "P", g0=1.0).solve("A", "B").assert_true()


def test_direction_and_distance_from_two_points(tmp_path):
    # the distance from B cuts the direction from A twice; the second cut is behind A
    sketch = Sketch(tmp_path, A=A, B=B, C=C, P=(150.0, 120.0, 10.0)).hz("A", "B", "P").zen("A", "P")
    sketch.dist("B", "P").dist("P", "C").solve("A", "B", "C").assert_true("direction and distance")


def test_angle_and_distance(tmp_path):
    sketch = Sketch(tmp_path, A=A, B=B, P=P, C=C).hz("P", "A", "B", g0=0.4).dist("P", "A").zen("P", "A")
    sketch.dist("P", "C").solve("A", "B", "C").assert_true()


def test_direction_to_and_angle_at_the_point(tmp_path):
    sketch = (
        Sketch(tmp_path, A=A, B=B, C=C, P=P).hz("A", "B", "P", g0=1.0).hz("P", "B", "C", g0=0.3).zen("A", "P")
    )
    sketch.zen("B", "P").solve("A", "B", "C").assert_true("direction and angle")


def test_sight_both_ways_orients_the_instrument_on_the_new_point(tmp_path):
    sketch = Sketch(tmp_path, A=A, B=B, P=P).hz("A", "B", "P", g0=1.0).hz("P", "A", "B", g0=2.0).zen("P", "B")
    sketch.solve("A", "B").assert_true("intersection")


def test_levelled_heights_go_through_points_without_horizontal_position(tmp_path):
    sketch = (
        Sketch(tmp_path, A=A, B=B, P=P, Q=Q).dh("A", "Q").dh("Q", "P").hz("A", "B", "P").hz("B", "A", "P")
    )
    solution = sketch.solve("A", "B")
    assert "nothing gives its horizontal position" in solution.reason("Q")
    np.testing.assert_allclose(solution.values.coordinates[2 + (solution.names[2] != "P")], P, atol=1e-6)


def test_horizontal_position_first_height_later(tmp_path):
    # P has no height of its own until Q, which is resected on it, is levelled and sights it
    sketch = Sketch(tmp_path, A=A, B=B, P=P, Q=Q).hz("A", "B", "P").hz("B", "A", "P")
    sketch.hz("Q", "A", "B", "P", g0=0.3).dh("A", "Q").zen("Q", "P")
    solution = sketch.solve("A", "B")
    solution.assert_true()


def test_horizontal_position_without_height_is_told(tmp_path):
    reason = Sketch(tmp_path, A=A, B=B, P=P).hz("A", "B", "P").hz("B", "A", "P").solve("A", "B").reason("P")
    assert "horizontal position is found, not its height" in reason


ROTATION = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])


def test_free_rotation_from_three_vectors_places_the_station(tmp_path):
    sketch = Sketch(tmp_path, A=A, B=B, C=C, P=P, Q=Q).write("#BASC")
    solution = sketch.dxyz("P", "A", "B", "C", "Q", rotation=ROTATION).solve("A", "B", "C")
    solution.assert_true("isometry on three or more points", "azimuth and distance")
    np.testing.assert_allclose(solution.values.rotations[0], ROTATION, atol=1e-9)


def test_free_rotation_is_composed_with_the_vertical(tmp_path):
    # MMVII's T7: with a tilted vertical the rotation of the instrument in the frame is the same,
    # and G0 is read from R_(vertical -> instrument)
    tilt = np.array([[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [0.0, 0.8, 0.6]])
    sketch = Sketch(tmp_path, A=A, B=B, C=C, P=P).write("#BASC").dxyz("P", "A", "B", "C", rotation=ROTATION)
    solution = sketch.solve("A", "B", "C", vertical=lambda points: np.tile(tilt, (len(points), 1, 1)))
    np.testing.assert_allclose(solution.values.rotations[0], ROTATION, atol=1e-9)
    to_instrument = ROTATION.T @ tilt.T
    assert solution.values.g0[0] == pytest.approx(math.atan2(to_instrument[1, 0], to_instrument[0, 0]))


def test_free_rotation_on_a_known_point_from_two_directions(tmp_path):
    sketch = Sketch(tmp_path, A=A, B=B, C=C, P=P).write("#BASC").dxyz("A", "P", rotation=ROTATION)
    for target in "BC":
        x, y, z = ROTATION.T @ (sketch.truth[target] - sketch.truth["A"])
        sketch.write(f"5 A {target} {math.atan2(x, y) * GON!r} 0.001")
        sketch.write(f"6 A {target} {math.atan2(math.hypot(x, y), z) * GON!r} 0.001")
    solution = sketch.solve("A", "B", "C")
    solution.assert_true("azimuth and distance")
    np.testing.assert_allclose(solution.values.rotations[0], ROTATION, atol=1e-9)


def test_free_rotation_with_targets_on_a_line_is_refused(tmp_path):
    line = {"A": (0.0, 0.0, 0.0), "B": (10.0, 0.0, 0.0), "C": (30.0, 0.0, 0.0), "P": P}
    solution = Sketch(tmp_path, **line).write("#BASC").dxyz("P", "A", "B", "C").solve("A", "B", "C")
    assert solution.method("P") is None


def test_dx_dy_of_a_plumb_station_orient_it(tmp_path):
    turn = np.array(
        [[math.cos(0.4), math.sin(0.4), 0.0], [-math.sin(0.4), math.cos(0.4), 0.0], [0.0, 0.0, 1.0]]
    )
    sketch = Sketch(tmp_path, A=A, B=B, P=P).dxyz("A", "B", "P", rotation=turn)
    solution = sketch.solve("A", "B")
    solution.assert_true("azimuth and distance")
    assert solution.values.g0[0] == pytest.approx(0.4, abs=1e-9)


def test_two_known_stations_that_do_not_see_each_other(tmp_path):
    # P and Q are seen from both; neither station has a known azimuth
    sketch = Sketch(tmp_path, A=A, B=B, P=P, Q=Q).full("A", "P", "Q", g0=1.0).full("B", "P", "Q", g0=-2.0)
    solution = sketch.solve("A", "B")
    solution.assert_true()
    assert "local frame of station A" in solution.method("P")
    np.testing.assert_allclose(solution.values.g0, [1.0, -2.0], atol=1e-9)


def test_traverse_between_two_known_points_without_azimuth(tmp_path):
    sketch = Sketch(tmp_path, A=A, P=(60, 20, 11), Q=(110, 80, 12), R=(170, 90, 9), B=(240, 60, 5))
    chain = ["A", "P", "Q", "R", "B"]
    for k, station in enumerate(chain):
        for target in chain[max(k - 1, 0) : k] + chain[k + 1 : k + 2]:
            sketch.full(station, target, g0=0.3 * k)
    sketch.solve("A", "B").assert_true()


def test_a_levelled_traverse_between_two_known_points(tmp_path):
    sketch = Sketch(tmp_path, A=A, P=(60, 20, 11), Q=(110, 80, 12), R=(170, 90, 9), B=(240, 60, 5))
    chain = ["A", "P", "Q", "R", "B"]
    for k in (1, 2, 3):
        sketch.hz(chain[k], chain[k - 1], chain[k + 1], g0=0.3 * k)
    for one, other in itertools.pairwise(chain):
        sketch.dist(one, other).dh(one, other)
    sketch.solve("A", "B").assert_true()


@pytest.mark.parametrize("heights", ["zenith angles", "levelling"])
def test_hansen_two_unknown_stations_see_two_known_points_and_each_other(tmp_path, heights):
    sketch = Sketch(tmp_path, A=A, B=(500, 30, 12), P=(80, -300, 11), Q=(430, -260, 9))
    sketch.hz("P", "A", "B", "Q", g0=0.3).hz("Q", "A", "B", "P", g0=2.0)
    for station in "PQ":
        sketch = sketch.zen(station, "A") if heights == "zenith angles" else sketch.dh("A", station)
    solution = sketch.solve("A", "B")
    solution.assert_true()
    assert "tied to A, B" in solution.method("P")
    np.testing.assert_allclose(solution.values.g0, [0.3, 2.0], atol=1e-9)


def test_hansen_without_heights_is_told(tmp_path):
    sketch = Sketch(tmp_path, A=A, B=(500, 30, 12), P=(80, -300, 11), Q=(430, -260, 9))
    solution = sketch.hz("P", "A", "B", "Q").hz("Q", "A", "B", "P").solve("A", "B")
    for point in "PQ":
        assert "its horizontal position is found, not its height" in solution.reason(point)


def test_a_chain_of_distances_is_told(tmp_path):
    sketch = Sketch(tmp_path, A=A, P=(60, 20, 11), Q=(110, 80, 12), B=(240, 60, 5))
    for one, other in itertools.pairwise("APQB"):
        sketch.dist(one, other).dh(one, other)
    solution = sketch.solve("A", "B")
    assert "it has only one distance to A and two height differences to A, Q" in solution.reason("P")


def test_unconnected_point_is_told(tmp_path):
    solution = Sketch(tmp_path, A=A, B=B, P=P, Q=Q).full("A", "B").dist("P", "Q").solve("A", "B")
    assert "not connected to any known point" in solution.reason("P")
    assert "not connected" in solution.reason("Q")


def test_direction_without_distance_is_told(tmp_path):
    reason = Sketch(tmp_path, A=A, B=B, P=P).hz("A", "B", "P").zen("A", "P").solve("A", "B").reason("P")
    assert "one direction from A and one zenith angle from A" in reason
    assert "a distance, or a direction from another point, is needed" in reason


def test_nearly_parallel_directions_are_told(tmp_path):
    sketch = Sketch(tmp_path, A=A, B=B, P=(9000.0, 0.5, 10.0)).hz("A", "B", "P").hz("B", "A", "P")
    assert "too weak" in sketch.zen("A", "P").solve("A", "B").reason("P")


def test_point_behind_an_unplaced_one_is_told(tmp_path):
    solution = (
        Sketch(tmp_path, A=A, B=B, P=P, Q=Q).full("A", "B").dist("A", "P").dist("P", "Q").solve("A", "B")
    )
    assert solution.reason("Q") == "observed only with points that have no position either: P"


def test_points_that_lack_nothing_but_an_azimuth_are_told_so(tmp_path):
    """A station on a known point that sees no other; the instrument on P has none to be oriented by."""
    sketch = Sketch(tmp_path, A=A, B=B, P=P, Q=Q).full("A", "P", "Q").hz("P", "Q").dist("P", "Q")
    solution = sketch.solve("A", "B")
    advice = "an azimuth (Azim, code 8) or a reading of a known point is needed at A"
    assert [solution.reason(name).endswith(advice) for name in "PQ"] == [True, True]
    (station,) = [item for item in solution.values.unplaced if item.station is not None]
    assert "an azimuth (Azim, code 8) from there" in station.reason
    assert sketch.write("8 A P 50 0.001").solve("A", "B").values.unplaced == ()


def test_require_complete_lists_everything(tmp_path):
    solution = (
        Sketch(tmp_path, A=A, B=B, P=P, Q=Q).full("A", "B").dist("A", "P").dist("P", "Q").solve("A", "B")
    )
    with pytest.raises(
        InputError, match=r"(?s)point P: it has only one distance to A.*point Q: observed only"
    ):
        solution.values.require_complete()


def test_station_whose_targets_are_all_on_its_vertical_is_told(tmp_path):
    sketch = Sketch(tmp_path, A=A, T=(0.0, 0.0, 30.0)).write("5 A T 12 0.001")
    values = sketch.solve("A", "T").values
    assert [item.what for item in values.unplaced] == [f"station A ({sketch.file}:1)"]
    assert "on its vertical" in values.unplaced[0].reason


def test_plumb_station_in_a_frame_without_vertical_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"sketch.obs:1.*#VERT station needs a frame"):
        Sketch(tmp_path, A=A, B=B).hz("A", "B").solve("A", "B", vertical=None)


def test_blunder_in_one_direction_does_not_move_the_point(tmp_path):
    sketch = Sketch(tmp_path, A=A, B=B, C=C, Q=Q, P=P)
    for station in "ABCQ":
        sketch.hz(station, *(set("ABCQ") - {station}), "P", g0=0.2)
    sketch.zen("A", "P").zen("B", "P")
    sketch.lines = [x if not x.startswith("5 Q P") else "5 Q P 137 0.001" for x in sketch.lines]
    sketch.solve("A", "B", "C", "Q").assert_true("intersection")


def test_order_of_lines_changes_nothing_but_the_order(tmp_path):
    sketch = Sketch(tmp_path, A=A, B=B, C=C, P=P, Q=Q).full("P", "A", "B", "Q", g0=0.3).hz("C", "A", "Q", "P")
    first = sketch.solve("A", "B", "C")
    sketch.lines.reverse()
    second = sketch.solve("A", "B", "C")
    for name in "PQ":
        np.testing.assert_allclose(
            first.values.coordinates[first.names.index(name)],
            second.values.coordinates[second.names.index(name)],
            atol=1e-9,
        )


@pytest.mark.parametrize("status", ["#FIX", "#VERT"])
@pytest.mark.parametrize("height", ["4 A E 1.619 0.001", "16 A E 1.619 0.001"])
def test_a_centring_of_exactly_zero_is_placed(tmp_path, status, height):
    sketch = Sketch(tmp_path, A=A, E=(A[0], A[1], A[2] + 1.619)).write(status)
    sketch.write("14 A E 0 0.001").write("15 A E 0 0.001").write(height).solve("A").assert_true()


@pytest.mark.parametrize("status", ["#FIX", "#VERT"])
def test_a_centring_of_exactly_zero_measured_from_the_unknown_point_is_placed(tmp_path, status):
    sketch = Sketch(tmp_path, A=A, E=(A[0], A[1], A[2] + 1.6)).write(status)
    sketch.write("14 E A 0 0.001").write("15 E A 0 0.001").write("16 E A -1.6 0.001").solve("A").assert_true()


def test_a_mirror_position_that_one_distance_misses_by_many_sigmas_is_no_solution(tmp_path):
    truth = {"A": (0, 0, 10), "B": (500, 30, 15), "C": (250, 420, 30), "D": (-200, 380, 22)}
    sketch = Sketch(tmp_path, **truth, P=(180, 160, 60)).dist("P", *truth)
    sketch.solve(*truth).assert_true("trilateration")
    # the same four known points in one plane leave both sides open
    flat_truth = {name: (x, y, 10.0) for name, (x, y, _) in truth.items()}
    sketch = Sketch(tmp_path, **flat_truth, P=(180, 160, 60)).dist("P", *truth)
    assert "fit several positions equally well" in sketch.solve(*truth).reason("P")
