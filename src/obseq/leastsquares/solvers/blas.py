"""SciPy's compiled BLAS and LAPACK, called by address.

SciPy's own OpenBLAS is loaded as a library: importing `scipy.linalg` takes a hundred times as long. Where
SciPy is built on another library (a distribution's, Apple's), the addresses are those of its Cython modules.
"""

from __future__ import annotations

import ctypes
import importlib
import importlib.util
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache, lru_cache
from pathlib import Path
from threading import Lock
from typing import Any, ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray

from obseq.compilation import Instruction
from obseq.pools import let_go_at_fork

LAPACK, BLAS = "scipy.linalg.cython_lapack", "scipy.linalg.cython_blas"
ROUTINES = (
    (LAPACK, "dpotrf"),
    (LAPACK, "dpotri"),
    (BLAS, "dtrsm"),
    (BLAS, "dsyrk"),
    (BLAS, "dsymm"),
    (BLAS, "dgemm"),
    (BLAS, "dtrsv"),
    (BLAS, "dgemv"),
    (LAPACK, "dpotrs"),
)
fortran = Instruction("obseq.leastsquares.solvers.fortran_calls", "fortran")
lapack = Instruction("obseq.leastsquares.solvers.fortran_calls", "lapack")
address_of = Instruction("obseq.leastsquares.solvers.fortran_calls", "address_of")

POTRF, POTRI, TRSM, SYRK, SYMM, GEMM, TRSV, GEMV, POTRS = range(len(ROUTINES))


Threads: TypeAlias = "tuple[Callable[[], int], Callable[[int], None]]"


@lru_cache(maxsize=1)
def routine_addresses() -> NDArray[np.int64]:
    """Addresses of the routines, in the order of `ROUTINES`; they differ from one process to the next."""
    library = _library()
    if library is None:
        found = [_address(importlib.import_module(module), name) for module, name in ROUTINES]
    else:
        entries = (getattr(library, f"scipy_{name}_") for _, name in ROUTINES)
        found = [ctypes.cast(entry, ctypes.c_void_p).value or 0 for entry in entries]
    return np.array(found, dtype=np.int64)


def call_lapack(routine: int, *arguments: str | int | NDArray[np.float64]) -> int:
    """Calls a LAPACK routine; its status.

    Args:
        routine: position in `ROUTINES`.
        arguments: those of the routine without its status: letters, whole numbers, arrays by their first
            entry, contiguous in one order or the other.
    """
    status = ctypes.c_int(0)
    _call(routine, arguments, ctypes.byref(status))
    return status.value


def call_blas(routine: int, *arguments: str | float | NDArray[np.float64]) -> None:
    """Calls a BLAS routine with all of its arguments, as `call_lapack`."""
    _call(routine, arguments)


def _call(routine: int, arguments: Sequence[str | float | NDArray[np.float64]], *more: Any) -> None:
    """Letters have their lengths behind all other arguments."""
    passed = [_by_reference(value) for value in arguments]
    lengths = [ctypes.c_size_t(1) for value in arguments if isinstance(value, str)]
    _function(routine)(*passed, *more, *lengths)


@lru_cache(maxsize=len(ROUTINES))
def _function(routine: int) -> Callable[..., None]:
    return ctypes.CFUNCTYPE(None)(int(routine_addresses()[routine]))


def _by_reference(value: str | float | NDArray[np.float64]) -> Any:
    if isinstance(value, np.ndarray):
        return ctypes.c_void_p(value.ctypes.data)
    if isinstance(value, float):
        return ctypes.byref(ctypes.c_double(value))
    return ctypes.byref(ctypes.c_char(value.encode()) if isinstance(value, str) else ctypes.c_int(value))


def _address(module: Any, name: str) -> int:
    """Address of a routine whose integers have 32 bits, as all of SciPy's have."""
    capsule = module.__pyx_capi__[name]
    capsule_name = ctypes.pythonapi.PyCapsule_GetName
    capsule_name.restype, capsule_name.argtypes = ctypes.c_char_p, [ctypes.py_object]
    pointer = ctypes.pythonapi.PyCapsule_GetPointer
    pointer.restype, pointer.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
    signature = capsule_name(capsule)
    if b"int *" not in signature:
        raise ImportError(f"SciPy's {name} has the unexpected signature {signature.decode()}")
    return int(pointer(capsule, signature))


@lru_cache(maxsize=1)
def _library() -> ctypes.CDLL | None:
    """SciPy's own OpenBLAS, in which integers have 32 bits; None if it has another BLAS."""
    file = _own_library("scipy")
    library = ctypes.CDLL(str(file)) if file else None
    with _Held.lock:
        if _Held.blocks:
            _Held.hold_loaded()
    return library


@cache
def _own_library(package: str) -> Path | None:
    """The file of the OpenBLAS that a package brings with it."""
    spec = importlib.util.find_spec(package)
    for folder in map(Path, (spec and spec.submodule_search_locations) or ()):
        for place in (folder.parent / f"{package}.libs", folder / ".dylibs", folder / ".libs"):
            for library in sorted(place.glob("libscipy_openblas*")):
                return library
    return None


@cache
def _threads_of(file: Path, ending: str) -> Threads:
    """What gets and sets the number of threads of an OpenBLAS.

    Raises:
        OSError: it is not loaded.
    """
    library = ctypes.CDLL(str(file), os.RTLD_NOLOAD)
    get, put = (f"scipy_openblas_{what}_num_threads{ending}" for what in ("get", "set"))
    return getattr(library, get), getattr(library, put)


def loaded() -> dict[str, Threads]:
    """What gets and sets the number of threads of each OpenBLAS that SciPy and NumPy bring with them.

    Of those that are loaded: loading SciPy's takes 20 ms, and small systems never call it.
    """
    found = {}
    for package, ending in (("scipy", ""), ("numpy", "64_")):
        if file := _own_library(package):
            with suppress(OSError):
                found[package] = _threads_of(file, ending)
    return found


class _Held:
    """How many blocks keep OpenBLAS at one thread, and what to give back when the last one is left."""

    lock = Lock()
    blocks = 0
    before: ClassVar[dict[str, int]] = {}

    @classmethod
    def hold_loaded(cls) -> None:
        """Keeps those at one thread that are loaded and not kept yet."""
        for package, (get, put) in loaded().items():
            if package not in cls.before:
                cls.before[package] = get()
                put(1)

    @classmethod
    def let_go(cls) -> None:
        """Gives all of them their numbers of threads back."""
        for package, number in cls.before.items():
            loaded()[package][1](number)
        cls.before.clear()


let_go_at_fork(_Held.lock)


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Keeps SciPy's OpenBLAS and NumPy's at one thread: more cost more than they bring on small blocks.

    On two busy cores, two of them take 19 to 500 ms to factor 189 unknowns, and one takes 0.1 ms. The numbers
    from before hold again when the last such block is left, whichever thread entered it.

    Where a package is built on another library (a distribution's, Apple's) that library's setting holds.
    """
    with _Held.lock:
        _Held.hold_loaded()
        _Held.blocks += 1
    try:
        yield
    finally:
        with _Held.lock:
            _Held.blocks -= 1
            if not _Held.blocks:
                _Held.let_go()
