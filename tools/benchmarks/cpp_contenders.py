"""The C++ contenders of the kernel bench: the rival's text, and the same loop printed from our graph."""

import ctypes
import hashlib
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from interleaved import Repeat
from numpy.typing import NDArray
from rival import Rival
from rival_inventory import Inventory, Node

from obseq.codegen.c99 import statements, with_helpers
from obseq.codegen.compiler import Derived
from obseq.formulas.base import Formula

Array = NDArray[np.float64]

COMPILER = shutil.which("g++") or ""
OPTIONS = ("-O3", "-march=native", "-std=c++17", "-shared", "-fPIC")

BUFFER = 256
"""Evaluations that the rival's buffer holds."""

FUNCTIONS = (Path(__file__).parent / "rival_functions.h").read_text("utf-8")

CALCULATOR = (Path(__file__).parent / "rival_calculator.h").read_text("utf-8")

LOOP = """
{calculator}
{functions}
namespace {name} {{
struct Loop : Calculator {{
    using Calculator::Calculator;
    void DoEval() override;
}};
void Loop::DoEval() {{
    for (std::size_t aK = 0; aK < this->mNbInBuf; aK++) {{
{lines}
    }}
}}
}}
extern "C" void *{name}_make(long capacity, long n_unknowns, long n_observations, long n_results) {{
    return static_cast<Calculator *>(new {name}::Loop(capacity, n_unknowns, n_observations, n_results));
}}
extern "C" void {name}_push(void *handle, long n, const double *unknowns, const double *observations) {{
    auto *c = static_cast<Calculator *>(handle);
    Vector u, o;
    for (long k = 0; k < n; k++) {{
        u.assign(unknowns + k * c->mNbUk, unknowns + (k + 1) * c->mNbUk);
        o.assign(observations + k * c->mNbObs, observations + (k + 1) * c->mNbObs);
        c->Push(u, o);
    }}
}}
extern "C" void {name}_run(void *handle, long repeats) {{
    for (long k = 0; k < repeats; k++) static_cast<Calculator *>(handle)->DoEval();
}}
extern "C" void {name}_evaluate(void *handle, long repeats, long n, const double *unknowns,
                                const double *observations, double *results) {{
    auto *c = static_cast<Calculator *>(handle);
    const long room = c->mCapacity;
    for (long repeat = 0; repeat < repeats; repeat++) {{
        double *out = results;
        for (long start = 0; start < n; start += room) {{
            {name}_push(handle, n - start < room ? n - start : room, unknowns + start * c->mNbUk,
                        observations + start * c->mNbObs);
            for (const Vector *line : c->EvaluateAndClear())
                out = std::copy(line->begin(), line->end(), out);
        }}
    }}
}}
extern "C" const double *{name}_line(void *handle, long k) {{
    return static_cast<Calculator *>(handle)->mBufLineRes[k].data();
}}
"""


@dataclass(frozen=True)
class CppContender:
    """A compiled loop on given arguments.

    Attributes:
        run: Evaluates all of them the given number of times.
        results: The result lines, (n, n_residuals, 1 + n_unknowns).
    """

    run: Repeat
    results: Array


def build(text: str, folder: Path) -> ctypes.CDLL:
    """The shared library of a C++ text, compiled in a folder if it is not there.

    Raises:
        subprocess.CalledProcessError: The text does not compile.
    """
    stem = hashlib.sha256(" ".join((text, *OPTIONS)).encode()).hexdigest()[:20]
    library = folder / f"{stem}.so"
    if not library.exists():
        source = folder / f"{stem}.cpp"
        source.write_text(text, "utf-8")
        subprocess.run([COMPILER, *OPTIONS, str(source), "-o", str(library)], check=True)
    return ctypes.CDLL(str(library))


def contender(
    library: ctypes.CDLL, name: str, formula: Formula, n_residuals: int, u: Array, o: Array
) -> CppContender:
    """A loop of a library, with its own copy of the arguments."""
    n, width = len(u), n_residuals * (1 + len(formula.unknowns))
    u, o = np.ascontiguousarray(u), np.ascontiguousarray(o)
    push, run, line = (getattr(library, f"{name}_{part}") for part in ("push", "run", "line"))
    push.argtypes = [ctypes.c_void_p, ctypes.c_long] + [ctypes.c_void_p] * 2
    line.restype = ctypes.POINTER(ctypes.c_double)
    run.argtypes = line.argtypes = [ctypes.c_void_p, ctypes.c_long]
    handle = _made(library, name, n, u.shape[1], o.shape[1], width)
    push(handle, n, u.ctypes.data, o.ctypes.data)
    run(handle, 1)
    results = np.array([np.ctypeslib.as_array(line(handle, k), (width,)) for k in range(n)])
    return CppContender(lambda repeats: run(handle, repeats), results.reshape(n, n_residuals, -1))


def filled_and_copied(
    library: ctypes.CDLL, name: str, formula: Formula, n_residuals: int, u: Array, o: Array
) -> Repeat:
    """The same for a loop whose buffer, of `BUFFER` evaluations, is filled and emptied each time."""
    n, width = len(u), n_residuals * (1 + len(formula.unknowns))
    evaluate = getattr(library, f"{name}_evaluate")
    evaluate.argtypes = [ctypes.c_void_p] + [ctypes.c_long] * 2 + [ctypes.c_void_p] * 3
    handle = _made(library, name, min(n, BUFFER), u.shape[1], o.shape[1], width)
    results = np.empty((n, width))

    def run(repeats: int) -> None:
        evaluate(handle, repeats, n, u.ctypes.data, o.ctypes.data, results.ctypes.data)

    return run


def _made(library: ctypes.CDLL, name: str, *sizes: int) -> int:
    """A calculator of a library, of that capacity, unknowns, observations and results; never freed."""
    make = getattr(library, f"{name}_make")
    make.restype, make.argtypes = ctypes.c_void_p, [ctypes.c_long] * 4
    handle: int = make(*sizes)
    return handle


def rival_text(rival: Rival, formula: Formula) -> str:
    """The rival's C++: a line for every formula reached, one operation each."""
    inventory = rival.inventory
    reached = inventory.reached(rival.outputs)
    lines = [
        f"double &{inventory.nodes[f].name} = {_input(inventory.nodes[f], formula)};"
        for f in reached
        if _is_atom(inventory, f)
    ]
    for f in reached:
        if inventory.nodes[f].operator not in ("atom", "constant"):
            lines.append(f"double F{f}_ = {_operation(inventory, f)};")
    lines += [
        f"this->mBufLineRes[aK][{k}] = {_reference(inventory, f)};" for k, f in enumerate(rival.outputs)
    ]
    return _loop("rival", FUNCTIONS, lines)


def _is_atom(inventory: Inventory, f: int) -> bool:
    return inventory.nodes[f].operator == "atom"


def _input(node: Node, formula: Formula) -> str:
    if node.name in formula.unknowns:
        return f"this->mVUk[aK][{formula.unknowns.index(node.name)}]"
    return f"this->mVObs[aK][{formula.observations.index(node.name)}]"


def _reference(inventory: Inventory, f: int) -> str:
    node = inventory.nodes[f]
    if node.operator == "atom":
        return node.name
    return f"({node.value!r})" if node.operator == "constant" else f"F{f}_"


def _operation(inventory: Inventory, f: int) -> str:
    operator, operands, _, _ = inventory.nodes[f]
    texts = [_reference(inventory, operand) for operand in operands]
    if operator in ("+", "-", "*", "/"):
        return f"({texts[0]} {operator} {texts[1]})"
    return f"-({texts[0]})" if operator == "neg" else f"{operator}({', '.join(texts)})"


def graph_text(derived: Derived) -> str:
    """The rival's loop with the statements of our graph."""
    formula = derived.formula
    inputs = {name: f"this->mVUk[aK][{k}]" for k, name in enumerate(formula.unknowns)}
    inputs |= {name: f"this->mVObs[aK][{k}]" for k, name in enumerate(formula.observations)}
    nodes = [
        node
        for residual, row in zip(derived.residuals, derived.jacobian, strict=True)
        for node in (residual, *row)
    ]
    outputs = [(node, f"this->mBufLineRes[aK][{k}]", "") for k, node in enumerate(nodes)]
    helpers, lines = with_helpers(statements(derived, outputs, inputs))
    return _loop("graph", "\n".join(("#include <cmath>", "#include <vector>", *helpers)), lines)


def _loop(name: str, functions: str, lines: Sequence[str]) -> str:
    body = "\n".join(f"        {line}" for line in lines)
    return LOOP.format(name=name, calculator=CALCULATOR, functions=functions, lines=body)
