"""The kinds of unknowns of a system, ids of blocks of each kind by name, components of a block."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from obseq.arrays import IntArray
from obseq.errors import InputError
from obseq.leastsquares.problem.arguments import texts, whole
from obseq.leastsquares.problem.manifolds import MANIFOLDS, Manifold


class BlockNames:
    """Ids of blocks by kind and name; blocks of two kinds may have one name.

    Attributes:
        manifolds: kinds of blocks, those that every system knows first.
    """

    def __init__(self) -> None:
        self.manifolds: list[Manifold] = list(MANIFOLDS)
        self._ids: list[dict[str, int]] = [{} for _ in MANIFOLDS]

    def kind_of(self, manifold: Manifold) -> int:
        """The number of a kind, which is added when it is new."""
        for number, known in enumerate(self.manifolds):
            if known is manifold:  # to compare all that is said of them takes ten times as long
                return number
        if manifold not in self.manifolds:
            if any(manifold.label.upper() == known.label.upper() for known in self.manifolds):
                raise InputError(f"another kind of unknown is called {manifold.label!r} already")
            self._ids.append({})
            self.manifolds.append(manifold)
        return self.manifolds.index(manifold)

    def numbered(self, kind: int, names: Sequence[str], first: int) -> dict[str, int]:
        """The ids, from `first`, of new blocks of a kind by name; the names must be new, and different."""
        known = self._ids[kind]
        ids = dict(zip(names, range(first, first + len(names)), strict=True))
        if len(ids) != len(names) or not known.keys().isdisjoint(ids.keys()):
            counts = Counter(names)
            repeated = next(name for name in names if name in known or counts[name] > 1)
            label = self.manifolds[kind].label
            raise InputError(f"the {label} {repeated!r} is there twice: give each one its own name")
        return ids

    def add(self, kind: int, ids: dict[str, int]) -> None:
        """Keeps the ids of new blocks of a kind."""
        self._ids[kind].update(ids)

    def cut(self, n: int) -> None:
        """Forgets the blocks from id `n` on."""
        for known in self._ids:
            for name in [name for name, block in known.items() if block >= n]:
                del known[name]

    def called(self, label: str) -> dict[str, int]:
        """Ids of all blocks of a kind by name; none where there is no block of that kind."""
        kinds = [kind for kind, manifold in enumerate(self.manifolds) if manifold.label == label]
        return self._ids[kinds[0]] if kinds else {}

    def find(self, names: Sequence[str], label: str) -> IntArray:
        """Ids of blocks of one kind by name; the kind by its label, in any case."""
        kind = self._kind_called(label)
        what, known = self.manifolds[kind].label, self._ids[kind]
        try:
            return np.array([known[name] for name in texts(names, f"names of {what}")], dtype=np.int64)
        except KeyError as error:
            raise InputError(f"no {what} is called {error.args[0]!r}") from None

    def _kind_called(self, label: str) -> int:
        labels = [manifold.label for manifold in self.manifolds]
        upper = [known.upper() for known in labels]
        if not isinstance(label, str) or label.upper() not in upper:
            raise InputError(f"no kind of unknown is called {label!r}; there are {', '.join(labels)}")
        return upper.index(label.upper())


def component_number(known: tuple[str, ...], component: str | int, size: int, what: str) -> int:
    """Number of a component given by name or by number."""
    if isinstance(component, str):
        for number, name in enumerate(known):
            if component in called(name):
                return number
        raise InputError(f"{what}: no component {component!r}; there are {', '.join(known)}")
    number = whole(component, f"{what}, component")
    if not 0 <= number < size:
        raise InputError(f"{what}: no component {number}; they go from 0 to {size - 1}")
    return number


def called(component: str) -> tuple[str, str]:
    """What a component may be called: `rotation.x`, or `x`."""
    return component, component.rpartition(".")[2]
