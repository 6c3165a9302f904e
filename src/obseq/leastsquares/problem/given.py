"""What users give for a batch of equations: blocks for the roles of a formula, numbers by name.

And what a batch gives back of its observations: an array that is read; another one replaces it as a whole.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import FloatArray, IntArray
from obseq.errors import InputError
from obseq.leastsquares.problem.arguments import plain, real
from obseq.leastsquares.problem.shapes import Role, Shape
from obseq.leastsquares.problem.unknowns import UnknownTable


def block_columns(table: UnknownTable, shape: Shape, blocks: Mapping[str, ArrayLike]) -> list[IntArray]:
    """Ids of blocks for each role of a formula, one or one per row.

    Raises:
        InputError: a role has none, there are others, or a block is of another kind.
    """
    if not isinstance(blocks, Mapping):
        raise InputError(f"{shape.name}: blocks are given by name, not as {type(blocks).__name__}")
    roles = shape.roles
    _refuse_other_names(f"{shape.name}: block arguments", {role.name for role in roles}, blocks.keys())
    return [_checked_role(table, shape, role, blocks[role.name]) for role in roles]


def stretched_columns(shape: Shape, columns: list[IntArray], n: int) -> IntArray:
    """(n_roles, n) ids, one alone standing for all rows."""
    for role, column in zip(shape.roles, columns, strict=True):
        if len(column) not in (1, n):
            raise InputError(f"{shape.name}, {role.name}: {len(column)} ids; other arguments have {n}")
    blocks = np.empty((len(columns), n), dtype=np.int64)
    for row, column in zip(blocks, columns, strict=True):
        row[:] = column
    return blocks


def _checked_role(table: UnknownTable, shape: Shape, role: Role, ids: ArrayLike) -> IntArray:
    what = f"{shape.name}, {role.name}"
    array = table.checked(ids, what)
    accepted = table.each(role.takes, array) & (table.size[array] == role.size)
    if not accepted.all():
        wrong = int(accepted.argmin())
        block = array[wrong]
        raise InputError(
            f"{what}: row {wrong} gives {table.names[block]!r}, a {table.manifold(block).label} of "
            f"{table.size[block]}; the formula wants a {role.kind} of {role.size}"
        )
    return array


def observation_rows(
    shape: Shape, given: ArrayLike | Mapping[str, ArrayLike] | None, n: int, present: FloatArray
) -> FloatArray:
    """(n, m) observations, checked for their shape.

    Args:
        shape: the formula.
        given: (n, m), (n,) when m is 1, or by name; None when the formula takes none. Of linear rows (n,)
            are right-hand sides.
        n: number of observations.
        present: (m, n or more) what they are now: the coefficients of linear rows.
    """
    if isinstance(given, Mapping):
        return _numbers_by_name(shape, given, n)
    array = np.zeros((n, 0)) if given is None else real(given, f"{shape.name}, observations")
    width = len(shape.observation_rows)
    if shape.is_linear and array.shape == (n,):
        array = np.column_stack([present[:-1, :n].T, array])
    if array.shape != (n, width) and not (array.shape == (n,) and width == 1):
        more = f", coefficients and right-hand side, or ({n},), right-hand sides" if shape.is_linear else ""
        raise InputError(
            f"{shape.name}: observations have shape {array.shape}; expected ({n}, {width}){more}"
        )
    return array.reshape(n, width)


def _numbers_by_name(shape: Shape, given: Mapping[str, ArrayLike], n: int) -> FloatArray:
    """(n, m) numbers from arrays by name, each of its natural shape for all rows, or for one and all."""
    known = {column.name: column for column in shape.columns}
    _refuse_other_names(f"{shape.name}: observations", known.keys(), given.keys())
    array = np.empty((n, len(shape.observation_rows)))
    for name, column in known.items():
        rows = real(given[name], f"{shape.name}, {name}")
        if rows.shape not in (column.shape, (n, *column.shape)):
            raise InputError(
                f"{shape.name}, {name}: it has shape {rows.shape}; expected {(n, *column.shape)}, or "
                f"{column.shape} for all"
            )
        flat = rows.reshape(-1, column.size)
        array[:, column.first : column.first + column.size] = flat
    return array


def rows_given(
    shape: Shape, observations: ArrayLike | Mapping[str, ArrayLike] | None, columns: Sequence[IntArray]
) -> Iterator[int]:
    """Numbers of rows of the blocks, and of the observations where each block is given by one id alone."""
    yield from (len(column) for column in columns)
    if observations is None or any(len(column) != 1 for column in columns):
        return
    if not isinstance(observations, Mapping):
        yield len(np.atleast_1d(plain(observations, f"{shape.name}, observations")))
        return
    for column in shape.columns:
        array = plain(observations.get(column.name, 0.0), f"{shape.name}, {column.name}")
        if array.ndim > len(column.shape):
            yield len(array)


def _refuse_other_names(what: str, expected: Set[str], given: Set[str]) -> None:
    if expected != given:
        missing = ", ".join(sorted(expected - given)) or "none"
        unknown = ", ".join(sorted(map(str, given - expected))) or "none"
        raise InputError(f"{what} missing: {missing}; not in the formula: {unknown}")


REPLACED = (
    "`observations` is a copy, and cannot be written to. Change one of your own, and replace them: "
    "values = batch.observations.copy(); values[0] = ...; batch.observations = values"
)


class Measured(np.ndarray):
    """A copy of observations; writing to it would change nothing, so it says what does."""

    @classmethod
    def of(cls, array: FloatArray) -> Measured:
        """The array, which nobody can write to any more."""
        array.setflags(write=False)
        return array.view(cls)

    def __setitem__(self, where: Any, new: Any) -> None:
        if not self.flags.writeable:
            raise InputError(REPLACED)
        super().__setitem__(where, new)

    def __array_ufunc__(
        self, ufunc: np.ufunc, method: str, *inputs: object, out: tuple[object, ...] = (), **options: object
    ) -> object:
        """What is computed from it is a plain array; `+=` makes a new one, which may replace it."""
        locked = [item for item in out if isinstance(item, Measured) and not item.flags.writeable]
        if any(item is not inputs[0] for item in locked):
            raise InputError(REPLACED)
        if out and not locked:
            options["out"] = tuple(map(_plain, out))
        return getattr(ufunc, method)(*map(_plain, inputs), **options)


def _plain(item: object) -> object:
    return np.asarray(item) if isinstance(item, Measured) else item
