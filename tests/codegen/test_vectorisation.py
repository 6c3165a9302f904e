"""The lane loops of kernels are vectorised: packed operations, no scalar floating-point arithmetic.

The optimised code is read as LLVM has it; for a few kernels, as machine code. Those are judged in each run,
the others where their code, the compiler or the rules have changed since `tests/vectorised.py` wrote down
what it saw.
"""

import re
from typing import Any

import pytest
from families import of_each
from llvmlite import binding
from vectorised import PACKED, SCALAR, Verdicts, is_vectorised

from obseq.compilation import cache, host, numba_compiler
from obseq.compilation.digests import Function
from obseq.compilation.routines import Routine
from obseq.compilation.signatures import KERNEL, Signature
from obseq.formulas import REGISTRY, Formula
from obseq.kernels import load, ondemand
from obseq.kernels.loading import routine

NO_AVX2 = not binding.get_host_cpu_features().get("avx2")
pytestmark = pytest.mark.skipif(NO_AVX2, reason="asserted of processors with AVX2")

KERNELS = ("value", "value_and_jacobian")

SCALAR_MACHINE = re.compile(r"\bv?(?:add|sub|mul|div|sqrt|fn?m(?:add|sub)\d{3})sd\b")
PACKED_MACHINE = re.compile(r"\bv?(?:add|sub|mul|div|sqrt|fn?m(?:add|sub)\d{3})pd\b")


def _module(kernel: Routine) -> Any:
    """LLVM's module of a kernel for this processor, compiled afresh."""
    machine = host.machine(kernel.signature.wide)
    module = numba_compiler.optimised(kernel.function, kernel.signature, kernel.symbol, machine)
    if cache.read(kernel.symbol) is None:
        cache.write(kernel.symbol, bytes(machine.emit_object(module)))
    return module


@pytest.fixture(scope="module")
def verdicts() -> Verdicts:
    return Verdicts()


def _along(name: str) -> Routine:
    """A kernel along a direction, which is made on demand."""
    module = ondemand.find(name)
    assert module is not None
    return routine(module, "directional")


@of_each()
def test_kernels_are_vectorised(formula: Formula, verdicts: Verdicts) -> None:
    name, module = formula.name, load(formula.name).module
    for function in KERNELS:
        kernel = routine(module, function)
        if kernel.symbol in verdicts:
            continue
        code = str(_module(kernel))
        scalar = SCALAR.findall(code)
        assert not scalar, f"{name}.{function}: {len(scalar)} scalar operations, such as {scalar[0]}"
        assert is_vectorised(kernel.function, code), f"{name}.{function}: no packed operation"
        verdicts.add(kernel.symbol)


@pytest.mark.parametrize(
    "name", ["Dist3D", "TopoHz", "TopoDH", "Dir_Stenope", "BlocRigid_RE", "EqLidarImCensus"]
)
def test_kernels_along_a_direction_are_vectorised(name: str, verdicts: Verdicts) -> None:
    kernel = _along(name)
    if kernel.symbol not in verdicts:
        code = str(_module(kernel))
        assert not SCALAR.findall(code)
        assert PACKED.search(code)
        verdicts.add(kernel.symbol)


@of_each(REGISTRY[::16])
def test_more_kernels_along_a_direction_are_vectorised(formula: Formula, verdicts: Verdicts) -> None:
    kernel = _along(formula.name)
    if kernel.symbol not in verdicts:
        assert not SCALAR.findall(str(_module(kernel)))
        verdicts.add(kernel.symbol)


@pytest.mark.parametrize("name", ["Dist3D", "Dir_Stenope", "TopoHz"])
def test_machine_code_is_vectorised(name: str) -> None:
    """The last step too: what the processor runs."""
    for function in KERNELS:
        code = _assembly(routine(load(name).module, function))
        assert not SCALAR_MACHINE.findall(code)
        assert PACKED_MACHINE.search(code)


def _assembly(kernel: Routine) -> str:
    return str(host.machine(kernel.signature.wide).emit_assembly(_module(kernel)))


@pytest.mark.parametrize(
    ("level", "wide", "there"), [("v3", True, False), ("v4", True, True), ("v4", False, False)]
)
def test_the_widest_vectors_are_for_processors_that_have_them(level: str, wide: bool, there: bool) -> None:
    kernel = routine(load("Dist3D").module, "value")
    machine = host.other_machine(f"x86-64-{level}", wide)
    module = numba_compiler.optimised(kernel.function, kernel.signature, kernel.symbol, machine)
    assert ("zmm" in str(machine.emit_assembly(module))) is there


def test_code_of_another_width_has_another_name() -> None:
    """What was compiled before kernels were wide is never taken for what they are now."""
    function = routine(load("Dist3D").module, "value").function
    narrow = Signature(KERNEL.arguments, KERNEL.result)
    assert Routine(function, KERNEL).symbol != Routine(function, narrow).symbol


def test_the_check_sees_a_loop_that_is_not_vectorised() -> None:
    def chained(tiles, n_tiles):  # type: ignore[no-untyped-def]
        for k in range(1, n_tiles):
            tiles[k] = tiles[k] + tiles[k - 1] * tiles[k]

    kernel = Routine(Function(chained), KERNEL)
    assert SCALAR.search(str(_module(kernel)))
    assert SCALAR_MACHINE.search(_assembly(kernel))
