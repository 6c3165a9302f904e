"""The short way through numba gives the machine code of the whole one."""

import gc
import re
from contextlib import nullcontext

import pytest
from unchanged import Seen, compiled

from obseq.compilation import front_end, host, numba_compiler, objects
from obseq.compilation.routines import Routine
from obseq.kernels import load
from obseq.kernels.loading import routine
from obseq.leastsquares.loops.shares import add_copies
from obseq.leastsquares.solvers.dense_loops import factor_columns


def machine_code(made: Routine) -> str:
    """What the processor runs, without the names that numba numbers."""
    machine = host.machine()
    module = numba_compiler.optimised(made.function, made.signature, made.symbol, machine)
    return re.sub(r"_ZN\w+", "callee", str(machine.emit_assembly(module)))


@pytest.mark.parametrize(
    "made",
    [routine(load("TopoZen").module, "value_and_jacobian"), factor_columns.routine, add_copies.routine],  # type: ignore[attr-defined]
    ids=["kernel", "factor", "copies"],
)
def test_what_is_left_out_changes_nothing(made: Routine, monkeypatch: pytest.MonkeyPatch, seen: Seen) -> None:
    state = compiled(made.symbol, __file__)
    if seen.has(name := f"short way/{made.symbol}", state):
        return
    short = machine_code(made)
    for passes in ("LEFT_OUT", "LEFT_OUT_OF_KERNELS"):
        monkeypatch.setattr(front_end, passes, frozenset())
    monkeypatch.setattr(front_end, "hurrying", nullcontext)
    numba_compiler.dispatcher.cache_clear()
    assert machine_code(made) == short
    seen.add(name, state)


@pytest.mark.skipif(not objects.levels_here(), reason="no objects can be made for this processor")
def test_what_is_compiled_here_is_what_a_library_has(seen: Seen) -> None:
    """Vectors of the same width, sums in the same order: results are the same to the last digit."""
    made = routine(load("Dist3D").module, "value")
    state = compiled(made.symbol, __file__)
    if seen.has(name := f"as in a library/{made.symbol}", state):
        return
    here, there = (
        str(numba_compiler.optimised(made.function, made.signature, made.symbol, machine))
        for machine in (host.machine(), host.other_machine(objects.levels_here()[0]))
    )
    assert re.sub(r"_ZN\w+", "callee", here) == re.sub(r"_ZN\w+", "callee", there)
    seen.add(name, state)


def test_every_pass_left_out_exists() -> None:
    """Numba's names: one that is gone, or renamed, would be done again unseen."""
    from numba.core import typed_passes, untyped_passes

    known = {*vars(typed_passes), *vars(untyped_passes)}
    assert known >= front_end.LEFT_OUT | front_end.LEFT_OUT_OF_KERNELS


def test_nothing_stays_of_the_shortcuts() -> None:
    usual = [getattr(owner, name) for owner, name, _ in front_end._shortcuts()]
    with front_end.hurrying():
        hurried = [getattr(owner, name) for owner, name, _ in front_end._shortcuts()]
        assert not gc.isenabled()
    assert gc.isenabled()
    assert [getattr(owner, name) for owner, name, _ in front_end._shortcuts()] == usual
    assert not any(one is other for one, other in zip(hurried, usual, strict=True))


def test_what_another_release_of_numba_does_not_have_is_left_to_it(monkeypatch: pytest.MonkeyPatch) -> None:
    from numba.core import lowering, typeinfer

    for owner in (lowering, typeinfer):
        monkeypatch.delattr(owner, "new_error_context")
    with front_end.hurrying():
        assert not hasattr(lowering, "new_error_context")
    assert not hasattr(typeinfer, "new_error_context")
