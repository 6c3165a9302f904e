"""Kernels beside their formulas at awkward places: they agree, and what is wrong there only is seen."""

import math
from typing import Any

import numpy as np
import pytest

from obseq.codegen import compile_formula
from obseq.formulas import Formula, formula
from obseq.formulas.blocks import Point3
from obseq.formulas.functions import Scalar, sqrt
from obseq.kernels import Calculator, awkward, calculator

SAMPLE = (
    "Dist3D",
    "TopoHz",
    "TopoZen",
    "TopoAngle",
    "TopoDH",
    "TopoSubFrame",
    "BlocRigid_RE",
    "Dir_FE_EquiDist",
    "EqLidarLidar",
    "EqColinearityCamPPC_Stenope_Dist_Rad3_Dec1_XY1",
    "EqLineProjCamPPC_Stenope_Dist_Rad0_Dec0_XY0",
)


@pytest.mark.parametrize("name", SAMPLE)
def test_kernels_are_their_formulas(name: str) -> None:
    (check,) = awkward.check([name])
    assert check.passed and max(check.value_error, check.slope_error) < 1e-14, check


def test_a_vertical_sight_has_no_azimuth() -> None:
    (check,) = awkward.check(["TopoHz"])
    assert check.singular == ("along +z", "along -z", "one point")


class _Wrong(Calculator):
    """A calculator whose results are changed somewhere."""

    def __init__(self, name: str, change: Any) -> None:
        super().__init__(calculator(name).kernel)
        self.change = change

    def values_and_jacobian(self, unknowns: Any, observations: Any) -> Any:
        return self.change(unknowns, *super().values_and_jacobian(unknowns, observations))


def _turned(u: Any, values: Any, jacobian: Any) -> Any:
    """The whole turn is missing just below a half turn."""
    return np.where(values > 3.0, values - 2 * math.pi, values), jacobian


def _rounded(u: Any, values: Any, jacobian: Any) -> Any:
    """Coordinates of the Earth lose half of their digits."""
    return (values + 1e-7 if np.abs(u).max() > 1e6 else values), jacobian


def _lost(u: Any, values: Any, jacobian: Any) -> Any:
    return values, np.full_like(jacobian, np.nan)


@pytest.mark.parametrize(
    ("name", "change", "place"),
    [
        ("TopoHz", _turned, "half turn"),
        ("Dist3D", _rounded, "far coordinates"),
        ("Dir_FE_EquiDist", _lost, "anywhere"),
    ],
)
def test_what_is_wrong_in_one_place_is_seen(name: str, change: Any, place: str) -> None:
    check = awkward.compared(_Wrong(name, change), formula(name))
    assert not check.passed
    assert place in (check.value_place, check.slope_place)


class _Cancelling(Formula):
    """A squared distance by the law of cosines, which far coordinates cancel."""

    def residual(self, p: Point3, q: Point3) -> Scalar:
        """The distance."""
        return sqrt(p.dot(p) - 2 * p.dot(q) + q.dot(q))


def test_an_equation_that_cancels_is_seen() -> None:
    check = awkward.compared(Calculator(compile_formula(_Cancelling())), _Cancelling())
    assert not check.passed and check.value_error > 1e-12
