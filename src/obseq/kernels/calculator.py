"""A formula evaluated on plain arrays: values, and values with derivatives."""

import functools
import math
import threading
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from obseq.arguments import ARRAY, TEXT, expecting, require
from obseq.arrays import FloatArray
from obseq.cached import cached_property
from obseq.compilation.loops import HAS_BUILTINS
from obseq.errors import FormulaError, InputError
from obseq.kernels.layout import LANES, STRIDE
from obseq.kernels.loading import Kernel, load
from obseq.pools import processors, thread_pool

FLOAT = np.dtype(np.float64)

SCRATCH_DOUBLES = 2 << 10
"""Size of the scratch tiles of an evaluation: 16 KiB, which leave room for rows in a first-level cache."""

QUICK_ROWS = 1024
"""Up to so many rows are evaluated without letting go of Python's lock, which costs more than it gives."""

STREAMED_BYTES = 2 << 20
"""Derivatives of so many bytes and more are written past caches, which cannot keep them."""

SHARE = 32_768
"""Rows of a share of a thread: a millisecond of work, ten times what it costs to start one."""


class _Run(NamedTuple):
    """A kernel as it is run: its address, the rows of its tiles, and those that it does not write."""

    address: int
    rows: int
    constants: tuple[tuple[int, float], ...]


class Calculator:
    """Evaluates one formula on batches of arguments.

    Attributes:
        name: Name of the formula.
        unknowns: Names of the unknowns, in order.
        observations: Names of the observations, in order.
        residuals: Names of the residuals, in order.
    """

    def __init__(self, kernel: Kernel) -> None:
        self.kernel = kernel
        self.name = kernel.name
        self.unknowns = kernel.unknowns
        self.observations = kernel.observations
        self.residuals = kernel.residuals

    def __reduce__(self) -> tuple[type["Calculator"], tuple[Kernel]]:
        """By its kernel: addresses are those of one process."""
        return Calculator, (self.kernel,)

    def __repr__(self) -> str:
        return (
            f"<Calculator {self.name}: {len(self.unknowns)} unknowns, "
            f"{len(self.observations)} observations, {len(self.residuals)} residuals>"
        )

    def values(
        self, unknowns: ArrayLike, observations: ArrayLike, out: FloatArray | None = None
    ) -> FloatArray:
        """The residuals.

        Args:
            unknowns: (n, n_unknowns) float64.
            observations: (n, n_observations) float64, context of the unknown blocks included.
            out: (n, n_residuals) float64 to write them to; a new array by default.

        Returns:
            (n, n_residuals) float64; a row where the formula is undefined is not finite.

        Raises:
            FormulaError: An array has the wrong shape or is not made of real numbers.
        """
        if type(unknowns) is np.ndarray:
            few: FloatArray = np.empty((*unknowns.shape[:1], len(self.residuals))) if out is None else out
            if self._few_values(unknowns, observations, few) is few:
                return few
        u, o = self._arguments(unknowns, observations)
        n = len(u)
        values = self._result(out, (n, len(self.residuals)))
        self._evaluate(self._value, u, o, values, np.empty((n, 0)))
        return values

    def values_and_jacobian(
        self,
        unknowns: ArrayLike,
        observations: ArrayLike,
        out: tuple[FloatArray, FloatArray] | None = None,
    ) -> tuple[FloatArray, FloatArray]:
        """The residuals and their derivatives with respect to the unknowns.

        Args:
            unknowns: (n, n_unknowns) float64.
            observations: (n, n_observations) float64, context of the unknown blocks included.
            out: (n, n_residuals) and (n, n_residuals, n_unknowns) float64 to write to; new by default.

        Returns:
            (n, n_residuals) and (n, n_residuals, n_unknowns) float64.

        Raises:
            FormulaError: An array has the wrong shape or is not made of real numbers.
        """
        if type(unknowns) is np.ndarray:
            first, second = self._new_results(unknowns) if out is None else out
            if self._few_jacobians(unknowns, observations, first, second) is second:
                return first, second
        u, o = self._arguments(unknowns, observations)
        n, m, k = len(u), len(self.residuals), len(self.unknowns)
        to = (None, None) if out is None else out
        values, jacobian = self._result(to[0], (n, m)), self._result(to[1], (n, m, k))
        self._evaluate(self._value_and_jacobian, u, o, values, jacobian.reshape(n, m * k))
        return values, jacobian

    def directional_derivative(
        self,
        unknowns: ArrayLike,
        observations: ArrayLike,
        direction: ArrayLike,
        out: tuple[FloatArray, FloatArray] | None = None,
    ) -> tuple[FloatArray, FloatArray]:
        """The residuals and their derivatives along a direction: the Jacobian times a vector, at once.

        The kernel is generated when first asked for; where the generator is not installed, the Jacobian is
        computed and multiplied.

        Args:
            unknowns: (n, n_unknowns) float64.
            observations: (n, n_observations) float64, context of the unknown blocks included.
            direction: (n, n_unknowns) float64, a vector per row.
            out: (n, n_residuals) float64 twice, to write to; new by default.

        Returns:
            (n, n_residuals) residuals and (n, n_residuals) derivatives.

        Raises:
            FormulaError: An array has the wrong shape or is not made of real numbers.
        """
        u, o = self._arguments(unknowns, observations)
        d = self._array("direction", direction, self.unknowns)
        if len(d) != len(u):
            raise FormulaError(f"{self.name}: {len(u)} rows of unknowns but {len(d)} rows of direction")
        shape, to = (len(u), len(self.residuals)), (None, None) if out is None else out
        values, along = self._result(to[0], shape), self._result(to[1], shape)
        if address := self.kernel.directional_address:
            run = _Run(address, self.kernel.directional_rows, ())
            self._evaluate(run, u, np.hstack([o, d]), values, along)
            return values, along
        _, jacobian = self.values_and_jacobian(u, o, (values, np.empty((*shape, len(self.unknowns)))))
        return values, np.einsum("nij,nj->ni", jacobian, d, out=along)

    def check_finite(self, values: ArrayLike) -> None:
        """Raises InputError naming the first rows whose values are not finite.

        Args:
            values: (n, ...) results of this calculator.
        """
        require("check_finite", "values", values, ARRAY)
        array = np.atleast_1d(values)
        bad = np.flatnonzero(~np.isfinite(array.reshape(len(array), math.prod(array.shape[1:]))).all(axis=1))
        if bad.size:
            rows = ", ".join(map(str, bad[:5])) + (", ..." if bad.size > 5 else "")
            raise InputError(f"{self.name}: not finite in {bad.size} of {len(array)} rows: {rows}")

    def _arguments(self, unknowns: ArrayLike, observations: ArrayLike) -> tuple[FloatArray, FloatArray]:
        u = self._array("unknowns", unknowns, self.unknowns)
        o = self._array("observations", observations, self.observations)
        if len(u) != len(o):
            raise FormulaError(f"{self.name}: {len(u)} rows of unknowns but {len(o)} rows of observations")
        return u, o

    def _array(self, argument: str, given: ArrayLike, names: tuple[str, ...]) -> FloatArray:
        if (
            type(given) is np.ndarray
            and given.dtype is FLOAT
            and given.flags.c_contiguous
            and given.shape[1:] == (len(names),)
        ):
            return given
        try:
            array = np.asarray(given)
        except ValueError as error:
            raise FormulaError(f"{self.name}: {argument}: {error}") from error
        if array.dtype.kind not in "fiu" and array.size:
            raise FormulaError(f"{self.name}: {argument} must be real numbers, not {array.dtype}")
        if array.ndim != 2 or array.shape[1] != len(names):
            raise FormulaError(
                f"{self.name}: {argument} must have the shape (n, {len(names)}), one column for each of "
                f"{', '.join(names) or 'no name'}; it has {array.shape}"
            )
        return np.ascontiguousarray(array, dtype=np.float64)

    @cached_property
    def _value(self) -> _Run:
        return _Run(self.kernel.value_address, self.kernel.value_rows, ())

    @cached_property
    def _value_and_jacobian(self) -> _Run:
        kernel = self.kernel
        return _Run(kernel.value_and_jacobian_address, kernel.rows, kernel.constant_rows)

    @cached_property
    def _few_values(self) -> Callable[..., object]:
        return self._few(self._value, "evaluate_values", np.empty((0, 0)))

    @cached_property
    def _few_jacobians(self) -> Callable[..., object]:
        return self._few(self._value_and_jacobian, "evaluate_jacobian")

    def _few(self, run: _Run, loop: str, *more: FloatArray) -> Callable[..., object]:
        """Evaluates a few rows of arrays that are as they must be; returns the last array if it did."""
        if not HAS_BUILTINS:
            return _nothing
        shape = len(self.unknowns), len(self.observations), len(self.residuals)
        plan = np.array([run.address, run.rows, QUICK_ROWS, *shape])
        return functools.partial(getattr(_tiles(), loop).builtin, plan, _new_scratch(run), *more)

    def _new_results(self, unknowns: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Arrays for the results of arguments whose shape is not known to be right."""
        shape = (*unknowns.shape[:1], len(self.residuals))
        return np.empty(shape), np.empty((*shape, len(self.unknowns)))

    def _evaluate(
        self, run: _Run, u: FloatArray, o: FloatArray, values: FloatArray, derivatives: FloatArray
    ) -> None:
        """Writes residuals and what the kernel writes after them, a row for each row of arguments."""
        if not values.size:
            return
        n, streams = len(u), derivatives.nbytes >= STREAMED_BYTES

        def evaluate(tiles: FloatArray, first: int, last: int) -> None:
            rows = np.empty((LANES if streams else 0, derivatives.shape[1]))
            arrays = (u, o, values, derivatives)
            _tiles().evaluate_rows(run.address, tiles, run.rows, *arrays, first, last, rows)

        shares = min(n // SHARE, processors())
        if shares < 2:
            evaluate(_scratch(run), 0, n)
            return
        filled = _scratch(run).size // (run.rows * STRIDE) * LANES
        share = math.ceil(n / shares / filled) * filled
        with thread_pool(shares) as pool:
            starts = range(0, n, share)
            parts = [pool.submit(evaluate, _new_scratch(run), at, min(n, at + share)) for at in starts]
        for part in parts:
            part.result()

    def _result(self, out: FloatArray | None, shape: tuple[int, ...]) -> FloatArray:
        """The array that results are written to: a new one, or the one given if it is as it must be."""
        if out is None:
            return np.empty(shape)
        if isinstance(out, np.ndarray) and out.shape == shape and out.dtype == FLOAT and out.flags.carray:
            return out
        raise FormulaError(
            f"{self.name}: out must be a writeable C-contiguous array of float64, of shape {shape}"
        )


_KEPT = threading.local()


def _scratch(run: _Run) -> FloatArray:
    """Scratch tiles of a kernel, kept by each thread, with the rows that the kernel does not write."""
    kept: dict[Any, Any] = _KEPT.__dict__
    found: FloatArray | None = kept.get(run.address)
    if found is None:
        found = kept[run.address] = _new_scratch(run)
    return found


def _new_scratch(run: _Run) -> FloatArray:
    n_tiles = max(1, SCRATCH_DOUBLES // (run.rows * STRIDE))
    tiles: FloatArray = _tiles().aligned_tiles(run.rows, n_tiles, run.constants)
    return tiles


def _nothing(*arrays: object) -> None:
    """What evaluates no row where Python's objects are not laid out as quick loops know them."""


@functools.cache
def _tiles() -> Any:
    """The compiled loops, imported when they are first needed."""
    import obseq.kernels.tiles as tiles

    return tiles


@expecting(name=TEXT)
def calculator(name: str) -> Calculator:
    """The calculator of a formula: a generated one, or any member of a family, built when first asked for.

    What is not among the generated modules is built by the generator, if it is installed, into a folder of
    the user (`$OBSEQ_CACHE`, or the platform's place for caches), and found there the next time.

    Raises:
        FormulaError: No formula has that name; the message gives close ones.
    """
    return Calculator(load(name))
