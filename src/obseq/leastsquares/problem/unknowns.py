"""The table of unknowns: blocks with names, in one vector of values and one vector of context."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

from obseq.errors import InputError
from obseq.leastsquares.problem.arguments import finite, plain, texts, whole
from obseq.leastsquares.problem.manifolds import (
    checked_rotations,
    direction_context,
    moved_directions,
    rotation_context,
    turned,
)
from obseq.leastsquares.problem.owner import Owner

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from obseq.arrays import BoolArray, FloatArray, IntArray


PADDING = 4
"""Spare doubles behind values and context: gathers read four at a time."""


class Kind(IntEnum):
    """What a block of unknowns is."""

    POINT3 = 0
    POINT2 = 1
    ROTATION = 2
    DIRECTION = 3
    VECTOR = 4
    SCALAR = 5

    @property
    def label(self) -> str:
        """The name formulas use for it (`Point3`)."""
        return self.name.capitalize()


def kind_of(label: object) -> Kind:
    """The kind of a label (`Point3`, in any case).

    Raises:
        InputError: there is no such kind.
    """
    for kind in Kind:
        if isinstance(label, str) and label.upper() == kind.name:
            return kind
    raise InputError(f"no kind of unknown is called {label!r}; there are {', '.join(k.label for k in Kind)}")


COMPONENTS = {
    Kind.POINT3: ("x", "y", "z"),
    Kind.POINT2: ("x", "y"),
    Kind.ROTATION: ("rotation.x", "rotation.y", "rotation.z"),
    Kind.DIRECTION: ("direction.u", "direction.v"),
    Kind.SCALAR: ("",),
}

Scalar = TypeVar("Scalar", bound=np.generic)


class Column(Generic[Scalar]):
    """A 1-D array that grows at its end in amortised constant time, with some spare room behind."""

    def __init__(self, dtype: type[Scalar]) -> None:
        self._data: NDArray[Scalar] = np.zeros(64, dtype=dtype)
        self._n = 0

    def __len__(self) -> int:
        return self._n

    @property
    def view(self) -> NDArray[Scalar]:
        """The entries present; a view, to be read again after an extension."""
        return self._data[: self._n]

    @property
    def padded(self) -> NDArray[Scalar]:
        """The same with at least PADDING readable entries behind."""
        return self._data

    def extend(self, values: ArrayLike) -> None:
        """Appends entries."""
        added = np.asarray(values, dtype=self._data.dtype).ravel()
        n = self._n + len(added)
        if n + PADDING > len(self._data):
            grown = np.zeros(2 * n + PADDING, dtype=self._data.dtype)
            grown[: self._n] = self._data[: self._n]
            self._data = grown
        self._data[self._n : n] = added
        self._n = n

    def cut(self, n: int) -> None:
        """Keeps the first n entries."""
        self._n = min(n, self._n)


@dataclass(frozen=True)
class State:
    """Values and context at one moment, to come back to."""

    values: FloatArray
    context: FloatArray


class UnknownTable:
    """Blocks of unknowns by number (id), columnar: ids are positions in the columns, in order of addition.

    The unknowns of a block are consecutive in `values`. Those of a rotation or a direction are small
    displacements around the context (current matrix, current vector) and are zero between two steps.
    """

    def __init__(self) -> None:
        self.names: list[str] = []
        self.owner = Owner()
        self._ids: dict[Kind, dict[str, int]] = {kind: {} for kind in Kind}
        self._kind = Column(np.int64)
        self._start = Column(np.int64)
        self._size = Column(np.int64)
        self._context_start = Column(np.int64)
        self._family = Column(np.int64)
        self._components: list[tuple[str, ...]] = []
        self._values = Column(np.float64)
        self._context = Column(np.float64)
        self._frozen = Column(np.bool_)
        self._eliminated = Column(np.bool_)

    def __len__(self) -> int:
        return len(self.names)

    @property
    def kind(self) -> IntArray:
        """(n_blocks,) kind of each block."""
        return self._kind.view

    @property
    def start(self) -> IntArray:
        """(n_blocks,) position of the first unknown of each block in `values`."""
        return self._start.view

    @property
    def size(self) -> IntArray:
        """(n_blocks,) number of unknowns of each block."""
        return self._size.view

    @property
    def context_start(self) -> IntArray:
        """(n_blocks,) position of the context of each block, 0 where it has none."""
        return self._context_start.view

    @property
    def values(self) -> FloatArray:
        """(n_scalars,) current values of all unknowns."""
        return self._values.view

    @property
    def padded_values(self) -> FloatArray:
        """`values` with spare room behind, for the drivers."""
        return self._values.padded

    @property
    def padded_context(self) -> FloatArray:
        """The context with spare room behind, for the drivers."""
        return self._context.padded

    @property
    def frozen(self) -> BoolArray:
        """(n_scalars,) True where an unknown keeps its value."""
        return self._frozen.view

    @property
    def eliminated(self) -> BoolArray:
        """(n_blocks,) True for the blocks to be eliminated before the matrix is formed."""
        return self._eliminated.view

    @property
    def n_scalars(self) -> int:
        """Number of scalar unknowns, frozen ones included."""
        return len(self._values)

    def add(
        self,
        kind: Kind,
        names: Sequence[str],
        values: FloatArray,
        context: FloatArray | None = None,
        components: tuple[str, ...] | None = None,
    ) -> IntArray:
        """Adds blocks of one kind: `values` (n, size), `context` (n, context size); returns their ids."""
        self.owner.check()
        self._refuse_repeated(kind, names)
        before = self._lengths()
        try:
            return self._extended(kind, names, values, context, components)
        except BaseException:  # interrupted: no column is longer than another
            self._cut(before)
            raise

    def _extended(
        self,
        kind: Kind,
        names: Sequence[str],
        values: FloatArray,
        context: FloatArray | None,
        components: tuple[str, ...] | None,
    ) -> IntArray:
        first, n, size = len(self), len(names), values.shape[1]
        self._ids[kind].update(zip(names, range(first, first + n), strict=True))
        self.names.extend(names)
        self._components.append(COMPONENTS[kind] if components is None else components)
        self._kind.extend(np.full(n, kind))
        self._size.extend(np.full(n, size))
        self._family.extend(np.full(n, len(self._components) - 1))
        self._start.extend(self.n_scalars + size * np.arange(n))
        self._values.extend(values)
        self._frozen.extend(np.zeros(n * size, dtype=bool))
        self._eliminated.extend(np.zeros(n, dtype=bool))
        width = 0 if context is None else context.shape[1]
        self._context_start.extend((len(self._context) if width else 0) + width * np.arange(n))
        if context is not None:
            self._context.extend(context)
        return np.arange(first, first + n)

    def _columns(self) -> tuple[Column[Any], ...]:
        return (
            self._kind,
            self._start,
            self._size,
            self._context_start,
            self._family,
            self._values,
            self._context,
            self._frozen,
            self._eliminated,
        )

    def _lengths(self) -> tuple[int, ...]:
        return (len(self.names), len(self._components), *(len(column) for column in self._columns()))

    def _cut(self, lengths: tuple[int, ...]) -> None:
        """Takes away what was added since the table had these lengths."""
        n, families, *others = lengths
        for known in self._ids.values():
            for name in [name for name, block in known.items() if block >= n]:
                del known[name]
        del self.names[n:], self._components[families:]
        for column, length in zip(self._columns(), others, strict=True):
            column.cut(length)

    def _refuse_repeated(self, kind: Kind, names: Sequence[str]) -> None:
        known = self._ids[kind]
        if len(set(names)) != len(names) or not known.keys().isdisjoint(names):
            counts = Counter(names)
            repeated = next(name for name in names if name in known or counts[name] > 1)
            raise InputError(f"the {kind.label} {repeated!r} is there twice: give each one its own name")

    def find(self, names: Sequence[str], kind: Kind) -> IntArray:
        """Ids of blocks of one kind by name."""
        known = self._ids[kind]
        try:
            return np.array([known[name] for name in texts(names, f"names of {kind.label}")], dtype=np.int64)
        except KeyError as error:
            raise InputError(f"no {kind.label} is called {error.args[0]!r}") from None

    def checked(self, ids: ArrayLike, what: str) -> IntArray:
        """Ids as a 1-D int64 array; an error when one of them is no block."""
        array = np.atleast_1d(plain(ids, what))
        if array.ndim != 1 or (array.size and not np.issubdtype(array.dtype, np.integer)):
            raise InputError(f"{what}: block ids must be a 1-D array of integers")
        array = array.astype(np.int64)
        wrong = np.flatnonzero((array < 0) | (array >= len(self)))
        if wrong.size:
            raise InputError(
                f"{what}: row {wrong[0]} has block id {array[wrong[0]]}; ids go from 0 to {len(self) - 1}"
            )
        return array

    def uniform(self, ids: ArrayLike, what: str) -> tuple[IntArray, Kind, int]:
        """Ids that must all be of one kind and size, with this kind and size."""
        array = self.checked(ids, what)
        if not array.size:
            raise InputError(f"{what}: no block ids")
        kind, size = self.kind[array], self.size[array]
        wrong = np.flatnonzero((kind != kind[0]) | (size != size[0]))
        if wrong.size:
            one, other = self.names[array[0]], self.names[array[wrong[0]]]
            raise InputError(
                f"{what}: {one!r} ({Kind(kind[0]).label}, {size[0]}) and {other!r} "
                f"({Kind(kind[wrong[0]]).label}, {size[wrong[0]]}) are not alike; treat them in two calls"
            )
        return array, Kind(kind[0]), int(size[0])

    def scalars(self, ids: ArrayLike, what: str = "ids") -> IntArray:
        """(n, size) positions in `values` of the unknowns of blocks that are alike."""
        array, _, size = self.uniform(ids, what)
        return np.asarray(self.start[array][:, None] + np.arange(size))

    def components(self, block: int) -> tuple[str, ...]:
        """Names of the unknowns of one block, without the name of the block."""
        return self._components[int(self._family.view[block])]

    def component_names(self, scalars: ArrayLike) -> tuple[str, ...]:
        """Full names (`PtA.x`, `S1.rotation.z`) of unknowns given by their position in `values`."""
        array = np.atleast_1d(np.asarray(scalars, dtype=np.int64))
        blocks = np.searchsorted(self.start, array, side="right") - 1
        return tuple(
            ".".join(part for part in (self.names[block], self.components(block)[scalar]) if part)
            for block, scalar in zip(blocks, array - self.start[blocks], strict=True)
        )

    def component_index(self, ids: ArrayLike, components: Sequence[str | int] | None, what: str) -> IntArray:
        """(n, k) positions of chosen components, by number or by name, of blocks that are alike."""
        array, _, size = self.uniform(ids, what)
        if components is None:
            return self.scalars(array, what)
        known = self.components(int(array[0]))
        if isinstance(components, str) and any(components in _called(name) for name in known):
            components = (components,)
        if not isinstance(components, Iterable):
            raise InputError(f"{what}: a list of components is wanted, not {components!r}")
        chosen = [_component(known, component, size, what) for component in components]
        return np.asarray(self.start[array][:, None] + np.array(chosen, dtype=np.int64))

    def set_frozen(self, ids: ArrayLike, components: Sequence[str | int] | None, frozen: bool) -> None:
        """Freezes or frees chosen components (all when None) of blocks that are alike."""
        index = self.component_index(ids, components, "freeze" if frozen else "unfreeze")
        self.owner.check()
        self.frozen[index] = frozen

    def set_eliminated(self, ids: ArrayLike, eliminated: bool) -> None:
        """Marks blocks as to be eliminated, or not."""
        blocks = self.checked(ids, "eliminate")
        self.owner.check()
        self.eliminated[blocks] = eliminated

    def read(self, ids: ArrayLike, state: State | None = None) -> FloatArray:
        """Current values: (n, size) for points, vectors, scalars; (n, 3, 3) rotations; (n, 3) directions."""
        array, kind, _ = self.uniform(ids, "values")
        values = self.values if state is None else state.values
        context = self._context.view if state is None else state.context
        if kind is Kind.ROTATION:
            return np.asarray(context[self.context_start[array][:, None] + np.arange(9)].reshape(-1, 3, 3))
        if kind is Kind.DIRECTION:
            return np.asarray(context[self.context_start[array][:, None] + np.arange(3)])
        return np.asarray(values[self.scalars(array)])

    def write(self, ids: ArrayLike, new: ArrayLike) -> None:
        """Gives blocks that are alike new values, in the shape that `read` returns."""
        self.owner.check()
        array, kind, size = self.uniform(ids, "set_values")
        shape = {Kind.ROTATION: (3, 3), Kind.DIRECTION: (3,)}.get(kind, (size,))
        given = finite(new, (len(array), *shape), "set_values")
        if kind is Kind.ROTATION:
            self._write_context(array, rotation_context(checked_rotations(given, "set_values")))
        elif kind is Kind.DIRECTION:
            self._write_context(array, direction_context(given))
        else:
            self.values[self.scalars(array)] = given

    def _write_context(self, ids: IntArray, context: FloatArray) -> None:
        self._context.view[self.context_start[ids][:, None] + np.arange(context.shape[1])] = context

    def state(self) -> State:
        """A copy of values and context."""
        return State(self.values.copy(), self._context.view.copy())

    def restore(self, state: State) -> None:
        """Comes back to a state; blocks added since keep their values."""
        self.values[: len(state.values)] = state.values
        self._context.view[: len(state.context)] = state.context

    def move(self, step: FloatArray) -> None:
        """Adds a step (n_scalars,) to all unknowns; rotations and directions absorb theirs and are reset."""
        values = self.values + step
        for kind in (Kind.ROTATION, Kind.DIRECTION):
            ids = np.flatnonzero(self.kind == kind)
            if ids.size:
                self._absorb(ids, kind, values)
        self.values[:] = values

    def _absorb(self, ids: IntArray, kind: Kind, values: FloatArray) -> None:
        scalars = self.scalars(ids)
        small = values[scalars]
        moved = np.any(small != 0.0, axis=1)
        ids, small = ids[moved], small[moved]
        values[scalars] = 0.0
        if not ids.size:
            return
        if kind is Kind.ROTATION:
            self._write_context(ids, rotation_context(turned(self.read(ids), small)))
        else:
            context = self._context.view[self.context_start[ids][:, None] + np.arange(9)]
            self._write_context(ids, moved_directions(context, small))


def _component(known: tuple[str, ...], component: str | int, size: int, what: str) -> int:
    """Number of a component given by name or by number."""
    if isinstance(component, str):
        for number, name in enumerate(known):
            if component in _called(name):
                return number
        raise InputError(f"{what}: no component {component!r}; there are {', '.join(known)}")
    number = whole(component, f"{what}, component")
    if not 0 <= number < size:
        raise InputError(f"{what}: no component {number}; they go from 0 to {size - 1}")
    return number


def _called(component: str) -> tuple[str, str]:
    """What a component may be called: `rotation.x`, or `x`."""
    return component, component.rpartition(".")[2]
