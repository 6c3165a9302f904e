"""Numba's way from a function to LLVM's text, without what takes most of its time and gives nothing here.

Operators are numba's slowest part: for each `+` it tries the same templates on the same types again, once for
the types and once for the text. Here an answer is kept. The passes are left out that look for what compiled
functions never have: closures, contexts, lists unrolled by type, parallel loops, objects to be released; for
kernels, which assign each variable once, also those that tell assignments apart. And what numba says of each
instruction, should it fail, is not said.
"""

from __future__ import annotations

import gc
import operator
from contextlib import ExitStack, contextmanager, nullcontext
from functools import cache
from types import BuiltinFunctionType, NoneType
from typing import TYPE_CHECKING

from numba.core import base, byteflow, interpreter, ir, lowering, typeinfer
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.types.functions import BaseFunction
from numba.core.types.misc import unliteral
from numba.core.typing.context import BaseContext as TypingContext
from numba.np import arrayobj, linalg

from obseq.compilation.array_values import of_values

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from obseq.compilation.emission import Context, NumbaType, Value

ARITHMETIC = frozenset({operator.add, operator.sub, operator.mul, operator.truediv, operator.neg})
"""Operators whose results have the same type for a literal number as for any of its type."""

LEFT_OUT = frozenset(
    {
        "WithLifting",
        "InlineClosureLikes",
        "RewriteSemanticConstants",
        "DeadBranchPrune",
        "RewriteDynamicRaises",
        "MakeFunctionToJitFunction",
        "InlineInlinables",
        "FindLiterallyCalls",
        "LiteralUnroll",
        "LiteralPropagationSubPipelinePass",
        "InlineOverloads",
        "NopythonRewrites",
        "NoPythonSupportedFeatureValidation",
        "IRLegalization",
        "AnnotateTypes",
        "DumpParforDiagnostics",
    }
)
"""Names of the passes that have nothing to do."""


LEFT_OUT_OF_KERNELS = frozenset({"GenericRewrites", "ReconstructSSA", "PreLowerStripPhis"})
"""Names of those that have nothing to do where variables are assigned once and no index is constant."""

WITHOUT_VARIABLES = frozenset({ir.Loc, str, int, float, bool, NoneType, BuiltinFunctionType})
"""Types of most of what an instruction consists of."""


class Short(CompilerBase):  # type: ignore[misc]
    """Numba's pipeline without the passes that have nothing to do."""

    def define_pipelines(self) -> list[Value]:
        """The passes, in numba's order."""
        whole = DefaultPassBuilder.define_nopython_pipeline(self.state)
        whole.passes = [each for each in whole.passes if each[0].__name__ not in self._left_out()]
        return [whole]

    def _left_out(self) -> frozenset[str]:
        return LEFT_OUT


class ShortForKernels(Short):
    """The same for kernels."""

    def _left_out(self) -> frozenset[str]:
        return LEFT_OUT | LEFT_OUT_OF_KERNELS


@contextmanager
def hurrying() -> Iterator[None]:
    """Inside, numba takes shortcuts to the same results. For who holds its lock.

    Python does not look for garbage meanwhile: what numba makes is needed until it is done. Another release
    of numba goes its own way where it does not have what is replaced here.
    """
    with ExitStack() as usual:
        if gc.isenabled():
            usual.callback(gc.enable)
            gc.disable()
        for owner, name, shortened in _shortcuts():
            if hasattr(owner, name):
                usual.callback(setattr, owner, name, getattr(owner, name))
                setattr(owner, name, shortened(getattr(owner, name)))
        yield


def _shortcuts() -> list[tuple[Value, str, Callable[[Value], Value]]]:
    """Whose method or function is replaced, its name, and what by, from itself."""
    silent = nullcontext()
    return [
        (BaseFunction, "get_call_type", _remembering),
        (TypingContext, "refresh", _once_for_each),
        (base.BaseContext, "refresh", _once_for_each),
        (base.BaseContext, "get_abi_sizeof", _by_text),
        (arrayobj, "make_array", of_values),
        (base, "_has_loc", cache),
        (ir.Inst, "_rec_list_vars", lambda _: _variables),
        (ir.Assign, "__str__", lambda _: object.__repr__),  # asked for each time, for a message nobody sees
        (lowering, "_lit_or_omitted", _unless_undefined),
        (byteflow.Flow, "_run_handle_exception", lambda _: _next_instruction),
        (
            linalg,
            "ensure_blas",
            lambda _: lambda: None,
        ),  # an import of SciPy, for matrix products
        (lowering, "new_error_context", lambda _: lambda *_, **__: silent),
        (typeinfer, "new_error_context", lambda _: lambda *_, **__: silent),
        (interpreter, "peep_hole_delete_with_exit", lambda _: lambda text: text),
    ]


def _variables(instruction: Value, value: Value) -> list[Value]:
    """Variables in what an instruction consists of."""
    if isinstance(value, ir.Var):
        return [value]
    if isinstance(value, ir.Inst):
        return list(value.list_vars())
    if isinstance(value, dict):
        value = value.values()
    elif not isinstance(value, list | tuple):
        return []
    found: list[Value] = []
    for part in value:
        if type(part) is ir.Var:
            found.append(part)
        elif type(part) not in WITHOUT_VARIABLES:
            found += _variables(instruction, part)
    return found


def _once_for_each(refresh: Value) -> Value:
    """Looks for what has been registered when a compilation begins, not again for each part of it."""
    return cache(refresh)


def _by_text(size_of: Value) -> Value:
    """Sizes of LLVM's types: each is otherwise found by parsing a module that has one of them."""
    found: dict[str, int] = {}

    def get_abi_sizeof(context: Context, kind: Value) -> int:
        text = str(kind)
        if text not in found:
            found[text] = size_of(context, kind)
        return found[text]

    return get_abi_sizeof


def _unless_undefined(usual: Value) -> Value:
    """The type of a constant operand; that of one that is not constant, which most are, is made once."""
    undefined = usual(ir.UNDEFINED)
    return lambda value: undefined if value is ir.UNDEFINED else usual(value)


def _next_instruction(flow: Value, runner: Value, state: Value) -> None:
    """What follows an instruction of a function that catches nothing."""
    state.advance_pc()


def _remembering(find: Value) -> Value:
    found: dict[tuple[NumbaType, ...], NumbaType] = {}

    def get_call_type(
        function: NumbaType, context: Context, arguments: NumbaType, named: NumbaType
    ) -> NumbaType:
        if named:
            return find(function, context, arguments, named)
        if function.typing_key in ARITHMETIC:
            arguments = tuple([unliteral(argument) for argument in arguments])
        key = (function, *arguments)
        if key not in found:
            found[key] = find(function, context, arguments, named)
        return found[key]

    return get_call_type
