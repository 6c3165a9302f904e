"""Machine code of one function: found ahead of time, in the user's cache, or made by numba."""

from __future__ import annotations

import hashlib
import logging
from threading import RLock
from typing import TYPE_CHECKING

from obseq.cached import cached_property
from obseq.compilation import objects
from obseq.compilation.digests import DIGITS
from obseq.errors import ObseqError
from obseq.pools import let_go_at_fork

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.compilation.digests import Function
    from obseq.compilation.signatures import Signature

LOGGER = logging.getLogger(__name__)
_LOCK = RLock()
let_go_at_fork(_LOCK)
_ROUTINES: dict[str, Routine] = {}


class Routine:
    """A function with a signature, and the address of its machine code.

    Attributes:
        function: the function.
        signature: its signature.
        origin: where the machine code came from: "object", "cache" or "numba"; "" before it was asked for.
    """

    def __init__(self, function: Function, signature: Signature) -> None:
        self.function = function
        self.signature = signature
        self.origin = ""

    @cached_property
    def symbol(self) -> str:
        """Name of the machine code: it says the digest of all that the code depends on."""
        together = f"{self.function.digest} {self.signature}"
        home = self.function.python.__module__.rpartition(".")[2]
        return f"{home}_{self.function.name}_{hashlib.sha256(together.encode()).hexdigest()[:DIGITS]}"

    @cached_property
    def address(self) -> int:
        """Address of the machine code, valid for the life of the process; equal functions share it."""
        with _LOCK:
            found = _ROUTINES.setdefault(self.symbol, self)
            if found is not self:
                self.origin = "shared"
                return found.address
            return self._resolve()

    def _resolve(self) -> int:
        address = objects.find(self.symbol)
        if address:
            self.origin = "object"
            return address
        try:
            return _completed(self._loaded)
        except ModuleNotFoundError as error:
            raise ObseqError(
                f"{self.symbol} is not among the functions compiled ahead of time, and {error.name}, which "
                "compiles it, is not installed: pip install numba"
            ) from error

    def _loaded(self) -> int:
        """Address of the code that the cache has, or that numba makes."""
        from obseq.compilation import cache, host

        code = cache.read(self.symbol)
        self.origin = "cache"
        if code is None:
            from obseq.compilation.numba_compiler import compile_for_here

            LOGGER.debug("compiling %s", self.symbol)
            code = compile_for_here(self.function, self.signature, self.symbol)
            self.origin = "numba"
            cache.write(self.symbol, code)
        return host.load(code, self.symbol)


def _completed(work: Callable[[], int]) -> int:
    """Work done by another thread, since only the first one is interrupted: it is done whole.

    The import of a compiler that ends half-way is of no use to the process any more. An interruption is
    raised when the work is done.
    """
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(1) as pool:
        return pool.submit(work).result()


def origins() -> dict[str, str]:
    """Where the machine code of every function asked for so far came from, by symbol."""
    return {symbol: routine.origin for symbol, routine in _ROUTINES.items()}
