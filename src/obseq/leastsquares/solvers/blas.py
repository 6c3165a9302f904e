"""SciPy's compiled BLAS and LAPACK, called from numba by address."""

from __future__ import annotations

import ctypes
import importlib
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from obseq.compilation import Instruction

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

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
)
fortran = Instruction("obseq.leastsquares.solvers.fortran_calls", "fortran")
lapack = Instruction("obseq.leastsquares.solvers.fortran_calls", "lapack")
address_of = Instruction("obseq.leastsquares.solvers.fortran_calls", "address_of")

POTRF, POTRI, TRSM, SYRK, SYMM, GEMM, TRSV, GEMV = range(len(ROUTINES))


@lru_cache(maxsize=1)
def routine_addresses() -> NDArray[np.int64]:
    """Addresses of the routines, in the order of `ROUTINES`; they differ from one process to the next."""
    return np.array(
        [_address(importlib.import_module(module), name) for module, name in ROUTINES], dtype=np.int64
    )


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
def _thread_functions() -> tuple[Callable[[], int], Callable[[int], None]] | None:
    """What gets and sets the number of threads of SciPy's own OpenBLAS; None if it has another BLAS."""
    import scipy

    folder = Path(scipy.__file__).parent
    for place in (folder.parent / "scipy.libs", folder / ".dylibs", folder / ".libs"):
        for library in sorted(place.glob("libscipy_openblas*")):
            loaded = ctypes.CDLL(str(library))
            if hasattr(loaded, "scipy_openblas_set_num_threads"):
                return loaded.scipy_openblas_get_num_threads, loaded.scipy_openblas_set_num_threads
    return None


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Keeps SciPy's OpenBLAS at one thread: its threads cost more than they bring on small blocks.

    Where SciPy is built on another library (a distribution's, Apple's) that library's setting holds.
    """
    functions = _thread_functions()
    if functions is None:
        yield
        return
    get, put = functions
    before = get()
    put(1)
    try:
        yield
    finally:
        put(before)
