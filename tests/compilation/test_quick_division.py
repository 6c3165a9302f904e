"""Refined divisions and roots: the processor's own results, special values too, and only where loops wait."""

import math

import numpy as np
import pytest
from llvmlite import binding
from unchanged import Seen, compiled

from obseq.compilation import host, numba_compiler
from obseq.compilation.digests import CONTRACT, Function
from obseq.compilation.quick_division import quickened
from obseq.compilation.routines import Routine
from obseq.compilation.signatures import KERNEL
from obseq.kernels import load
from obseq.kernels.layout import LANES, STRIDE
from obseq.kernels.loading import routine
from obseq.kernels.tiles import aligned_tiles, call_kernel

X86 = binding.get_process_triple().startswith("x86_64")
ROWS = 5
EDGES = np.array([0.0, 1.0, 2.0, 3.0, 0.1, 4.0, 1e300, 1e-300, 1.5e308, 2.3e-308, math.nan])
SIGNED = np.concatenate([EDGES, -EDGES, [math.inf, -math.inf]])


def _divisions(tiles, n_tiles):  # type: ignore[no-untyped-def]
    for k in range(n_tiles):
        tile = k * ROWS * STRIDE
        for lane in range(LANES):
            a = tiles[tile + lane]
            b = tiles[tile + STRIDE + lane]
            tiles[tile + 2 * STRIDE + lane] = 1.0 / b
            tiles[tile + 3 * STRIDE + lane] = a / b
            tiles[tile + 4 * STRIDE + lane] = math.sqrt(b)


def _computed(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, ...]:
    """Reciprocals, quotients and roots of many numbers by the compiled loop."""
    n_tiles = -(-len(a) // LANES)
    tiles = aligned_tiles(ROWS, n_tiles)
    rows = tiles.reshape(n_tiles, ROWS, STRIDE)
    for row, numbers in enumerate((a, b)):
        rows[:, row, :LANES] = np.resize(numbers, (n_tiles, LANES))
    call_kernel(Routine(Function(_divisions, CONTRACT), KERNEL).address, tiles, n_tiles)
    return tuple(rows[:, row, :LANES].ravel()[: len(a)] for row in range(2, ROWS))


def _exact(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, ...]:
    with np.errstate(all="ignore"):
        return 1.0 / b, a / b, np.sqrt(b)


def test_results_are_those_of_the_processor_to_the_last_bit() -> None:
    random = np.random.default_rng(3)
    a, b = (np.exp(random.uniform(-300, 300, 100_000)) for _ in range(2))
    for computed, exact in zip(_computed(a, b), _exact(a, b), strict=True):
        difference = np.abs(computed - exact) / np.spacing(exact)
        assert difference.max() <= 1.0
        assert np.count_nonzero(difference) <= 1_000


def test_special_values_are_what_they_are_elsewhere() -> None:
    a, b = (values.ravel() for values in np.meshgrid(SIGNED, SIGNED))
    reciprocals, quotients, roots = _computed(a, b)
    expected = _exact(a, b)
    finite = np.isfinite(b)  # the root of infinity is not a number
    np.testing.assert_array_equal(reciprocals, expected[0])
    np.testing.assert_array_equal(roots[finite], expected[2][finite])
    assert not np.isfinite(roots[~finite]).any()
    normal = ~((np.abs(expected[1]) < 2.3e-308) & (expected[1] != 0.0))  # subnormal quotients lose digits
    np.testing.assert_array_equal(quotients[normal], expected[1][normal])


def _assembly(kernel: Routine, level: str) -> str:
    machine = host.other_machine(f"x86-64-{level}", wide=True)
    return str(
        machine.emit_assembly(
            numba_compiler.optimised(kernel.function, kernel.signature, kernel.symbol, machine)
        )
    )


@pytest.mark.skipif(not X86, reason="asserted of x86-64")
@pytest.mark.parametrize(("name", "level", "waits"), [("Dist3D", "v4", True), ("Dist3D", "v3", False)])
def test_loops_of_divisions_alone_refine_where_vectors_are_wide(
    name: str, level: str, waits: bool, seen: Seen
) -> None:
    kernel = routine(load(name).module, "value_and_jacobian")
    state = compiled(kernel.symbol, __file__)
    if seen.has(place := f"divisions/{kernel.symbol}-{level}", state):
        return
    code = _assembly(kernel, level)
    assert ("vrsqrt14pd" in code) is waits
    assert ("vdivpd" in code or "vsqrtpd" in code) is not waits
    seen.add(place, state)


@pytest.mark.skipif(not X86, reason="asserted of x86-64")
def test_loops_with_enough_else_to_do_divide(seen: Seen) -> None:
    kernel = routine(load("TopoHz").module, "value_and_jacobian")
    state = compiled(kernel.symbol, __file__)
    if seen.has(place := f"divisions/{kernel.symbol}-v4", state):
        return
    code = _assembly(kernel, "v4")
    assert "vdivpd" in code
    assert "rcp14" not in code
    seen.add(place, state)


@pytest.mark.parametrize(("others", "is_changed"), [(10, True), (11, False)], ids=["waits", "has else to do"])
def test_a_block_is_judged_by_itself(others: int, is_changed: bool) -> None:
    """One division, 16 cycles, for ten other operations, or eleven; what other blocks do does not count."""
    sums = "".join(f"  %s{k} = fadd contract <8 x double> %a, %a\n" for k in range(others))
    text = f"first:\n{sums}  %q = fdiv contract <8 x double> %a, %b\n  br label %last\nlast:\n{sums * 9}"
    assert (quickened(text) is not None) is is_changed
