"""Blocks of unknowns as users add them, kind by kind, and change, freeze, eliminate and read them."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike

from obseq.arrays import FloatArray, IntArray
from obseq.errors import InputError
from obseq.leastsquares.problem.arguments import block_names, finite, table_of_rows, texts
from obseq.leastsquares.problem.manifolds import (
    DIRECTION,
    POINT2,
    POINT3,
    ROTATION,
    SCALAR,
    VECTOR,
    Manifold,
)
from obseq.leastsquares.problem.unknown_objects import UnknownObject, matching
from obseq.leastsquares.problem.unknowns import UnknownTable


class UnknownBlocks:
    """The blocks of a table of unknowns, as users add and change them.

    Attributes:
        objects: objects whose values are blocks.
    """

    def __init__(self, table: UnknownTable) -> None:
        self._table = table
        self.objects: list[UnknownObject] = []

    def add_points(self, names: Sequence[str], coordinates: ArrayLike) -> IntArray:
        """Adds points of (n, 3) or (n, 2) coordinates, in metres; returns their ids."""
        names = block_names(names, "add_points")
        array = table_of_rows(coordinates, len(names), "add_points")
        if array.shape[1] not in (2, 3):
            raise InputError(f"add_points: coordinates have {array.shape[1]} columns; expected 2 or 3")
        return self._table.add(POINT3 if array.shape[1] == 3 else POINT2, names, array)

    def add_rotations(self, names: Sequence[str], matrices: ArrayLike) -> IntArray:
        """Adds rotations from a local frame to the world frame, (n, 3, 3); returns their ids."""
        return self._add_shaped(ROTATION, names, matrices, "add_rotations")

    def add_directions(self, names: Sequence[str], vectors: ArrayLike) -> IntArray:
        """Adds unit directions, given by vectors (n, 3) of any length but zero; returns their ids."""
        return self._add_shaped(DIRECTION, names, vectors, "add_directions")

    def add_vectors(
        self, names: Sequence[str], values: ArrayLike, component_names: Sequence[str] | None = None
    ) -> IntArray:
        """Adds vectors of unknowns, (n, k); `component_names` (k,) are for messages; returns their ids."""
        names = block_names(names, "add_vectors")
        array = table_of_rows(values, len(names), "add_vectors")
        size = array.shape[1]
        numbers = [str(number) for number in range(size)]
        components = texts(component_names or numbers, "add_vectors, component_names")
        if len(components) != size or not size:
            raise InputError(f"add_vectors: {len(components)} component names for vectors of {size}")
        return self._table.add(VECTOR, names, array, components)

    def add_scalars(self, names: Sequence[str], values: ArrayLike) -> IntArray:
        """Adds single unknowns, values (n,); returns their ids."""
        names = block_names(names, "add_scalars")
        array = finite(values, (len(names),), "add_scalars")
        return self._table.add(SCALAR, names, array[:, None])

    def add_blocks(self, manifold: Manifold, names: Sequence[str], values: ArrayLike) -> IntArray:
        """Adds blocks of a kind of unknown, which may be one's own (see `Manifold`); returns their ids.

        Args:
            manifold: the kind; it names the components.
            names: (n,) names of the blocks.
            values: (n, ...) their values, in the shape that the kind says.
        """
        if not isinstance(manifold, Manifold) or not manifold.components:
            raise InputError(
                f"add_blocks: a kind of unknown with components is wanted, a Manifold; not {manifold!r}"
            )
        return self._add_shaped(manifold, names, values, "add_blocks")

    def _add_shaped(self, manifold: Manifold, names: Sequence[str], values: ArrayLike, what: str) -> IntArray:
        names = block_names(names, what)
        shape = manifold.shape(len(manifold.components))
        return self._table.add(manifold, names, finite(values, (len(names), *shape), what), what=what)

    def ids(self, names: Sequence[str], kind: str = "Point3") -> IntArray:
        """Ids by name of blocks of a kind: Point3, Point2, Rotation, Direction, Vector, Scalar or yours."""
        return self._table.find(names, kind)

    def values(self, ids: ArrayLike) -> FloatArray:
        """Current values of blocks that are alike: (n, k); (n, 3, 3) for rotations; (n, 3) for directions."""
        return self._table.read(ids)

    def set_values(self, ids: ArrayLike, values: ArrayLike) -> None:
        """Gives blocks that are alike new current values, in the shape that `values` returns."""
        self._table.write(ids, values)

    def freeze(self, ids: ArrayLike, components: Sequence[str | int] | None = None) -> None:
        """Keeps unknowns at their current values: whole blocks, or components by number or by name."""
        self._table.set_frozen(ids, components, True)

    def freeze_matching(self, pattern: str, frozen: bool = True) -> None:
        """Freezes (or frees) all unknowns whose full name (`camera.rotation.z`) matches an expression."""
        for block, components in matching(self._table, pattern).items():
            self._table.set_frozen([block], components, frozen)

    def unfreeze(self, ids: ArrayLike, components: Sequence[str | int] | None = None) -> None:
        """Frees unknowns again."""
        self._table.set_frozen(ids, components, False)

    def eliminate(self, ids: ArrayLike, eliminated: bool = True) -> None:
        """Marks blocks to be eliminated from the normal equations before these are solved (Schur complement).

        The solution is the same, and so are residuals, redundancy and covariances; it comes sooner when
        there are many such blocks that meet few others each, such as tie points. Eliminated blocks that
        observations join to one another, such as centre and rotation of a pose, form a group.

        Args:
            ids: blocks.
            eliminated: False to treat them as others again.
        """
        self._table.set_eliminated(ids, eliminated)

    def attach(self, *objects: UnknownObject) -> None:
        """Adds the unknowns of objects; they get the values of every accepted state (see `objects`)."""
        for item in objects:
            if not isinstance(item, UnknownObject):
                raise InputError(
                    f"attach: objects with unknowns are wanted (Point, UnknownPose, ...), not {item!r}"
                )
            item.attach(self)
            self.objects.append(item)
