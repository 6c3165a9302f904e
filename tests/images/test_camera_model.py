"""Camera models of one's own: what is refused, and where they cannot go."""

import pytest

from obseq.errors import InputError
from obseq.images import Camera, CameraModel
from obseq.kernels import load
from obseq.project.cameras import calibration_text

PLANE = load("EqDist_Dist_Rad2_Dec0_XY0")
EQUATION = load("EqColinearityCamPPC_Stenope_Dist_Rad2_Dec0_XY0")


def test_a_model_is_a_camera_like_any_other():
    own = Camera("own", 2000, 1500, 1800.0, distortion={"K1": -0.1}, model=CameraModel(PLANE, EQUATION))
    known = Camera("known", 2000, 1500, 1800.0, degree=(2, 0, 0), distortion={"K1": -0.1})
    points = [[0.3, -0.2, 1.0], [0.1, 0.4, 2.0]]
    assert own.project(points).tolist() == known.project(points).tolist()
    assert own.parameter_names == known.parameter_names
    assert own.formula == known.formula
    with pytest.raises(InputError, match="camera own: no calibration file of MMVII says the distortion of"):
        calibration_text(own)


def test_two_formulas_that_do_not_fit_are_refused():
    with pytest.raises(InputError, match=r"ends with .*has the coefficients K1, K2"):
        CameraModel(PLANE, load("EqColinearityCamPPC_Stenope_Dist_Rad3_Dec0_XY0"))
    with pytest.raises(InputError, match="Dist3D has the blocks p1, p2; a colinearity has point"):
        CameraModel(PLANE, load("Dist3D"))
    with pytest.raises(InputError, match="is no map of the plane"):
        CameraModel(EQUATION, EQUATION)
