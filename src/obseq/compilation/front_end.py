"""Numba's way from a function to LLVM's text, without what takes most of its time and gives nothing here.

Operators are numba's slowest part: for each `+` it tries the same templates on the same types again, once for
the types and once for the text. Here an answer is kept. And the passes are left out that look for what
compiled functions never have: closures, contexts, lists unrolled by type, parallel loops.
"""

from __future__ import annotations

import operator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.types.functions import BaseFunction
from numba.core.types.misc import unliteral

if TYPE_CHECKING:
    from collections.abc import Iterator

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
        "AnnotateTypes",
        "DumpParforDiagnostics",
    }
)
"""Names of the passes that have nothing to do."""


class Short(CompilerBase):  # type: ignore[misc]
    """Numba's pipeline without the passes that have nothing to do."""

    def define_pipelines(self) -> list[Value]:
        """The passes, in numba's order."""
        whole = DefaultPassBuilder.define_nopython_pipeline(self.state)
        whole.passes = [each for each in whole.passes if each[0].__name__ not in LEFT_OUT]
        return [whole]


@contextmanager
def remembering_types() -> Iterator[None]:
    """Inside, what a function gives for some types is found out once. For who holds numba's lock."""
    kind: NumbaType = BaseFunction
    usual, kind.get_call_type = kind.get_call_type, _remembering(kind.get_call_type)
    try:
        yield
    finally:
        kind.get_call_type = usual


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
