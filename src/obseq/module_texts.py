"""What generated modules say of themselves: hashes of their mathematics and of their text; their sources."""

import hashlib
import importlib.util
import re
from collections.abc import Iterable
from pathlib import Path

HASHES = re.compile(r"formula sha256:(\w+)  text sha256:(\w+)")
PENDING = "pending"
"""What stands for the hash of a text in the text that is hashed."""
DIGITS = 16
OWN = "obseq"
GROUP = "obseq.formulas"
"""Entry points by which other packages say that they have formulas."""


def text_hash(text: str) -> str:
    """Hash of a module's text, whatever its own text hash says."""
    blank = re.sub(r"text sha256:\w+", f"text sha256:{PENDING}", text, count=1)
    return hashlib.sha256(blank.encode()).hexdigest()[:DIGITS]


def formula_hash(text: str) -> str:
    """The hash of the mathematics that a module was made from; empty when it says none."""
    found = HASHES.search(text)
    return found.group(1) if found else ""


def is_whole(text: str) -> bool:
    """Whether the text of a module is the one that its own hash says."""
    found = HASHES.search(text)
    return found is not None and found.group(2) == text_hash(text)


def sources_hash(files: Iterable[Path]) -> str:
    """Hash of the files of equations."""
    digest = hashlib.sha256()
    for path in files:
        digest.update(path.name.encode() + b"\0" + path.read_bytes().replace(b"\r\n", b"\n") + b"\0")
    return digest.hexdigest()[:DIGITS]


def formula_files(package: str) -> list[Path]:
    """The files of the equations of a package; none where they are not at hand."""
    try:
        spec = importlib.util.find_spec(f"{package}.formulas")
    except ImportError:
        return []
    if spec is None or spec.origin is None:
        return []
    origin = Path(spec.origin)
    return sorted(origin.parent.glob("*.py")) if spec.submodule_search_locations else [origin]
