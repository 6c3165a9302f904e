"""What was seen to hold of modules, machine code and pages, until something changes that it can depend on."""

import hashlib
import sys
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
WHOLE = ("formulas", "codegen", "generated", "docs/formulas", "tests/codegen", "tests/formulas")
BELOW = ("src/obseq/kernels", "src/obseq/compilation")
"""What the generator imports: test_architecture.py sees to it that it imports no other room."""

KINDS = {".py", ".jinja", ".md"}
TOOLS = ("sympy", "mpmath", "jinja2", "numpy", "numba", "llvmlite")


@cache
def digest() -> str:
    """Digest of the equations, the generator, what both stand on, their tests, and what was generated."""
    parts = [sys.version, *(f"{name} {version(name)}" for name in TOOLS)]
    found = hashlib.sha256("\0".join(parts).encode())
    for path in sorted(sources()):
        found.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return found.hexdigest()


def compiled(symbol: str, test: str) -> str:
    """Digest of what the machine code of a symbol depends on, the processor too, and of a test."""
    from obseq.compilation import cache as code  # not where only pages are looked at

    parts = [digest(), code.folder().name, symbol, Path(test).read_text("utf-8")]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


def sources() -> set[Path]:
    """The files that generation, and what is tested of it, can depend on."""
    package = ROOT / "src" / "obseq"
    found = {
        *package.glob("*.py"),
        ROOT / "pyproject.toml",
        Path(__file__),
        Path(__file__).with_name("families.py"),
    }
    for folder in (*WHOLE, *BELOW):
        found |= {path for path in (ROOT / folder).rglob("*") if path.suffix in KINDS}
    return found


@dataclass(frozen=True)
class Seen:
    """What was seen, by name; in pytest's own cache, where there is one.

    Where no other state is given, it is that of these sources and versions.
    """

    kept: Any

    def __contains__(self, name: str) -> bool:
        return self.has(name, digest())

    def has(self, name: str, state: str) -> bool:
        """Whether it was seen when all that it depends on had this digest."""
        return self.kept is not None and self.kept.get(f"obseq/seen/{name}", "") == state

    def add(self, name: str, state: str | None = None) -> None:
        """Keeps what was seen."""
        if self.kept is not None:
            self.kept.set(f"obseq/seen/{name}", state or digest())
