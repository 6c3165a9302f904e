"""Over every formula of the registry: names, check values, kernels against the formula itself, hashes."""

import json
import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from families import of_each
from unchanged import Seen

from obseq.codegen.compiler import derive
from obseq.codegen.dependencies import functions_hash
from obseq.codegen.modules import module_name
from obseq.errors import FormulaError
from obseq.formulas import REGISTRY, Formula
from obseq.kernels import Calculator, calculator, derivatives, formula_names
from obseq.module_texts import text_hash

VALUE_TOLERANCE = 1e-12
JACOBIAN_TOLERANCE = 1e-9

EXCERPT = Path(__file__).parents[1] / "data" / "mmvii-check-values" / "check-values.json"


@cache
def records(path: Path) -> dict[str, dict[str, Any]]:
    return {record["name"]: record for record in json.loads(path.read_text("utf-8"))}


def recorded() -> list[Formula]:
    """The formulas whose values MMVII gave."""
    return [formula for formula in REGISTRY if formula.name in records(EXCERPT)]


@pytest.fixture(scope="module")
def names(shared_data: Path) -> dict[str, dict[str, Any]]:
    return records(shared_data / "mmvii-check-values" / "names.json")


@pytest.fixture(scope="module")
def check_values(shared_data: Path) -> dict[str, dict[str, Any]]:
    return records(shared_data / "mmvii-check-values" / "check-values.json")


def draw(calc: Calculator, count: int) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Admissible random inputs of a formula."""
    return derivatives.draw(calc.kernel, count, np.random.default_rng(7))


def test_generated_modules_are_those_of_the_registry() -> None:
    assert sorted(formula.name for formula in REGISTRY) == list(formula_names())


def test_names_and_order_are_those_of_mmvii(names: dict[str, dict[str, Any]]) -> None:
    for name, record in names.items():
        calc = calculator(name)
        assert list(calc.unknowns) == record["unknowns"], name
        assert list(calc.observations) == record["observations"], name
        assert len(calc.residuals) == record["outputs"], name


@of_each(recorded())
def test_values_and_derivatives_are_those_of_mmvii(
    formula: Formula, check_values: dict[str, dict[str, Any]]
) -> None:
    record, calc = check_values[formula.name], calculator(formula.name)
    for point in record["points"]:
        unknowns, observations = np.array([point["u"]]), np.array([point["o"]])
        both, jacobian = calc.values_and_jacobian(unknowns, observations)
        expected = np.array(point["values"])
        tolerance = record.get("values_abs_tolerance", VALUE_TOLERANCE * np.abs(expected))
        for values in (both, calc.values(unknowns, observations)):
            assert (np.abs(values[0] - expected) <= np.maximum(tolerance, 1e-15 * (expected == 0))).all(), (
                f"{formula.name}: {values[0]} instead of {expected}"
            )
        if point["jacobian"] is not None:
            rows = np.array(point["jacobian"]).reshape(jacobian[0].shape)
            largest = np.abs(rows).max(axis=1, keepdims=True, initial=0.0)
            assert (np.abs(jacobian[0] - rows) <= JACOBIAN_TOLERANCE * largest).all(), formula.name


@of_each()
def test_kernel_computes_the_residual_written_in_the_formula(formula: Formula) -> None:
    calc = calculator(formula.name)
    unknowns, observations = draw(calc, 8)
    expected = np.array(
        [formula.evaluate(u.tolist(), o.tolist()) for u, o in zip(unknowns, observations, strict=True)]
    ).reshape(8, -1)
    size = np.abs(expected).max(initial=1.0) + np.abs(observations).max(initial=0.0)
    np.testing.assert_allclose(calc.values(unknowns, observations), expected, rtol=1e-12, atol=1e-13 * size)


@of_each()
def test_derivatives_are_those_of_the_values(formula: Formula) -> None:
    check = derivatives.check_one(calculator(formula.name), samples=10, seed=1)
    assert check.passed, check


def called(text: str) -> list[str]:
    """The kernel functions that a module imports."""
    (names,) = re.findall(r"^from obseq\.kernels\.functions import (.*)$", text, re.MULTILINE) or [""]
    return names.split(", ") + re.findall(r"^from math import (.*)$", text, re.MULTILINE)


@of_each()
def test_a_residual_that_is_called_like_a_measured_number_is_computed_minus_it(formula: Formula) -> None:
    """Moving that number moves this residual by as much, the other way."""
    calc = calculator(formula.name)
    unknowns, observations = draw(calc, 3)
    before = calc.values(unknowns, observations)
    for k, name in enumerate(calc.residuals):
        if name in formula.measured:
            moved = observations.copy()
            moved[:, calc.observations.index(name)] += 1e-3
            after = calc.values(unknowns, moved)
            np.testing.assert_allclose(
                after[:, k] - before[:, k], -1e-3, atol=1e-8 + 1e-14 * np.abs(before).max(), err_msg=name
            )


def test_of_a_correction_and_a_reading_the_reading_was_measured() -> None:
    named = {formula.name: calculator(formula.name).residuals for formula in REGISTRY}
    assert named["TopoZen"] == named["TopoHzOff"] == named["TopoAngle"] == ("val",)
    assert named["Dist2DCons"] == ("residual",)  # relative to the distance
    assert sum(name in formula.measured for formula in REGISTRY for name in named[formula.name]) > 100


@of_each()
def test_hashes_are_current(formula: Formula, seen: Seen) -> None:
    if f"hashes/{formula.name}" in seen or "the folder" in seen:  # whose files hold them
        return
    text = Path(calculator(formula.name).kernel.module.__file__ or "").read_text("utf-8")
    (found,) = re.findall(
        r"^# formula sha256:(\w+)  text sha256:(\w+)  functions sha256:(\w+)$", text, re.MULTILINE
    )
    assert found == (derive(formula).digest, text_hash(text), functions_hash(called(text)))
    seen.add(f"hashes/{formula.name}")


def test_module_names_are_distinct() -> None:
    modules = [module_name(formula.name) for formula in REGISTRY]
    assert len(set(modules)) == len(modules)


@of_each()
def test_every_formula_says_what_it_is(formula: Formula) -> None:
    documentation = " ".join((type(formula).__doc__ or "").split())
    assert re.search(r"(Residual|Values?)\b.*: ", documentation), "say the equation"
    assert re.search(r"[Uu]ndefined|[Dd]efined everywhere|as `\w+` with", documentation), (
        "say where the equation holds"
    )
    assert formula.source, "say where the equation comes from"


def test_names_of_typical_values_are_checked() -> None:
    from obseq.codegen.pipeline import generate
    from obseq.formulas.plane import Dist2DCons

    class Misspelt(Dist2DCons):
        typical = {"p3": (0.0, 1.0)}  # noqa: RUF012

    with pytest.raises(FormulaError, match="p3"):
        generate(Misspelt())
