"""Whether a generated module is as old as its formula.

In a checkout, and in other packages, the equations lie beside the modules that were generated from them. The
index of these has a hash of the equations' files. As long as it is the same, nothing can be stale. Where it
is not, the generator says which formulas have changed.
"""

from __future__ import annotations

import functools
import importlib
import importlib.util
import logging
from pathlib import Path

from obseq.kernels import index
from obseq.module_texts import OWN, formula_files, formula_hash, sources_hash
from obseq.packages import GENERATOR, missing

LOGGER = logging.getLogger(__name__)


def checkout() -> Path | None:
    """The root of the project whose modules are in use; None where they are those of an installed package."""
    generated = _folder("obseq.generated")
    root = generated.resolve().parent if generated else None
    return root if root and (root / "pyproject.toml").is_file() else None


def staleness(name: str) -> str:
    """Why the generated kernels of a formula cannot be trusted, in words; empty where they can."""
    place = index.place(name)
    if place is None or not _have_sources_changed(place.package):
        return ""
    if missing(*GENERATOR):
        return (
            f"{name}: the formulas of {place.package} have changed since its kernel was generated, and only "
            'the generator can say whether this one has: pip install "obseq[gencode]", then run gencode'
        )
    try:
        due = importlib.import_module("obseq.codegen.ondemand").formula_hash(name, place.package)
    except Exception as error:  # whatever is wrong in a file that somebody is writing
        return f"{name}: its formula cannot be read ({error}); its kernel is that of an earlier one"
    if due == _recorded(place.module):
        return ""
    return f"{name}: its formula has changed since its kernel was generated; run gencode"


@functools.cache
def tell(name: str) -> None:
    """Says once where the kernels of a formula cannot be trusted."""
    if reason := staleness(name):
        LOGGER.warning("%s", reason)


def _recorded(module: str) -> str:
    """The hash of the mathematics that a module was made from."""
    spec = importlib.util.find_spec(module)
    text = Path(spec.origin).read_text("utf-8") if spec and spec.origin else ""
    return formula_hash(text)


@functools.cache
def _have_sources_changed(package: str) -> bool:
    """Whether files of equations differ from those of the index; those of an installed obseq do not."""
    if package == OWN and checkout() is None:
        return False
    files = formula_files(package)
    return bool(files) and sources_hash(files) != index.index_of(package).SOURCES


def _folder(package: str) -> Path | None:
    spec = importlib.util.find_spec(package)
    places = list(spec.submodule_search_locations or ()) if spec else []
    return Path(places[0]) if places else None
