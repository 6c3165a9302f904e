"""Unknowns as objects: a script keeps its points, poses and cameras, and the adjustment moves them.

An object is attached to a system once; its values become blocks of unknowns, and after every accepted step
they are written back to the object. Its `on_update` may then re-parametrise: what it changes in the object
is read back by the system before the next linearisation.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from functools import partial
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.leastsquares.problem.arguments import text
from obseq.leastsquares.problem.manifolds import Manifold
from obseq.leastsquares.problem.unknowns import UnknownTable


class Blocks(Protocol):
    """What objects need of a system: the values of its blocks."""

    def add_blocks(self, manifold: Manifold, names: Sequence[str], values: ArrayLike) -> IntArray:
        """Adds blocks of a kind of unknown."""

    def values(self, ids: ArrayLike) -> FloatArray:
        """Current values of blocks that are alike."""

    def set_values(self, ids: ArrayLike, values: ArrayLike) -> None:
        """Gives blocks that are alike new current values."""


@dataclass(eq=False)
class UnknownObject:
    """Base of objects with unknowns; a subclass says which of its attributes are blocks of unknowns.

    Attributes:
        name: Name of the object; its blocks are called `name`, or `name.part`.
        ids: Block of each part, once attached.
    """

    parts: ClassVar[Mapping[str, str | Manifold]] = {}
    """Attribute of the object -> method of the system that adds it, or kind of unknown that it is."""

    name: str
    ids: dict[str, IntArray] = field(default_factory=dict, init=False, repr=False)

    def on_update(self) -> None:
        """Called after every accepted step, once the object has its new values; may change them."""

    def component_names(self, part: str) -> Sequence[str] | None:
        """Names of the components of a vector part; None for numbers."""
        del part
        return None

    def attach(self, system: Blocks) -> None:
        """Adds the blocks of this object to a system."""
        if self.ids:
            raise InputError(f"{self.name} is already attached to a system; an object belongs to one")
        for part in self.parts:
            name = self.name if len(self.parts) == 1 else f"{self.name}.{part}"
            values = np.asarray(getattr(self, part), dtype=np.float64)[None]
            names = self.component_names(part)
            more = () if names is None else (names,)
            self.ids[part] = self._adder(system, part)([name], values, *more)

    def _adder(self, system: Blocks, part: str) -> Callable[..., IntArray]:
        kind = self.parts[part]
        return partial(system.add_blocks, kind) if isinstance(kind, Manifold) else getattr(system, kind)

    def pull(self, system: Blocks) -> None:
        """Takes its values from the system."""
        for part, ids in self.ids.items():
            values = system.values(ids)[0]
            setattr(self, part, values if np.ndim(getattr(self, part)) else float(values[0]))

    def push(self, system: Blocks) -> None:
        """Gives its values to the system."""
        for part, ids in self.ids.items():
            system.set_values(ids, np.asarray(getattr(self, part), dtype=np.float64)[None])


@dataclass(eq=False)
class Scalar(UnknownObject):
    """One unknown number."""

    parts: ClassVar[Mapping[str, str | Manifold]] = {"value": "add_scalars"}
    value: float


@dataclass(eq=False)
class Vector(UnknownObject):
    """Several unknown numbers, with names if they have some."""

    parts: ClassVar[Mapping[str, str | Manifold]] = {"values": "add_vectors"}
    values: ArrayLike
    names: Sequence[str] | None = None

    def component_names(self, part: str) -> Sequence[str] | None:
        """The names given."""
        return self.names


@dataclass(eq=False)
class Point(UnknownObject):
    """A point of the plane or of space, metres."""

    parts: ClassVar[Mapping[str, str | Manifold]] = {"coordinates": "add_points"}
    coordinates: ArrayLike


@dataclass(eq=False)
class Direction(UnknownObject):
    """A unit vector of space."""

    parts: ClassVar[Mapping[str, str | Manifold]] = {"vector": "add_directions"}
    vector: ArrayLike


@dataclass(eq=False)
class Rotation(UnknownObject):
    """A rotation from a local frame to the world, (3, 3)."""

    parts: ClassVar[Mapping[str, str | Manifold]] = {"matrix": "add_rotations"}
    matrix: ArrayLike


@dataclass(eq=False)
class UnknownPose(UnknownObject):
    """A local frame in the world: centre (3,) and rotation from local to world (3, 3)."""

    parts: ClassVar[Mapping[str, str | Manifold]] = {"centre": "add_points", "rotation": "add_rotations"}
    centre: ArrayLike
    rotation: ArrayLike


@dataclass(eq=False)
class Calibration(Vector):
    """Interior orientation: F, PPx, PPy and the distortion coefficients, in the order of the formulas."""


def synchronise(system: Blocks, objects: Sequence[UnknownObject]) -> None:
    """Writes current values to the objects, lets them update themselves, and reads back their changes."""
    for item in objects:
        item.pull(system)
        if type(item).on_update is not UnknownObject.on_update:
            item.on_update()
            item.push(system)


def matching(table: UnknownTable, pattern: str) -> dict[int, list[int]]:
    """Components whose full name (`PtA.x`, `camera.rotation.z`) matches a regular expression as a whole.

    Returns:
        Numbers of the components of each block concerned.

    Raises:
        InputError: The pattern is no regular expression, or nothing matches it.
    """
    try:
        expression = re.compile(text(pattern, "matching"))
    except re.error as error:
        raise InputError(f"{pattern!r} is not a regular expression: {error}") from None
    found: dict[int, list[int]] = {}
    for scalar, name in enumerate(table.component_names(np.arange(table.n_scalars))):
        if expression.fullmatch(name):
            block = int(np.searchsorted(table.start, scalar, side="right") - 1)
            found.setdefault(block, []).append(scalar - int(table.start[block]))
    if not found:
        raise InputError(f"no unknown has a name that matches {pattern!r}")
    return found
