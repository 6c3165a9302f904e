"""Whether kernels are vectorised: judged when a kernel is compiled for a test, whichever it is, and kept."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import pytest

from obseq.compilation import cache, numba_compiler
from obseq.compilation.digests import Function
from obseq.compilation.signatures import Signature

SCALAR = re.compile(
    r"= (?:tail )?(?:f(?:add|sub|mul|div|neg|rem) [^<\n]*\bdouble\b|load double|call [^<\n]*\bdouble @)"
)
PACKED = re.compile(r"= f\w+ [^\n]*<\d+ x double>")

RULES = f"{SCALAR.pattern} {PACKED.pattern}"


def is_vectorised(kernel: Function, code: str) -> bool:
    """Whether LLVM's text of a kernel does all its arithmetic on vectors, if it does any."""
    values, everything = kernel.python.__globals__["OPERATIONS"]
    computes = values if kernel.name == "value" else everything
    return not SCALAR.search(code) and (not computes or PACKED.search(code) is not None)


@dataclass(frozen=True)
class Verdicts:
    """Kernels found vectorised by some rules, as these versions compile them for this processor."""

    kept: Any
    rules: str = RULES

    def __contains__(self, symbol: str) -> bool:
        return self.kept is not None and self.kept.get(self._place(symbol), "") == self.rules

    def add(self, symbol: str) -> None:
        if self.kept is not None:
            self.kept.set(self._place(symbol), self.rules)

    def _place(self, symbol: str) -> str:
        return f"obseq/vectorised/{cache.folder().name}/{symbol}"


@contextmanager
def judging(config: pytest.Config) -> Iterator[None]:
    """Inside, kernels of formulas that tests make numba compile are judged on the way."""
    usual, verdicts = numba_compiler.optimised, Verdicts(getattr(config, "cache", None))

    def optimised(function: Function, signature: Signature, symbol: str, machine: Any) -> Any:
        module = usual(function, signature, symbol, machine)
        is_formula = numba_compiler.is_kernel(signature) and "OPERATIONS" in function.python.__globals__
        if is_formula and is_vectorised(function, str(module)):
            verdicts.add(symbol)
        return module

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(numba_compiler, "optimised", optimised)
        yield
