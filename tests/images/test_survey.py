"""Survey observations and images in one system."""

from dataclasses import replace

import numpy as np
import pytest
import scenes
from accused import diagnosis

from obseq.errors import InputError
from obseq.images import BundleAdjustment, ControlPoints
from obseq.survey import Network
from obseq.survey.kinds.registry import IS_ANGLE

SIGMA = 0.0002


@pytest.fixture
def survey(tmp_path):
    """A plumb station on a pillar beside the ring, that sights three targets of the block."""

    def made(truth, targets=("P0", "P1", "P2"), levelled=()):
        lines = ["#VERT"]
        station = np.array([6.0, -5.0, 1.0])
        for name in targets:
            dx, dy, dz = map(float, truth[name] - station)
            flat = np.hypot(dx, dy)
            lines += [
                f"3 S {name} {np.hypot(flat, dz)} {SIGMA}",
                f"5 S {name} {np.arctan2(dx, dy) % (2 * np.pi) * 200 / np.pi} 0.001",
                f"6 S {name} {np.arctan2(flat, dz) * 200 / np.pi} 0.001",
            ]
        lines += [f"4 S {name} {truth[name][2] - station[2]} 0.00001" for name in levelled]
        (tmp_path / "s.obs").write_text("\n".join(lines) + "\n")
        (tmp_path / "s.cor").write_text("1 S 6.0 -5.0 1.0 0.0001 0.0001 0.0001\n")
        return Network.read(tmp_path / "s.obs", tmp_path / "s.cor", frame="RTL*2.4*48.8*0*EPSG:4326")

    return made


def test_a_plumb_station_is_a_datum_with_one_control_point(survey):
    block, poses, truth = scenes.block(n_control=0)
    block.add_control_points(ControlPoints.of(["P9"], [truth["P9"]], 0.0001))
    block.add_survey(survey(truth))
    solution = block.solve()
    (part,) = solution.surveys
    assert solution.result.n_observations == 2 * len(solution.residuals.row) + 9 + 3
    own = {name: row for row, name in enumerate(part.network.points.names)}
    np.testing.assert_array_equal(
        part.coordinates(solution.result)[own["P1"]], solution.coordinates[solution.points.index("P1")]
    )
    sigmas = np.sqrt(np.diagonal(solution.centre_covariances, axis1=1, axis2=2))
    assert (np.abs(solution.poses.centres - poses.centres) < 4.0 * sigmas).all()
    assert np.nanmax(np.abs(part.residuals(solution.result))) < 0.001


def _covariances(solution, names):
    rows = [solution.points.index(name) for name in names]
    return solution.point_covariances[rows]


def _dense(solution, names):
    """The same from the dense inverse of the whole normal matrix."""
    system = solution.equations.system
    normal = system.equations()
    matrix = normal.pattern.matrix(normal.assemble(viscous=False).values).toarray()
    inverse = np.linalg.inv(matrix) * solution.result.variance_factor
    rows = [solution.points.index(name) for name in names]
    place = normal.free.number[system.unknowns.scalars(solution.equations.points[rows])]
    return np.array([inverse[np.ix_(k, k)] for k in place])


@pytest.mark.parametrize("kind", ["levelled", "plumb station", "distance", "nothing"])
@pytest.mark.parametrize("eliminate", [True, False])
def test_an_observation_between_targets_changes_precisions_as_a_dense_reference_says(survey, kind, eliminate):
    block, _, truth = scenes.block()
    before = block.solve()
    names = ["P10", "P11", "P0"]
    if kind == "levelled":
        block.add_survey(survey(truth, targets=(), levelled=("P10",)))
    elif kind == "plumb station":
        block.add_survey(survey(truth, targets=("P10", "P11")))
    elif kind == "distance":
        block.add_length("P10", "P0", float(np.linalg.norm(truth["P10"] - truth["P0"])), 1e-5)
    after = block.solve(eliminate=eliminate)
    np.testing.assert_allclose(_covariances(after, names), _dense(after, names), rtol=1e-6, atol=1e-15)
    if kind == "nothing":
        np.testing.assert_allclose(_covariances(after, names), _covariances(before, names), rtol=1e-6)
    else:
        traces = [np.trace(_covariances(part, names)[0]) / part.sigma0**2 for part in (after, before)]
        assert traces[0] < 0.95 * traces[1]
        z = [_covariances(part, names)[0, 2, 2] ** 0.5 / part.sigma0 for part in (after, before)]
        assert z[0] < (0.2 if kind == "levelled" else 1.0) * z[1]


def test_a_point_known_twice_is_refused(survey):
    block = BundleAdjustment()
    block.add_cameras(scenes.CAMERA)
    block.add_control_points(ControlPoints.of(["S"], [[6.0, -5.0, 1.0]], 0.01))
    with pytest.raises(InputError, match="point 'S' is a control point, and known in the survey network too"):
        block.add_survey(survey(scenes.block()[2]))


def test_a_camera_is_a_point_and_a_station_of_the_survey(tmp_path):
    """A distance to a projection centre, directions in the axes of a camera: as the formulas say by name."""
    import obseq

    block, poses, truth = scenes.block()
    image, other = poses.images[0], poses.images[1]
    rotation, centre = poses.rotations[0], poses.centres[0]
    x, y, z = rotation.T @ (truth["P3"] - centre)
    length = float(np.linalg.norm(poses.centres[1] - truth["P4"]))
    hz, zen = np.arctan2(x, y), np.arctan2(np.hypot(x, y), z)
    lines = [f"3 P4 {other} {length:.9f} 0.0001", "#CAM"]
    lines += [
        f"5 {image} P3 {hz * 200 / np.pi:.10f} 0.0005",
        f"6 {image} P3 {zen * 200 / np.pi:.10f} 0.0005",
    ]
    (tmp_path / "s.obs").write_text("\n".join(lines) + "\n")
    (tmp_path / "s.cor").write_text("0 P3 0 0 0\n")
    network = Network.read(tmp_path / "s.obs", tmp_path / "s.cor", frame="Local", refraction=1.0)
    by_name = obseq.Adjustment()
    by_name.add_images(scenes.block()[0])
    by_name.add("TopoDist", origin="P4", target=other, distance=round(length, 9), sigma=0.0001)
    sigma = 0.0005 * np.pi / 200
    by_name.add("TopoHz", station=image, target="P3", hz=hz, sigma=sigma)
    by_name.add("TopoZen", station=image, target="P3", zenith=zen, refraction=0.0, sigma=sigma)
    block.add_survey(network)
    solution, expected = block.solve(), by_name.solve()
    np.testing.assert_allclose(solution.poses.centres, expected.images.poses.centres, atol=1e-8)
    np.testing.assert_allclose(solution.centre_covariances, expected.images.centre_covariances, rtol=1e-5)
    assert solution.sigma0 == pytest.approx(expected.sigma0, rel=1e-7)
    (part,) = solution.surveys
    assert np.isfinite(part.residuals(solution.result)).all()


def test_a_camera_without_an_image_is_told(tmp_path):
    (tmp_path / "s.obs").write_text("#CAM\n5 nobody P3 10 0.001\n5 nobody P4 20 0.001\n")
    block, _, truth = scenes.block()
    x, y, z = truth["P3"]
    (tmp_path / "s.cor").write_text(f"1 nobody {x + 3} {y} {z} 0.01 0.01 0.01\n")
    network = Network.read(tmp_path / "s.obs", tmp_path / "s.cor", frame="Local")
    with pytest.raises(InputError, match="its station is a camera"):
        network.initial_values()
    block.add_survey(network)
    with pytest.raises(InputError, match=r"station nobody is a camera \(#CAM\), but no image is called so"):
        block.solve()


@pytest.mark.slow
def test_angles_of_a_survey_that_were_written_in_degrees_are_named_and_nothing_is_listed(survey):
    block, _, truth = scenes.block(n_images=5, n_points=14, n_control=6, seed=9)
    block.freeze_parameters("K.|p.|b.")
    network = survey(truth, targets=[f"P{k}" for k in range(4, 12)])
    book, rows = network.book, network.book.observations
    values = np.where(IS_ANGLE[rows.types], 0.9 * rows.values, rows.values)
    block.add_survey(replace(network, book=replace(book, observations=replace(rows, values=values))))
    (one,) = diagnosis(block).accused
    assert one.code == "S200" and "degrees read as gon" in one.text
