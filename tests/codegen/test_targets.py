"""C++ classes, JAX functions and CUDA kernels: run, they give what the kernels give."""

import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from obseq.codegen.c99 import cpp, cuda
from obseq.codegen.compiler import derive
from obseq.codegen.jax_text import FROM_JAX, HELPERS, jax
from obseq.codegen.main import main
from obseq.codegen.modules import module_name
from obseq.codegen.operators import OPERATORS
from obseq.formulas import formula
from obseq.kernels import Calculator, calculator, derivatives

SAMPLE = [
    "Dist3D",
    "TopoHz",
    "TopoDH",
    "TopoSubFrame",
    "Dir_FE_EquiDist",
    "Dir_FE_EquiSolid",
    "Dir_StereroGraphik",
    "EqLidarImCensus",
    "EqColinearityCamPPC_Stenope_Dist_Rad3_Dec1_XY1",
]
FEW = ("TopoHz", "Dir_FE_EquiDist", "EqLidarImCensus")
"""Those that are compiled: a compiler takes seconds."""

COMPILER = shutil.which("g++")
NVCC = shutil.which("nvcc")
ROWS = 20
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C++ compiler (g++) on this machine")


def drawn(name: str) -> tuple[Calculator, np.ndarray, np.ndarray]:
    ours = calculator(name)
    return ours, *derivatives.draw(ours.kernel, ROWS, np.random.default_rng(3))


def check(name: str, residuals: np.ndarray, jacobian: np.ndarray) -> None:
    """Compares (n, m) residuals and (n, m, k) derivatives with those of the kernel."""
    ours, unknowns, observations = drawn(name)
    values, entries = ours.values_and_jacobian(unknowns, observations)
    size = 1.0 + np.abs(unknowns).max(initial=0.0) + np.abs(observations).max(initial=0.0)
    np.testing.assert_allclose(residuals, values, rtol=1e-12, atol=1e-14 * size)
    np.testing.assert_allclose(jacobian, entries, rtol=1e-9, atol=1e-12 * np.abs(entries).max(initial=1.0))


def run(folder: Path, source: str, *arrays: np.ndarray) -> np.ndarray:
    """The numbers that a C++ program prints which reads some."""
    (folder / "main.cpp").write_text(source, "utf-8")
    options = ["-std=c++17", "-O0", "-Wall", "-Wextra", "-Werror", "-Wno-unused", "-Wno-unused-parameter"]
    subprocess.run([str(COMPILER), *options, "main.cpp", "-o", "run"], cwd=folder, check=True)
    given = " ".join(f"{value!r}" for array in arrays for value in np.ravel(array).tolist())
    done = subprocess.run([folder / "run"], input=given, capture_output=True, text=True, check=True)
    return np.array(done.stdout.split(), float)


CALLS = """#include "it.h"
#include <cstdio>
#include <iostream>
int main()
{{
    typedef c{name}VDer Calculator;
    Calculator calculator({rows});
    std::vector<double> unknowns(Calculator::NbUk()), observations(Calculator::NbObs());
    for (int k = 0; k < {rows}; k++) {{
        for (double &value : unknowns) std::cin >> value;
        for (double &value : observations) std::cin >> value;
        calculator.PushNewEvals(unknowns, observations);
    }}
    bool full = false;
    try {{ calculator.PushNewEvals(unknowns, observations); }}
    catch (const std::length_error &) {{ full = true; }}
    calculator.EvalAndClear();
    if (!full || calculator.NbInBuf() || Calculator::Name() != "{name}VDer") return 1;
    for (int k = 0; k < {rows}; k++)
        for (std::size_t e = 0; e < Calculator::NbElem(); e++) {{
            std::printf("%.17g ", calculator.ValComp(k, e));
            for (std::size_t v = 0; v < Calculator::NbUk(); v++)
                std::printf("%.17g ", calculator.DerComp(k, e, v));
        }}
    if (calculator.DoOneEval(unknowns, observations)[0] != calculator.ValComp(0, 0)) return 2;
    return Calculator::NamesUk().size() == Calculator::NbUk() ? 0 : 3;
}}
"""


@needs_compiler
@pytest.mark.slow  # compilers
@pytest.mark.parametrize("name", FEW)
def test_the_class_is_called_as_the_originals(name: str, tmp_path: Path) -> None:
    ours, unknowns, observations = drawn(name)
    (tmp_path / "it.h").write_text(cpp(derive(formula(name))), "utf-8")
    lines = run(tmp_path, CALLS.format(name=name, rows=ROWS), np.hstack([unknowns, observations]))
    table = lines.reshape(ROWS, len(ours.residuals), 1 + len(ours.unknowns))
    check(name, table[:, :, 0], table[:, :, 1:])


PLAYED = """#include <cmath>
#include <cstdio>
#include <iostream>
#include <vector>
#define __global__
#define __device__
struct { int x; } blockIdx, blockDim, threadIdx;
static double nan_of(const char *) { return NAN; }
#undef NAN
#define nan nan_of
using namespace std;
"""
PLAYED_MAIN = """
int main()
{{
    const long long n = {rows};
    vector<double> u({unknowns} * n), o({observations} * n + 1), r({residuals} * n), j({entries} * n);
    for (int k = 0; k < {unknowns} * n; k++) cin >> u[k];
    for (int k = 0; k < {observations} * n; k++) cin >> o[k];
    blockDim.x = 7;
    for (blockIdx.x = 0; blockIdx.x < 4; blockIdx.x++)
        for (threadIdx.x = 0; threadIdx.x < 7; threadIdx.x++)
            obseq_{function}(u.data(), o.data(), r.data(), j.data(), n);
    for (double value : r) printf("%.17g ", value);
    for (double value : j) printf("%.17g ", value);
}}
"""


@needs_compiler
@pytest.mark.slow  # compilers
@pytest.mark.parametrize("name", FEW)
def test_the_cuda_text_played_thread_by_thread(name: str, tmp_path: Path) -> None:
    ours, unknowns, observations = drawn(name)
    n, m = len(ours.unknowns), len(ours.residuals)
    sizes = {"unknowns": n, "observations": len(ours.observations), "residuals": m, "entries": n * m}
    text = (
        PLAYED
        + cuda(derive(formula(name)))
        + PLAYED_MAIN.format(rows=ROWS, function=module_name(name), **sizes)
    )
    found = run(tmp_path, text, unknowns.T, observations.T)
    residuals, jacobian = found[: m * ROWS], found[m * ROWS :]
    check(name, residuals.reshape(m, ROWS).T, jacobian.reshape(m, n, ROWS).transpose(2, 0, 1))


@pytest.mark.skipif(NVCC is None, reason="no CUDA compiler (nvcc) on this machine")
@pytest.mark.slow  # nvcc takes seconds
def test_nvcc_takes_the_text(tmp_path: Path) -> None:
    text = "".join(cuda(derive(formula(name))) for name in FEW)
    (tmp_path / "all.cu").write_text(text, "utf-8")
    subprocess.run([str(NVCC), "-ptx", "all.cu", "-o", "all.ptx"], cwd=tmp_path, check=True)
    assert (tmp_path / "all.ptx").read_text("utf-8").count(".entry obseq_") == 3


def loaded(name: str, folder: Path) -> ModuleType:
    path = folder / f"{module_name(name)}.py"
    path.write_text(jax(derive(formula(name))), "utf-8")
    spec = importlib.util.spec_from_file_location(f"jax_text_{module_name(name)}", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", SAMPLE)
def test_the_jax_function_with_numpy_in_the_place_of_jax(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "jax", ModuleType("jax"))
    monkeypatch.setitem(sys.modules, "jax.numpy", np)
    monkeypatch.setattr(sys.modules["jax"], "numpy", np, raising=False)
    function = getattr(loaded(name, tmp_path), module_name(name))
    _, unknowns, observations = drawn(name)
    with np.errstate(all="ignore"):
        pairs = [function(u, o) for u, o in zip(unknowns, observations, strict=True)]
    check(name, *(np.array(part) for part in zip(*pairs, strict=True)))


@pytest.mark.slow  # jax compiles
@pytest.mark.parametrize("name", SAMPLE)
def test_the_jax_function(name: str, tmp_path: Path) -> None:
    there = pytest.importorskip("jax", reason="jax is not installed (the extra `jax`)")
    there.config.update("jax_enable_x64", True)
    function = getattr(loaded(name, tmp_path), module_name(name))
    _, unknowns, observations = drawn(name)
    residuals, jacobian = there.jit(there.vmap(function))(unknowns, observations)
    check(name, np.asarray(residuals), np.asarray(jacobian))


def test_every_operator_has_a_jax_text() -> None:
    functions = {name for name, operator in OPERATORS.items() if operator.function}
    assert functions == FROM_JAX.keys() | HELPERS.keys()


@pytest.mark.parametrize(
    ("option", "file"), [("cpp", "CodeGen_cTopoHzVDer.h"), ("jax", "topo_hz.py"), ("cuda", "topo_hz.cu")]
)
def test_gencode_writes_them(option: str, file: str, tmp_path: Path, capsys) -> None:
    assert main(["TopoHz", f"--{option}", str(tmp_path / "out")]) == 0
    text = (tmp_path / "out" / file).read_text("utf-8")
    assert f"gencode --{option}" in text and "wrote 1 " in capsys.readouterr().out
