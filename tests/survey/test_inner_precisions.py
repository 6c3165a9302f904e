"""Precisions with the datum of inner constraints, against dense pseudo-inverses and real networks."""

from dataclasses import replace

import numpy as np
import pytest

from obseq.survey import Datum, Network, Quality, network_from_tables
from obseq.survey.planning.simulation import Simulation

PLACES = {
    "A": (0.0, 0.0, 0.0),
    "B": (1.0, 0.1, 0.2),
    "C": (0.9, 1.1, -0.1),
    "D": (-0.1, 0.8, 0.3),
    "E": (0.4, 0.5, 0.6),
}
RTL = "RTL*657700*6860700*0*IGNF:LAMB93"
INNER = Quality(inner=True, a_priori=True)


def sighted(size, sigma, frame="Local", kinds=("Hz", "Zen", "Dist"), known=("A", "B")):
    """A network of all sights between five points, exact, of any size (m) and sigma (m across the sight)."""
    places = {name: tuple(size * np.array(xyz)) for name, xyz in PLACES.items()}
    points = {"name": list(places)}
    for axis, column in enumerate("xyz"):
        points[column] = [xyz[axis] for xyz in places.values()]
        points[f"s{column}"] = [sigma if name in known else None for name in places]
    rows = [(kind, a, b) for a in places for b in places if a != b for kind in kinds]
    sigmas = [sigma if kind == "Dist" else sigma / size for kind, _, _ in rows]
    of_kind, starts, ends = map(list, zip(*rows, strict=True))
    table = {"type": of_kind, "from": starts, "to": ends, "value": [1.0] * len(rows), "sigma": sigmas}
    return places, rows, sigmas, Simulation(network_from_tables(points, table, frame=frame)).without_errors()


def computed(kind, sight):
    if kind == "Dist":
        return np.linalg.norm(sight)
    if kind == "Hz":
        return np.arctan2(sight[0], sight[1])
    return np.arctan2(np.hypot(sight[0], sight[1]), sight[2])


def pseudo_inverse(places, rows, sigmas, size, defect):
    """(n, 3, 3) of the points, orientations of the circles eliminated: plane verticals, dense."""
    names = list(places)
    design = np.zeros((len(rows), 3 * len(names)))
    turns = np.zeros((len(rows), len(names)))
    for row, (kind, a, b) in enumerate(rows):
        sight = np.subtract(places[b], places[a])
        step = 1e-4 * size * np.eye(3)
        slopes = [(computed(kind, sight + d) - computed(kind, sight - d)) / (2e-4 * size) for d in step]
        for name, sign in ((a, -1.0), (b, 1.0)):
            at = 3 * names.index(name)
            design[row, at : at + 3] += sign * np.array(slopes)
        turns[row, names.index(a)] = kind == "Hz"
    design, turns = design / np.array(sigmas)[:, None], turns / np.array(sigmas)[:, None]
    basis, sizes, _ = np.linalg.svd(turns, full_matrices=False)
    basis = basis[:, sizes > 1e-9 * max(sizes.max(), 1e-300)]
    _, s, vt = np.linalg.svd(design - basis @ (basis.T @ design), full_matrices=False)
    kept = len(s) - defect
    assert s[kept - 1] > 1e-3 * s[0]
    inverse = (vt[:kept].T / s[:kept] ** 2) @ vt[:kept]
    return np.array([inverse[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] for k in range(len(names))])


@pytest.mark.parametrize("frame", ["Local", RTL])
@pytest.mark.parametrize(("size", "sigma"), [(1.0, 1e-9), (10.0, 1e-7), (300.0, 0.002), (2000.0, 0.5)])
@pytest.mark.parametrize("kinds", [("Hz", "Zen", "Dist"), ("Zen", "Dist")])
def test_they_are_the_pseudo_inverse_whatever_size_and_sigmas(frame, size, sigma, kinds):
    places, rows, sigmas, network = sighted(size, sigma, frame, kinds)
    found = network.adjust(quality=INNER).inner
    expected = pseudo_inverse(places, rows, sigmas, size, defect=4)
    np.testing.assert_allclose(found, expected, atol=2e-3 * np.abs(expected).max())
    if frame == "Local":
        np.testing.assert_allclose(found, expected, atol=1e-5 * np.abs(expected).max())


def test_zenith_angles_and_distances_on_the_earth_leave_the_turn_about_the_vertical():
    *_, network = sighted(1000.0, 0.01, RTL, ("Zen", "Dist"), known=())
    record = network.adjust(datum=Datum("inner")).record()
    texts = [motion.text for motion in record.undetermined]
    assert len(texts) == 4
    assert "the rotation about z" in texts


def test_levelling_between_points_of_known_plan_leaves_the_height_alone():
    """Heights change when points turn about the vertical of a curved frame; those of known plan do not."""
    generator = np.random.default_rng(4)
    names, plan = [f"P{k}" for k in range(14)], generator.uniform(-4000.0, 4000.0, (14, 2))
    heights = generator.uniform(0.0, 100.0, 14)
    ways = [(k, (k + 1) % 14) for k in range(14)] + [(k, (k + 5) % 14) for k in range(9)]
    points = {"name": names, "x": plan[:, 0], "y": plan[:, 1], "z": heights}
    points |= {"sx": [0.0] * 14, "sy": [0.0] * 14, "sz": [0.001] + [None] * 13}
    rows = {"from": [names[a] for a, _ in ways], "to": [names[b] for _, b in ways]}
    rows |= {"type": ["DH"] * len(ways), "value": [1.0] * len(ways), "sigma": [0.002] * len(ways)}
    network = Simulation(network_from_tables(points, rows, frame=RTL)).without_errors()
    record = network.adjust(datum=Datum("inner")).record()
    assert (record.redundancy, len(record.undetermined)) == (len(ways) - 13, 1)


def test_distances_on_the_earth_leave_six():
    *_, network = sighted(1000.0, 0.01, RTL, ("Dist",), known=())
    assert len(network.adjust(datum=Datum("inner")).record().undetermined) == 6


def test_a_shape_that_known_points_alone_hold_is_named():
    *_, network = sighted(100.0, 0.01, known=tuple(PLACES))
    observations = network.book.observations
    to_e = np.isin(observations.from_points, 4) | np.isin(observations.to_points, 4)
    keep = ~to_e | (np.arange(len(observations)) == np.flatnonzero(to_e)[2])
    network = replace(network, book=network.book.without(~keep))
    adjusted = network.adjust(quality=INNER)
    assert adjusted.inner is None
    assert any("do not determine the shape of the network at" in said for said in adjusted.warnings)


def test_a_point_that_nothing_else_joins_has_none():
    *_, network = sighted(100.0, 0.01, known=tuple(PLACES))
    observations = network.book.observations
    of_e = np.isin(observations.from_points, 4) | np.isin(observations.to_points, 4)
    adjusted = replace(network, book=network.book.without(of_e)).adjust(quality=INNER)
    assert np.isnan(adjusted.inner[4]).all()
    assert np.isfinite(adjusted.inner[:4]).all()
    assert [point.inner is None for point in adjusted.record().points] == [False] * 4 + [True]


@pytest.mark.parametrize("name", ["comp3d-minimal", "comp3d-polygone-k06", "comp3d-figure"])
def test_tight_sigmas_and_whole_projects_have_them(shared_data, name):
    network = Network.read_project(shared_data / name / "project.comp", encoding="latin-1")
    adjusted = network.adjust(quality=INNER)
    inner = np.trace(adjusted.inner, axis1=1, axis2=2)
    assert np.isfinite(inner).all()
    assert np.sum(inner) < 10.0 * np.sum(np.trace(adjusted.points.covariances, axis1=1, axis2=2))


def test_of_one_height_difference_the_heights_are_known_to_half_its_sigma(shared_data):
    """Two points of a covariance, and one height difference of 1 m: what it alone says of both.

    N = [1 -1; -1 1] / s^2 of the two heights, and its pseudo-inverse s^2 / 4 [1 -1; -1 1]: 0.5 m each, times
    sigma0 (0.2 m observed minus given over 1 m) 0.1 m. The plan is datum and has 0. Precisions that come
    from the covariance of the known coordinates (3e-8 m) would be of the wrong network.
    """
    network = Network.read_project(shared_data / "comp3d-corcov" / "project.comp")
    a_priori = network.adjust(quality=INNER).inner
    expected = np.diag([0.0, 0.0, 0.25])
    np.testing.assert_allclose(a_priori, [expected, expected], atol=1e-6)
    adjusted = network.adjust(quality=Quality(inner=True))
    inner = np.array([point.inner for point in adjusted.record().points])
    scale = np.sqrt(adjusted.solution.variance_factor)
    assert scale == pytest.approx(0.2, rel=1e-4)
    np.testing.assert_allclose(inner, scale * np.array([[0.0, 0.0, 0.5]] * 2), atol=1e-6)


def test_what_nothing_observes_has_no_precision_but_that_of_the_datum(shared_data):
    """The difference of x of two points is switched off: verticals alone see it, with 1e-10 of a metre."""
    path = shared_data / "comp3d-centering" / "project.comp"
    adjusted = Network.read_project(path, encoding="latin-1").adjust(quality=INNER)
    observed = np.sqrt(np.diagonal(adjusted.inner, axis1=1, axis2=2))
    np.testing.assert_allclose(observed, [[0.0, 0.0005, 0.0005]] * 2, atol=1e-6)
    assert not adjusted.inner[:, 0].any()


def test_a_plane_network_whose_heights_are_all_held_stands_freely():
    places = np.array([[0.0, 0.0], [100.0, 3.0], [97.0, 104.0], [-5.0, 101.0]])
    names, generator = list("ABCD"), np.random.default_rng(5)
    pairs = [(a, b) for a in range(4) for b in range(a)]
    lengths = [np.linalg.norm(places[a] - places[b]) + 0.003 * generator.normal() for a, b in pairs]
    points = {"name": names, "x": places[:, 0], "y": places[:, 1], "z": [5.0] * 4, "sz": [0.0] * 4}
    rows = {"from": [names[a] for a, _ in pairs], "to": [names[b] for _, b in pairs]}
    rows |= {"type": ["DistHz"] * 6, "value": lengths, "sigma": [0.003] * 6}
    adjusted = network_from_tables(points, rows).adjust(datum=Datum("inner"))
    moves = adjusted.points.coordinates[:, :2] - places
    turn = places[:, 0] @ moves[:, 1] - places[:, 1] @ moves[:, 0]
    assert adjusted.record().redundancy == 1
    assert 1e-4 < np.abs(moves).max() < 0.01
    np.testing.assert_allclose([*moves.sum(axis=0), turn / 100.0], 0.0, atol=1e-9)
