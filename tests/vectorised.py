"""Whether kernels are vectorised: judged when they change, and written down by what their code depends on.

A kernel that was found vectorised stays so until its text, the compiler, the kind of processor or the rules
change. So the suite judges what `codegen/vectorised.txt` does not have. Write it anew after kernels changed:

    python tests/vectorised.py
"""

import hashlib
import re
import sys
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import version
from pathlib import Path

from obseq.compilation import host
from obseq.compilation.digests import Function

SCALAR = re.compile(
    r"= (?:tail )?(?:f(?:add|sub|mul|div|neg|rem) [^<\n]*\bdouble\b|load double|call [^<\n]*\bdouble @)"
)
PACKED = re.compile(r"= f\w+ [^\n]*<\d+ x double>")

RULES = f"{SCALAR.pattern} {PACKED.pattern}"
RECORD = Path(__file__).with_name("codegen") / "vectorised.txt"
DIGITS = 16


def is_vectorised(kernel: Function, code: str) -> bool:
    """Whether LLVM's text of a kernel does all its arithmetic on vectors, if it does any."""
    values, everything = kernel.python.__globals__["OPERATIONS"]
    computes = values if kernel.name == "value" else everything
    return not SCALAR.search(code) and (not computes or PACKED.search(code) is not None)


def state() -> str:
    """What compiles here, and for which kind of processor."""
    return " ".join([*(f"{name} {version(name)}" for name in ("numba", "llvmlite")), host.description()])


@cache
def recorded() -> frozenset[str]:
    """What was found vectorised by these versions for this kind of processor."""
    first, *digests = RECORD.read_text("utf-8").splitlines() if RECORD.is_file() else ("",)
    return frozenset(digests if first == state() else ())


SEEN: set[str] = set()
"""What this process has found vectorised, or written down as that."""


@dataclass(frozen=True)
class Verdicts:
    """Symbols of machine code found vectorised by some rules."""

    rules: str = RULES
    known: frozenset[str] = field(default_factory=recorded)

    def __contains__(self, symbol: str) -> bool:
        is_known = self._digest(symbol) in self.known
        if is_known:
            self.add(symbol)
        return is_known

    def add(self, symbol: str) -> None:
        SEEN.add(self._digest(symbol))

    def _digest(self, symbol: str) -> str:
        return hashlib.sha256(f"{symbol} {self.rules}".encode()).hexdigest()[:DIGITS]


def main() -> int:
    """Judges what is new, and writes down all that is found vectorised now."""
    import pytest
    import vectorised  # the module that the tests see

    tests = [RECORD.parent / "test_vectorisation.py", RECORD.parents[1] / "kernels" / "test_functions.py"]
    code = pytest.main(["-q", "-k", "vectorised", *map(str, tests)])
    if code == 0:
        RECORD.write_text("\n".join([state(), *sorted(vectorised.SEEN)]) + "\n", encoding="utf-8")
    return int(code)


if __name__ == "__main__":
    sys.exit(main())
