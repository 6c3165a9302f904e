"""Survey observations and images in one system."""

import numpy as np
import pytest
import scenes

from obseq.errors import InputError
from obseq.images import BundleAdjustment, ControlPoints
from obseq.survey import Network

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


def test_a_levelled_height_improves_heights_as_a_dense_reference_says(survey):
    block, _, truth = scenes.block()
    before = block.solve(eliminate=False)
    levelled = survey(truth, targets=(), levelled=("P10",))
    block.add_survey(levelled)
    after = block.solve(eliminate=False)
    row = before.points.index("P10")
    z = np.sqrt(after.point_covariances[after.points.index("P10"), 2, 2])
    assert z < 0.2 * np.sqrt(before.point_covariances[row, 2, 2])
    # the dense inverse of the whole normal matrix, unknowns in the order of the system
    normal = after.equations.system.equations()
    dense = normal.pattern.matrix(normal.assemble(viscous=False).values).toarray()
    inverse = np.linalg.inv(dense) * after.result.variance_factor
    place = normal.free.number[after.equations.system.unknowns.scalars(after.equations.points)]
    expected = np.array([inverse[np.ix_(k, k)] for k in place])
    np.testing.assert_allclose(after.point_covariances, expected, rtol=1e-6, atol=1e-16)


def test_a_point_known_twice_is_refused(survey):
    block = BundleAdjustment()
    block.add_cameras(scenes.CAMERA)
    block.add_control_points(ControlPoints.of(["S"], [[6.0, -5.0, 1.0]], 0.01))
    with pytest.raises(InputError, match="point 'S' is a control point, and known in the survey network too"):
        block.add_survey(survey(scenes.block()[2]))
