"""The antenna beside the camera, and the shutter that rolls, by hand."""

import numpy as np

from obseq.kernels import calculator

DOWN = np.diag([1.0, -1.0, -1.0])
"""From the camera to the world: it looks down, its x to the east."""


def test_an_antenna_is_the_lever_arm_away():
    # Camera at (10, 20, 30) looking down; lever arm (1, 2, 3) in its axes: (1, -2, -3) in the world.
    antenna = calculator("AntennaPosition")
    unknowns = [[10.0, 20.0, 30.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0]]
    observed = [[*DOWN.T.ravel(), 11.0, 18.5, 27.0]]
    values, jacobian = antenna.values_and_jacobian(unknowns, observed)
    np.testing.assert_allclose(values, [[0.0, -0.5, 0.0]], atol=1e-15)
    np.testing.assert_allclose(jacobian[0, :, 6:], DOWN, atol=1e-15)


def test_a_line_below_the_middle_is_seen_later():
    # Focal length 1000, 100 above the ground, middle of the image (500, 400), 800 lines. A point 20 m to the
    # south is in line 600: 600 / 800 - 1/2 = 1/4 of a readout of 0.08 s, at 10 m/s to the east: 0.2 m. From
    # there the point is 0.2 m to the west: 2 pixels to the left of the middle.
    rolling = calculator("EqColinearityRolling_Stenope_Dist_Rad3_Dec1_XY1")
    calibration = [1000.0, 500.0, 400.0, *[0.0] * 7]
    unknowns = [[0.0, -20.0, 0.0, 0.0, 0.0, 100.0, 0.0, 0.0, 0.0, *calibration, 0.08]]
    names = dict.fromkeys(rolling.observations, 0.0)
    matrix = [name for name in names if name.startswith("M_")]
    names |= dict(zip(matrix, DOWN.T.ravel(), strict=True))
    names |= {"Im_x": 497.0, "Im_y": 599.0, "V_x": 10.0, "Height": 800.0}
    values, jacobian = rolling.values_and_jacobian(unknowns, [list(names.values())])
    np.testing.assert_allclose(values, [[1.0, 1.0]], atol=1e-9)
    # One second of readout more: 1/4 s of 10 m/s, 10 pixels a metre.
    np.testing.assert_allclose(jacobian[0, :, rolling.unknowns.index("Readout")], [-25.0, 0.0], atol=1e-9)


def test_the_line_is_where_the_moved_camera_sees_it():
    # Flying south at 10 m/s: t = 0.08 (y / 800 - 1/2) and y = 400 + 10 (20 - 10 t): t = 0.02 / 1.01.
    rolling = calculator("EqColinearityRolling_Stenope_Dist_Rad3_Dec1_XY1")
    calibration = [1000.0, 500.0, 400.0, *[0.0] * 7]
    unknowns = [[0.0, -20.0, 0.0, 0.0, 0.0, 100.0, 0.0, 0.0, 0.0, *calibration, 0.08]]
    names = dict.fromkeys(rolling.observations, 0.0)
    matrix = [name for name in names if name.startswith("M_")]
    names |= dict(zip(matrix, DOWN.T.ravel(), strict=True))
    names |= {"V_y": -10.0, "Height": 800.0}
    values = rolling.values(unknowns, [list(names.values())])
    np.testing.assert_allclose(
        values, [[500.0, 600.0 - 100.0 * 0.02 / 1.01]], atol=3e-4
    )  # 1 % of 2 pixels, twice
