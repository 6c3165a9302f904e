"""C99 headers: compiled without a warning, they give what the kernels give."""

import ctypes
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from obseq.codegen.c99 import CBody, header, with_helpers
from obseq.codegen.compiler import derive
from obseq.codegen.modules import module_name
from obseq.codegen.operators import OPERATORS
from obseq.errors import FormulaError
from obseq.formulas import REGISTRY
from obseq.formulas.base import Formula
from obseq.formulas.blocks import Number
from obseq.formulas.functions import Scalar, sin
from obseq.kernels import calculator, derivatives

SAMPLE = [
    "Dist3D",
    "TopoHz",
    "TopoDH",
    "BlocRigid_RE",
    "Dir_FE_EquiDist",
    "Dir_FE_EquiSolid",
    "Dir_StereroGraphik",
    "EqLidarImCensus",
    "EqColinearityCamPPC_Stenope_Dist_Rad3_Dec1_XY1",
]
FORMULAS = {formula.name: formula for formula in REGISTRY}
COMPILER = shutil.which("cc")
OPTIONS = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", "-pedantic", "-shared", "-fPIC"]

needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler (cc) on this machine")


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """All headers of the sample in one library: their helpers must not clash."""
    folder = tmp_path_factory.mktemp("c99")
    source = []
    for name in SAMPLE:
        identifier = module_name(name)
        (folder / f"{identifier}.h").write_text(header(derive(FORMULAS[name])), "utf-8")
        source.append(f'#include "{identifier}.h"')
        source.append(
            f"void {identifier}(const double *u, const double *o, double *r, double *both, double *j);\n"
            f"void {identifier}(const double *u, const double *o, double *r, double *both, double *j)\n"
            f"{{ obseq_{identifier}_value(u, o, r); obseq_{identifier}_value_and_jacobian(u, o, both, j); }}"
        )
    (folder / "all.c").write_text("\n".join(source) + "\n", "utf-8")
    built = folder / "all.so"
    subprocess.run([str(COMPILER), *OPTIONS, str(folder / "all.c"), "-o", str(built), "-lm"], check=True)
    return ctypes.CDLL(str(built))


@needs_compiler
@pytest.mark.parametrize("name", SAMPLE)
def test_c_gives_what_the_kernel_gives(library: ctypes.CDLL, name: str) -> None:
    ours = calculator(name)
    u, o = derivatives.draw(ours.kernel, 20, np.random.default_rng(3))
    values, jacobian = ours.values_and_jacobian(u, o)
    scale = 1.0 + np.abs(u).max(initial=0.0) + np.abs(o).max(initial=0.0)
    for k in range(len(u)):
        residuals, both = np.full((2, len(ours.residuals)), np.nan)
        entries = np.full(jacobian[k].shape, np.nan)
        arguments = (u[k], o[k], residuals, both, entries)
        getattr(library, module_name(name))(*(ctypes.c_void_p(a.ctypes.data) for a in arguments))
        np.testing.assert_allclose(residuals, values[k], rtol=1e-12, atol=1e-14 * scale)
        np.testing.assert_allclose(both, residuals, rtol=1e-12, atol=1e-14 * scale)
        np.testing.assert_allclose(entries, jacobian[k], rtol=1e-9, atol=1e-12 * np.abs(jacobian[k]).max())


def test_the_order_of_arguments_is_documented() -> None:
    text = header(derive(FORMULAS["TopoHz"]))
    assert "unknowns[9]: Ci_x, Ci_y, Ci_z, Wi_x, Wi_y, Wi_z, P_to_x, P_to_y, P_to_z." in text
    assert "jacobian[1 * 9]: residual i by unknown j at jacobian[i * 9 + j]." in text
    assert text.count("#include") == 1 and "#include <math.h>" in text


def test_constant_entries_of_the_jacobian_are_written() -> None:
    """The C function has no prefilled buffer: structural zeros and ones are stores like the others."""
    text = header(derive(FORMULAS["TopoSubFrame"]))
    assert "jacobian[0] = 0.0;" in text
    assert len([line for line in text.splitlines() if line.strip().startswith("jacobian[")]) == 27


class _KeywordsAsNames(Formula):
    """Names that C or math.h reserves."""

    def residual(self, register: Number, *, jacobian: Number) -> Scalar:
        """Their sum."""
        return register + sin(jacobian)


def test_reserved_names_are_changed() -> None:
    text = header(derive(_KeywordsAsNames()))
    assert "const double register_ = unknowns[0];" in text
    assert "const double jacobian_ = observations[0];" in text


def test_an_operator_without_c_text_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(OPERATORS, "wrap_angle", replace(OPERATORS["wrap_angle"], c=None))
    with pytest.raises(FormulaError, match=r"TopoHz: the operator wrap_angle has no C text"):
        header(derive(FORMULAS["TopoHz"]))


def test_every_operator_has_a_c_text() -> None:
    assert [name for name, operator in OPERATORS.items() if operator.function and operator.c is None] == []


OPERANDS = [(0.3, 0.7), (0.9, 0.2), (0.5, 0.5)]
"""All functions are defined there; those of one operand are given the first."""


@needs_compiler
def test_the_c_text_of_an_operator_gives_its_value(tmp_path: Path) -> None:
    written = {name: operator for name, operator in OPERATORS.items() if operator.function and operator.value}
    calls = {
        name: f"{name}(a{', b' * (operator.symbol.count('{}') - 1)})" for name, operator in written.items()
    }
    lines = [
        f"double {name}_of(double a, double b) {{ (void)b; return {call}; }}" for name, call in calls.items()
    ]
    helpers, functions = with_helpers(CBody(lines, set(written)))
    (tmp_path / "operators.c").write_text("\n".join(["#include <math.h>", *helpers, *functions, ""]), "utf-8")
    options = [
        "-std=c99",
        "-shared",
        "-fPIC",
        str(tmp_path / "operators.c"),
        "-o",
        str(tmp_path / "operators.so"),
    ]
    subprocess.run([str(COMPILER), *options, "-lm"], check=True)
    library = ctypes.CDLL(str(tmp_path / "operators.so"))
    for name, operator in written.items():
        function = getattr(library, f"{name}_of")
        function.argtypes, function.restype = [ctypes.c_double] * 2, ctypes.c_double
        found = [function(*operands) for operands in OPERANDS]
        expected = [operator.value(*operands[: operator.symbol.count("{}")]) for operands in OPERANDS]
        assert found == pytest.approx(expected, rel=1e-14), name
