"""The check of derivatives: it passes what is right, and sees every wrong sign."""

import math
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from obseq.kernels import Calculator, calculator, derivatives
from obseq.kernels.layout import Block

SURVEY = [
    *("Dist3D", "Dist3DParam", "TopoSubFrame", "TopoHz", "TopoZen", "TopoDist", "TopoDX", "TopoDY", "TopoDZ"),
    "TopoDH",
]


@pytest.mark.parametrize("name", SURVEY)
def test_survey_formulas_pass(name: str) -> None:
    (check,) = derivatives.check([name], samples=30)
    assert check.name == name
    assert check.passed and check.worst_relative_error < 1e-9
    assert check.residual in calculator(name).residuals and check.unknown in calculator(name).unknowns


class _Wrong(Calculator):
    """A calculator with one entry of its Jacobian replaced."""

    def __init__(self, name: str, residual: int, unknown: int, change: Any) -> None:
        super().__init__(calculator(name).kernel)
        self.entry = (slice(None), residual, unknown)
        self.change = change

    def values_and_jacobian(self, unknowns: Any, observations: Any) -> Any:
        values, jacobian = super().values_and_jacobian(unknowns, observations)
        jacobian[self.entry] = self.change(jacobian[self.entry])
        return values, jacobian


@pytest.mark.parametrize("name", ["TopoHz", "TopoSubFrame", "TopoDH", "BlocRigid_RE"])
def test_every_flipped_sign_is_seen(name: str) -> None:
    right = calculator(name)
    zero = {(i, j) for i, j, value in right.kernel.constant_jacobian if value == 0.0}
    for i, residual in enumerate(right.residuals):
        for j, unknown in enumerate(right.unknowns):
            if (i, j) in zero:
                continue
            check = derivatives.check_one(_Wrong(name, i, j, np.negative), samples=8, seed=1)
            assert not check.passed
            assert (check.residual, check.unknown) == (residual, unknown)


@pytest.mark.parametrize(
    "change", [lambda d: d * (1 + 1e-7), lambda d: d + 1e-7, lambda d: np.full_like(d, np.nan)]
)
def test_small_errors_and_lost_values_are_seen(change: Any) -> None:
    check = derivatives.check_one(_Wrong("Dist3D", 0, 2, change), samples=20, seed=1)
    assert not check.passed and check.unknown == "p1_z"


class _Function:
    """Values and derivatives of one unknown, in place of a calculator."""

    def __init__(self, value: Any, derivative: Any) -> None:
        self.name, self.unknowns, self.observations, self.residuals = "Mine", ("x",), (), ("r",)
        self.kernel = SimpleNamespace(
            unknowns=("x",),
            observations=(),
            residuals=("r",),
            typical={},
            blocks=(Block("x", "Scalar", 0, 1),),
        )
        self.value, self.derivative = value, derivative

    def values(self, unknowns: Any, observations: Any) -> Any:
        return self.value(unknowns)

    def values_and_jacobian(self, unknowns: Any, observations: Any) -> Any:
        return self.value(unknowns), self.derivative(unknowns)[:, :, None]


def _check(value: Any, derivative: Any) -> derivatives.DerivativeCheck:
    return derivatives.check_one(_Function(value, derivative), samples=200, seed=4)  # type: ignore[arg-type]


def test_jumps_of_whole_turns_are_redrawn() -> None:
    """An angle that jumps a hundred times in the interval: differences across a jump say nothing."""
    check = _check(lambda x: (100 * np.pi * x) % (2 * np.pi), lambda x: np.full_like(x, 100 * np.pi))
    assert check.passed


def test_kinks_and_singular_places_are_redrawn() -> None:
    with np.errstate(all="ignore"):
        assert _check(np.abs, np.sign).passed
        assert _check(lambda x: np.sqrt(x), lambda x: 0.5 / np.sqrt(x)).passed
        assert not _check(np.abs, lambda x: np.ones_like(x)).passed


def test_a_formula_that_is_nowhere_smooth_fails() -> None:
    noise = np.random.default_rng(1)
    check = _check(lambda x: noise.normal(size=x.shape), np.zeros_like)
    assert not check.passed and math.isinf(check.worst_relative_error)


def test_a_constant_has_the_derivative_zero() -> None:
    assert _check(np.ones_like, np.zeros_like).passed
    assert not _check(np.ones_like, lambda x: np.full_like(x, 1e-6)).passed


def test_inputs_are_admissible() -> None:
    kernel = calculator("TopoHz").kernel
    unknowns, observations = derivatives.draw(kernel, 50, np.random.default_rng(1))
    matrices = observations[:, :9].reshape(-1, 3, 3)
    np.testing.assert_allclose(
        matrices @ matrices.transpose(0, 2, 1), np.tile(np.eye(3), (50, 1, 1)), atol=1e-14
    )
    np.testing.assert_allclose(np.linalg.det(matrices), 1.0)
    assert (np.abs(unknowns[:, 3:6]) <= 0.1).all() and np.abs(unknowns[:, :3]).max() > 5.0


def test_typical_values_are_followed() -> None:
    kernel = replace(calculator("Dist3D").kernel, typical={"p1_x": (100.0, 2.0), "D": (7.0, 0.0)})
    unknowns, observations = derivatives.draw(kernel, 200, np.random.default_rng(1))
    assert unknowns[:, 0].min() >= 98.0 and unknowns[:, 0].max() <= 102.0
    assert np.abs(unknowns[:, 1:]).max() <= 1.0
    assert (observations == 7.0).all()
    assert derivatives.half_width(kernel, "p1_x") == 2.0
    assert derivatives.half_width(kernel, "D") == 7.0
    assert derivatives.half_width(kernel, "p2_x") == 1.0


def test_the_same_seed_gives_the_same_answer_whatever_the_other_names() -> None:
    both = derivatives.check(["Dist3D", "TopoHz"], samples=5, seed=9)
    alone = derivatives.check(["TopoHz"], samples=5, seed=9)
    assert both[1] == alone[0]
    assert derivatives.check(["TopoHz"], samples=5, seed=10) != alone


def test_progress_names_the_formulas() -> None:
    said: list[str] = []
    derivatives.check(["Dist3D", "TopoHz"], samples=2, progress=said.append)
    assert said == ["checking the derivatives of Dist3D", "checking the derivatives of TopoHz"]


@pytest.mark.slow
def test_the_generator_is_not_needed() -> None:
    program = (
        "import sys\nfrom obseq.kernels import derivatives\nassert derivatives.check(['Dist3D'])[0].passed\n"
    )
    program += "assert not {'sympy', 'jinja2', 'obseq.formulas'} & set(sys.modules)\n"
    subprocess.run([sys.executable, "-c", program], check=True)
