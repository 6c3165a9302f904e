"""Members of families that are not among the generated modules: built once, kept in a folder of the user.

The folder is `$OBSEQ_CACHE`, or the platform's place for caches. Each version of the equations and of the
generator has its own sub-folder, so that what is found there is current; old ones can be deleted at any time.
Building needs the generator (`pip install "obseq[gencode]"`); loading what was built does not. What is
kept is run: a file is taken only if it is the user's own, and its text that of its hash.
"""

import functools
import hashlib
import importlib
import importlib.util
import linecache
import logging
import re
from pathlib import Path
from types import ModuleType

from obseq.compilation.cache import keep, read_own, user_folder
from obseq.errors import LONGEST_NAME, FormulaError, InputError
from obseq.module_texts import is_whole
from obseq.packages import GENERATOR, missing

LOGGER = logging.getLogger(__name__)
NAME = re.compile(r"[A-Za-z]\w*", re.ASCII)
TEXT = "TEXT"
"""Name under which a module in memory keeps its own text."""

PREFIX = "obseq_on_demand_"


def find(name: str) -> ModuleType | None:
    """The module of a formula that is built on demand; None when the name means nothing, or cannot be read.

    A first use writes the module and logs a warning that says where. Where nothing can be written, the module
    lives in memory, and the warning says that.

    Raises:
        FormulaError: A number in the name is too large or too small for its family; or what was kept is
            damaged, and the generator is not installed.
    """
    if len(name) > LONGEST_NAME or not NAME.fullmatch(name):
        return None
    path = folder() / f"{name}.py"
    kept = read_own(path)
    text = "" if kept is None else kept.decode("utf-8", "replace")
    if is_whole(text):
        return in_memory(name, text)
    if kept is not None:
        LOGGER.warning("%s is damaged: it is built again", path)
    if kept is not None and not can_build():
        raise FormulaError(f'{path} is damaged; to build it again: pip install "obseq[gencode]"')
    return _build(name, path)


def in_memory(name: str, text: str) -> ModuleType:
    """The module of a text that is in no file; another text of the same name is another module."""
    place = f"<generated {name} {hashlib.sha256(text.encode()).hexdigest()}>"
    module = ModuleType(f"{PREFIX}{name}")
    linecache.cache[place] = (len(text), None, text.splitlines(keepends=True), place)
    exec(compile(text, place, "exec"), module.__dict__)  # the one place that executes text
    module.__dict__[TEXT] = text
    return module


def can_build() -> bool:
    """True when the generator is installed."""
    return not missing(*GENERATOR)


def folder() -> Path:
    """Where modules built by this version of the equations and of the generator are kept."""
    return user_folder() / _version()


@functools.cache
def _version() -> str:
    """Hash of the equations, of the generator, and of what kernels rely on."""
    digest = hashlib.sha256()
    for path in _sources():
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def _sources() -> list[Path]:
    kernels = Path(__file__).parent
    files = [kernels / name for name in ("functions.py", "instructions.py", "layout.py")]
    for package in ("obseq.formulas", "obseq.codegen"):
        spec = importlib.util.find_spec(package)
        for place in (spec.submodule_search_locations or []) if spec else []:
            files += sorted([*Path(place).glob("*.py"), *Path(place).glob("templates/*.jinja")])
    return files


def _build(name: str, path: Path) -> ModuleType | None:
    if not can_build():
        return None
    text: str | None = importlib.import_module("obseq.codegen.ondemand").text_of(name)
    if text is None:
        return None
    try:
        write_kept(path, text)
        LOGGER.warning("built %s on demand in %s, for this time and the next ones", name, path)
    except InputError as error:
        _say_once(str(error))
    return in_memory(name, text)


def write_kept(path: Path, text: str) -> None:
    """Writes a module where it is found again.

    Raises:
        InputError: nothing can be written there.
    """
    try:
        keep(path, text.encode())
    except OSError as error:
        raise InputError(f"{error.filename or path}: it cannot be written ({error.strerror}).") from error


@functools.cache
def _say_once(reason: str) -> None:
    LOGGER.warning("%s Formulas are built anew in each process; OBSEQ_CACHE may name another folder.", reason)
