"""The table of unknowns: blocks with names, in one vector of values and one vector of context."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any
from weakref import WeakMethod

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import Array, BoolArray, FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.leastsquares.problem.arguments import finite, plain
from obseq.leastsquares.problem.block_names import BlockNames, called, component_number
from obseq.leastsquares.problem.manifolds import CurvedBlocks, Manifold, Perspective
from obseq.leastsquares.problem.owner import Owner
from obseq.leastsquares.problem.padding import GrowingArray


@dataclass(frozen=True)
class State:
    """Values and context at one moment, to come back to."""

    values: FloatArray
    context: FloatArray


class UnknownTable:
    """Blocks of unknowns by number (id), columnar: ids are positions in the columns, in order of addition.

    The unknowns of a block are consecutive in `values`. Those of a curved kind (rotations, directions) are
    small displacements around its context (current matrix, current vector) and are zero between two steps.

    Attributes:
        names: name of each block.
        manifolds: kinds of blocks, those that every system knows first.
        owner: which thread works on the system.
    """

    def __init__(self) -> None:
        self.names: list[str] = []
        self.owner = Owner()
        self._known = BlockNames()
        self.manifolds = self._known.manifolds
        self._kind = GrowingArray(np.int64)
        self._start = GrowingArray(np.int64)
        self._size = GrowingArray(np.int64)
        self._context_start = GrowingArray(np.int64)
        self._family = GrowingArray(np.int64)
        self._components: list[tuple[str, ...]] = []
        self._values = GrowingArray(np.float64)
        self._context = GrowingArray(np.float64)
        self._frozen = GrowingArray(np.bool_)
        self._eliminated = GrowingArray(np.bool_)
        self._curved: tuple[int, list[CurvedBlocks]] = (0, [])
        self._followers: list[WeakMethod[Callable[[], None]]] = []
        self._perspectives: list[Perspective] = []

    def __getstate__(self) -> dict[str, object]:
        return {**self.__dict__, "_followers": []}  # they belong to whoever moves this one

    def __len__(self) -> int:
        return len(self.names)

    def manifold(self, block: int) -> Manifold:
        """The kind of a block."""
        return self.manifolds[int(self._kind.view[block])]

    def each(self, question: Callable[[Manifold], object], blocks: IntArray | slice) -> Array:
        """What the kind of each of some blocks answers, in their shape."""
        return np.array([question(manifold) for manifold in self.manifolds])[self._kind.view[blocks]]

    def of_manifolds(self) -> Iterator[tuple[Manifold, IntArray]]:
        """Each kind with its blocks."""
        kinds = self._kind.view
        for number, manifold in enumerate(self.manifolds):
            yield manifold, (kinds == number).nonzero()[0]

    @property
    def curved(self) -> list[CurvedBlocks]:
        """The blocks of each curved kind that there are any of."""
        n, found = self._curved
        if n != len(self):
            kinds, every = self._kind.view, enumerate(self.manifolds)
            curved = [(kind, (kinds == number).nonzero()[0]) for number, kind in every if not kind.is_flat]
            found = [self._places(kind, ids) for kind, ids in curved if len(ids)]
            self._curved = len(self), found
        return found

    def _places(self, manifold: Manifold, ids: IntArray) -> CurvedBlocks:
        scalars = self.consecutive(ids, int(self.size[ids[0]]))
        return CurvedBlocks(manifold, scalars, self._context_places(ids, manifold))

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
        """`values` with spare room behind, for the loops."""
        return self._values.padded

    @property
    def padded_context(self) -> FloatArray:
        """The context with spare room behind, for the loops."""
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
        manifold: Manifold,
        names: Sequence[str],
        values: FloatArray,
        components: tuple[str, ...] = (),
        what: str = "add_blocks",
    ) -> IntArray:
        """Adds blocks of one kind with their values (n, ...) and the names of their components; their ids."""
        self.owner.check()
        kind = self._known.kind_of(manifold)
        ids = self._known.numbered(kind, names, len(self))
        unknowns, context = manifold.split(manifold.checked(values, names, what))
        before = len(self.names), len(self._components), *(len(column) for column in self._columns())
        try:
            return self._extended(kind, ids, unknowns, context, components or manifold.components)
        except BaseException:  # interrupted: no column is longer than another
            self._cut(before)
            raise

    def _extended(
        self,
        kind: int,
        ids: dict[str, int],
        values: FloatArray,
        context: FloatArray,
        components: tuple[str, ...],
    ) -> IntArray:
        first, (n, size), width = len(self), values.shape, context.shape[1]
        self._known.add(kind, ids)
        self.names.extend(ids)
        self._components.append(components)
        self._kind.extend(np.full(n, kind))
        self._size.extend(np.full(n, size))
        self._family.extend(np.full(n, len(self._components) - 1))
        self._start.extend(self.n_scalars + size * np.arange(n))
        self._values.extend(values)
        self._frozen.extend(np.zeros(n * size, dtype=bool))
        self._eliminated.extend(np.zeros(n, dtype=bool))
        self._context_start.extend((len(self._context) if width else 0) + width * np.arange(n))
        self._context.extend(context)
        return np.arange(first, first + n)

    def _columns(self) -> tuple[GrowingArray[Any], ...]:
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

    def _cut(self, lengths: tuple[int, ...]) -> None:
        """Takes away what was added since the table had these lengths."""
        n, families, *others = lengths
        self._known.cut(n)
        del self.names[n:], self._components[families:]
        self._curved = (0, [])
        for column, length in zip(self._columns(), others, strict=True):
            column.cut(length)

    def find(self, names: Sequence[str], label: str) -> IntArray:
        """Ids of blocks of one kind by name; the kind by its label, in any case."""
        return self._known.find(names, label)

    def called(self, label: str) -> dict[str, int]:
        """Ids of all blocks of a kind by name; none where there is no block of that kind."""
        return self._known.called(label)

    def checked(self, ids: ArrayLike, what: str) -> IntArray:
        """Ids as a 1-D int64 array; an error when one of them is no block."""
        array = ids if type(ids) is np.ndarray and ids.ndim else np.atleast_1d(plain(ids, what))
        if array.ndim != 1 or (array.size and array.dtype.kind not in "iu"):
            raise InputError(f"{what}: block ids must be a 1-D array of integers")
        array = array.astype(np.int64)
        if array.size and array.view(np.uint64).max() >= len(self):  # the negative ones are the largest
            wrong = np.flatnonzero((array < 0) | (array >= len(self)))
            raise InputError(
                f"{what}: row {wrong[0]} has block id {array[wrong[0]]}; ids go from 0 to {len(self) - 1}"
            )
        return array

    def uniform(self, ids: ArrayLike, what: str) -> tuple[IntArray, Manifold, int]:
        """Ids that must all be of one kind and size, with this kind and size."""
        array = self.checked(ids, what)
        if not array.size:
            raise InputError(f"{what}: no block ids")
        kind, size = self._kind.view[array], self.size[array]
        if len(array) > 1 and np.count_nonzero(other := (kind != kind[0]) | (size != size[0])):
            raise InputError(
                f"{what}: {self._described(array[0])} and {self._described(array[other][0])} are not alike; "
                "treat them in two calls"
            )
        return array, self.manifolds[int(kind[0])], int(size[0])

    def _described(self, block: int) -> str:
        return f"{self.names[block]!r} ({self.manifold(block).label}, {self.size[block]})"

    def scalars(self, ids: ArrayLike, what: str = "ids") -> IntArray:
        """(n, size) positions in `values` of the unknowns of blocks that are alike."""
        array, _, size = self.uniform(ids, what)
        return self.consecutive(array, size)

    def consecutive(self, ids: IntArray, size: int) -> IntArray:
        """(n, size) positions in `values` of the unknowns of blocks of this size."""
        return np.asarray(self.start[ids][:, None] + np.arange(size))

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
        if isinstance(components, str) and any(components in called(name) for name in known):
            components = (components,)
        if not isinstance(components, Iterable):
            raise InputError(f"{what}: a list of components is wanted, not {components!r}")
        chosen = [component_number(known, component, size, what) for component in components]
        return np.asarray(self.start[array][:, None] + np.array(chosen, dtype=np.int64))

    def set_frozen(self, ids: ArrayLike, components: Sequence[str | int] | None, frozen: bool) -> None:
        """Freezes or frees chosen components (all when None) of blocks that are alike."""
        index = self.component_index(ids, components, "freeze" if frozen else "unfreeze")
        self.owner.check()
        self.frozen[index] = frozen

    def see_from(self, ids: ArrayLike, places: FloatArray) -> None:
        """Lets points move by steps of their inverse distances from places (n, 3); see `Perspective`."""
        self._perspectives.append(Perspective(self.scalars(ids, "see_from"), places))

    @property
    def is_flat(self) -> bool:
        """Whether every step is simply added."""
        return not self.curved and not self._perspectives

    @property
    def is_seen(self) -> BoolArray:
        """(n_scalars,) True for the points that move in their inverse distance."""
        seen = np.zeros(self.n_scalars, dtype=bool)
        for points in self._perspectives:
            seen[points.scalars] = True
        return seen

    def set_eliminated(self, ids: ArrayLike, eliminated: bool) -> None:
        """Marks blocks as to be eliminated, or not."""
        blocks = self.checked(ids, "eliminate")
        self.owner.check()
        self.eliminated[blocks] = eliminated

    def read(self, ids: ArrayLike, state: State | None = None) -> FloatArray:
        """Current values: (n, size) for points, vectors, scalars; (n, 3, 3) rotations; (n, 3) directions."""
        array, manifold, size = self.uniform(ids, "values")
        values = self.values if state is None else state.values
        context = self._context.view if state is None else state.context
        return manifold.joined(
            values[self.consecutive(array, size)], context[self._context_places(array, manifold)]
        )

    def write(self, ids: ArrayLike, new: ArrayLike) -> None:
        """Gives blocks that are alike new values, in the shape that `read` returns."""
        self.owner.check()
        array, manifold, size = self.uniform(ids, "set_values")
        given = finite(new, (len(array), *manifold.shape(size)), "set_values")
        names = [self.names[block] for block in array.tolist()]
        unknowns, context = manifold.split(manifold.checked(given, names, "set_values"))
        self.values[self.consecutive(array, size)] = unknowns
        self._context.view[self._context_places(array, manifold)] = context

    def _context_places(self, ids: IntArray, manifold: Manifold) -> IntArray:
        """(n, context size) positions of the context of blocks of one kind."""
        return np.asarray(self.context_start[ids][:, None] + np.arange(manifold.context_size))

    def state(self) -> State:
        """A copy of values and context."""
        return State(self.values.copy(), self._context.view.copy())

    def restore(self, state: State) -> None:
        """Comes back to a state; blocks added since keep their values."""
        self.values[: len(state.values)] = state.values
        self._context.view[: len(state.context)] = state.context
        self._lead()

    def followed_by(self, renew: Callable[[], None]) -> None:
        """Has a method called wherever the values have moved or come back, as long as its object lives."""
        self._followers.append(WeakMethod(renew))

    def _lead(self) -> None:
        """Renews what follows from the values."""
        for follower in self._followers:
            renew = follower()
            if renew is not None:
                renew()

    def move(self, step: FloatArray) -> None:
        """Moves all unknowns by a step (n_scalars,); rotations and directions absorb theirs and are reset."""
        for points in self._perspectives:
            step = points.stretched(self.values, step, self.frozen)
        values = self.values + step
        for blocks in self.curved:
            self._absorb(blocks, values)
        self.values[:] = values
        self._lead()

    def _absorb(self, blocks: CurvedBlocks, values: FloatArray) -> None:
        small, places = values[blocks.scalars], blocks.places
        moved = small.any(axis=1)
        count = np.count_nonzero(moved)
        if not count:
            return
        values[blocks.scalars] = 0.0
        if count < moved.size:
            small, places = small[moved], places[moved]
        self._context.view[places] = blocks.manifold.moved(self._context.view[places], small)
