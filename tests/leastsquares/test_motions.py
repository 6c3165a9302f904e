"""The kernel of a network, in the words of a surveyor."""

import numpy as np
import pytest

from obseq.errors import SingularSystemError
from obseq.leastsquares import LeastSquares
from obseq.leastsquares.diagnosis.free_motions import find_motions

RNG = np.random.default_rng(0)


def message(system):
    with pytest.raises(SingularSystemError) as error:
        system.solve()
    return str(error.value)


def distances(system, ids, formula="Dist3D", scale=1.0):
    first, second = np.triu_indices(len(ids), 1)
    xyz = system.values(ids)
    lengths = scale * np.linalg.norm(xyz[second] - xyz[first], axis=1)
    system.add(formula, {"p1": ids[first], "p2": ids[second]}, lengths, 0.01)


def cloud(system, n=6, dimension=3, name="P", seed=0):
    xyz = np.random.default_rng(seed).uniform(0, 100, (n, dimension))
    return system.add_points([f"{name}{k}" for k in range(n)], xyz)


def test_distances_in_space_leave_position_and_orientation():
    system = LeastSquares()
    distances(system, cloud(system))
    assert (
        "Nothing fixes the position along x, y, z and the rotation about x, y, z of P0, P1, P2, P3, P4, P5"
        in message(system)
    )


def test_distances_in_the_plane():
    system = LeastSquares()
    distances(system, cloud(system, dimension=2), "Dist2DCons")
    assert "the position along x, y and the orientation of P0" in message(system)


def test_a_known_point_leaves_only_the_rotations():
    system = LeastSquares()
    ids = cloud(system)
    distances(system, ids)
    system.freeze(ids[:1])
    text = message(system)
    assert "Nothing fixes the rotation about x, y, z of P1, P2, P3, P4, P5" in text
    assert "position" not in text


def test_two_known_points_leave_the_rotation_about_their_line():
    system = LeastSquares()
    ids = cloud(system)
    xyz = system.values(ids)
    xyz[:2] = [[0, 0, 0], [0, 0, 50]]
    system.set_values(ids, xyz)
    distances(system, ids)
    system.freeze(ids[:2])
    assert "Nothing fixes the rotation about z of P2, P3, P4, P5" in message(system)


def test_heights_alone_are_named():
    system = LeastSquares()
    ids = system.add_points(["A", "B", "C"], RNG.uniform(0, 10, (3, 3)))
    system.freeze(ids, ("x", "y"))
    up = np.tile([0.0, 0.0, 1.0], (2, 1))
    system.add_linear([ids[:2], ids[1:]], [-up, up], [1.0, 2.0], 0.001)
    assert "Nothing fixes the position along z of A, B, C" in message(system)


def test_two_separate_networks_are_told_apart():
    system = LeastSquares()
    distances(system, cloud(system, 4, name="A", seed=1))
    distances(system, cloud(system, 4, name="B", seed=2))
    text = message(system)
    assert "of A0, A1, A2, A3; nor the position" in text
    assert text.count("the rotation about x, y, z") == 2


def test_directions_between_points_leave_the_scale():
    # Parallel to a fixed direction each: differences of coordinates in fixed ratios.
    system = LeastSquares()
    xyz = np.array([[0.0, 0.0], [3.0, 1.0], [1.0, 4.0]])
    ids = system.add_points(["A", "B", "C"], xyz)
    system.freeze(ids[:1])
    for i, j in ((0, 1), (0, 2), (1, 2)):
        across = np.array([[xyz[j, 1] - xyz[i, 1], xyz[i, 0] - xyz[j, 0]]])
        system.add_linear([ids[[i]], ids[[j]]], [-across, across], [0.0], 1.0)
    assert "Nothing fixes the scale of B, C" in message(system)


def named(system, ids):
    """Motions of the kernel of a system whose datum rests on all points: text, points and moves."""
    system.set_datum(ids)
    system.solve()
    analysis = system.analysis(reduced=True)
    parts = analysis.equations
    return list(find_motions(parts.table, parts.free, parts.pattern, analysis.solver.null_vectors()))


def test_motions_of_a_kernel_are_named_and_span_it():
    system = LeastSquares()
    ids = cloud(system)
    distances(system, ids)
    found = named(system, ids)
    assert [motion.text for motion in found] == [
        *(f"the position along {axis}" for axis in "xyz"),
        *(f"the rotation about {axis}" for axis in "zxy"),
    ]
    xyz = system.values(ids) - system.values(ids).mean(axis=0)
    for motion in found:
        assert np.linalg.norm(motion.moves, axis=1).max() == pytest.approx(1.0)
        first, second = np.triu_indices(len(ids), 1)
        stretched = (motion.moves[second] - motion.moves[first]) * (xyz[second] - xyz[first])
        np.testing.assert_allclose(stretched.sum(axis=1), 0.0, atol=1e-9)  # no length changes
    turned = np.cross([0.0, 0.0, 1.0], xyz)
    np.testing.assert_allclose(found[3].moves, turned / np.linalg.norm(turned, axis=1).max(), atol=1e-9)


def test_parts_that_nothing_joins_move_for_themselves():
    system = LeastSquares()
    near, far = cloud(system, 4), cloud(system, 4, name="Q", seed=1)
    for ids in (near, far):
        distances(system, ids)
    found = named(system, np.concatenate([near, far]))
    assert len(found) == 12
    assert [set(motion.points.tolist()) for motion in found] == [set(near.tolist())] * 6 + [
        set(far.tolist())
    ] * 6


def test_what_is_no_similarity_is_a_change_of_shape():
    system = LeastSquares()
    ids = system.add_points(["A", "B", "C", "D"], [[0, 0], [10, 0], [10, 10], [0, 10.0]])
    xyz = system.values(ids)
    sides = (ids, np.roll(ids, -1))
    lengths = np.linalg.norm(np.roll(xyz, -1, axis=0) - xyz, axis=1)
    system.add("Dist2DCons", {"p1": sides[0], "p2": sides[1]}, lengths, 0.01)
    texts = [motion.text for motion in named(system, ids)]
    assert texts == ["the position along x", "the position along y", "the orientation", "a change of shape"]
