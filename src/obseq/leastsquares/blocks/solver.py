"""The solver of matrices in parts, behind the protocol of all solvers: every kind of equation has it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.leastsquares.blocks import tasks
from obseq.leastsquares.blocks.files import (
    Value,
    digest_of,
    read_numbers,
    read_object,
    write_numbers,
    write_object,
)
from obseq.leastsquares.blocks.partition import Tree, entries_of
from obseq.leastsquares.solvers.base import AT_ONCE, NUMBERS, BaseSolver
from obseq.leastsquares.solvers.protocol import Defect, SolverStatistics

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.arrays import FloatArray, IndexArray, IntArray
    from obseq.leastsquares.blocks.blocks import Run
    from obseq.leastsquares.blocks.partition import Partition
    from obseq.leastsquares.solvers.protocol import SymmetricPattern

OF_A_FACTOR = ("factor", "rest", "values", "inverse", "outer")
"""Files that go when there is another factor; the small ones stay, for who resumes."""


class BlockSolver(BaseSolver):
    """Eliminates the parts of a matrix, those below first, from files to files.

    Args:
        run: where the files are, who does the work, how large parts may be.
    """

    name = "blocks"

    def __init__(self, run: Run) -> None:
        super().__init__()
        self._run = run
        self._keys: list[str] = []

    def _analyse(self, pattern: SymmetricPattern) -> None:
        folder = self._run.folder
        self._partition = partition = self._run.cut(Tree(pattern), pattern)
        self._above = _parents(partition)
        entries = entries_of(pattern, partition)
        self._parts: list[str] = []
        for k in range(len(partition.parts)):
            given = _entries(pattern, partition, k, entries[k])
            self._parts.append(digest_of(entries[k], *given))
            write_numbers(folder / f"places-{self._parts[k]}", entries[k])
            if not (folder / f"prepared-{self._parts[k]}").exists():
                write_object(folder / f"entries-{self._parts[k]}", given)
        del entries
        sizes = self._upwards(lambda k, _: (tasks.prepare, self._parts[k]))
        self._run.analysed(partition, sizes)
        self._sizes = sizes

    def _factor(self, values: FloatArray, tolerance: float) -> Defect:
        self._values_now = values
        self._tolerance = tolerance
        partition, old = self._partition, self._keys
        self._keys = []
        for k, part in enumerate(partition.parts):
            below = [self._keys[child] for child in part.children]
            self._keys.append(digest_of(self._parts[k], tolerance, self._own_values(k), *below))
        if old != self._keys:
            self._forget({*old, *self._inverse_names(old)} - set(self._keys))
        kept = [self._kept_defect(k) for k in range(len(self._keys))]
        found = [defect for defect in kept if defect is not None]
        if len(found) < len(kept):
            found = self._eliminated()
        unknowns = [partition.unknowns[part.own] for part in partition.parts]
        indices = np.concatenate([own[one.indices] for own, one in zip(unknowns, found, strict=True)])
        pivots = np.concatenate([one.pivots for one in found])
        order = np.argsort(indices)
        weakest = min((one.weakest for one in found), default=1.0)
        return Defect(indices[order].astype(np.int64), pivots[order], weakest)

    @staticmethod
    def _inverse_names(keys: list[str]) -> list[str]:
        """The name of the inverse of each part of a factor: it depends on all of them."""
        return [digest_of(k, *keys) for k in range(len(keys))]

    def _own_values(self, k: int) -> FloatArray:
        places = np.fromfile(self._run.folder / f"places-{self._parts[k]}", np.int32)
        return self._values_now[places]

    def _kept_defect(self, k: int) -> Defect | None:
        """What a run that was stopped found of a part."""
        place = self._run.folder / f"defect-{self._keys[k]}"
        return read_object(place) if place.exists() else None

    def _eliminated(self) -> list[Defect]:
        """Eliminates the parts whose factor is not there: of a stopped run the small files may be alone."""
        return self._upwards(self._elimination)

    def _elimination(self, k: int, _: list[Value]) -> tuple[Value, ...]:
        key, below = self._keys[k], self._keys_below(k)
        if not self._has_factor(key):
            write_numbers(self._run.folder / f"values-{key}", self._own_values(k))
        return tasks.eliminate, self._parts[k], key, below, self._tolerance

    def _has_factor(self, key: str) -> bool:
        return all((self._run.folder / f"{kind}-{key}").exists() for kind in tasks.OF_AN_ELIMINATION)

    def _complete(self) -> None:
        if not all(map(self._has_factor, self._keys)):
            self._eliminated()

    def _keys_below(self, k: int) -> tuple[str, ...]:
        return tuple(self._keys[child] for child in self._partition.parts[k].children)

    def _solve(self, rhs: FloatArray) -> FloatArray:
        place = self._run.folder / f"solution-{digest_of(*self._keys, rhs)}"
        if place.exists():
            return read_numbers(place).reshape(rhs.shape)
        self._complete()
        partition = self._partition
        turned = rhs[partition.unknowns]
        rights = [turned[part.own] for part in partition.parts]
        children = [part.children for part in partition.parts]

        def below(k: int, rests: list[Value]) -> list[tuple[int, FloatArray]]:
            return [(at, rests[child]) for at, child in enumerate(children[k])]

        rests = self._upwards(
            lambda k, done: (tasks.reduce, self._parts[k], self._keys[k], rights[k], below(k, done))
        )
        found = np.empty_like(turned)
        outer: list[FloatArray] = [np.zeros((0, rhs.shape[1]))] * len(children)

        def take(k: int, solutions: tuple[FloatArray, ...]) -> None:
            own, *given = solutions
            found[partition.parts[k].own] = own
            for child, solution in zip(children[k], given, strict=True):
                outer[child] = solution

        self._downwards(
            lambda k: (tasks.expand, self._parts[k], self._keys[k], rights[k], below(k, rests), outer[k]),
            take,
        )
        result = np.empty_like(turned)
        result[partition.unknowns] = found
        if self._run.is_kept and rhs.shape[1] == 1:
            write_numbers(place, result)
        return result

    def _selected_inverse(self) -> FloatArray:
        self._complete()
        selected, folder = np.empty(self.pattern.nnz), self._run.folder

        names = self._inverse_names(self._keys)

        def take(k: int, _: None) -> None:
            places = np.fromfile(folder / f"places-{self._parts[k]}", np.int32)
            selected[places] = read_numbers(folder / f"inverse-{names[k]}")

        def below(k: int) -> tuple[str, ...]:
            return tuple(names[child] for child in self._partition.parts[k].children)

        self._downwards(lambda k: (tasks.invert, self._parts[k], self._keys[k], names[k], below(k)), take)
        self._values_now = np.empty(0)  # the factor is in its files: nothing asks for them any more
        return selected

    def quadratic_forms(self, values: FloatArray, columns: IndexArray, starts: IntArray) -> FloatArray:
        """(k,) b N^-1 b' of sparse rows b: what they meet of the parts is read, and what is above that."""
        self._complete()
        place = np.empty(self.pattern.n, np.int64)
        place[self._partition.unknowns] = np.arange(self.pattern.n)
        places, result = place[columns], np.zeros(len(starts) - 1)
        row, part = np.repeat(np.arange(len(result)), np.diff(starts)), self._partition.part_of[places]
        order = np.argsort(np.append(part, 0)[starts[:-1]], kind="stable")
        widest = max(len(one.own) + len(one.outer) for one in self._partition.parts)
        many = max(1, min(AT_ONCE, NUMBERS // (2 * max(widest, 1))))  # in two orders
        for first in range(0, len(order), many):
            chosen = order[first : first + many]
            number = np.full(len(result), -1)
            number[chosen] = np.arange(len(chosen))
            own = number[row] >= 0
            result[chosen] = self._squares(len(chosen), places[own], part[own], number[row[own]], values[own])
        return result

    def _squares(
        self, k: int, places: IntArray, part_of: IndexArray, column: IntArray, values: FloatArray
    ) -> FloatArray:
        """The same of k rows, from the part, the row and the place in the order of elimination of entries."""
        parts, met, found = self._partition.parts, set[int](), np.zeros(k)
        for at in set(part_of.tolist()):
            while at >= 0 and at not in met:
                met.add(at)
                at = self._above[at]
        which = sorted(met)
        rests: dict[int, FloatArray] = {}

        def work(task: int) -> tuple[Value, ...]:
            at, own = which[task], part_of == which[task]
            entries = np.searchsorted(parts[at].own, places[own]), column[own], values[own]
            below = [(i, rests.pop(child)) for i, child in enumerate(parts[at].children) if child in met]
            return tasks.square, self._parts[at], self._keys[at], entries, k, below

        def take(task: int, given: tuple[FloatArray, FloatArray]) -> None:
            rests[which[task]], squares = given
            found[:] += squares

        number = {at: task for task, at in enumerate(which)}
        waits = [[number[child] for child in parts[at].children if child in met] for at in which]
        self._run.do(waits, work, take)
        return found

    def _upwards(self, work: Callable[[int, list[Value]], tuple[Value, ...]]) -> list[Value]:
        """What a task gives of each part, those below first; `work` gets what was found so far."""
        done: list[Value] = [None] * len(self._partition.parts)
        waits = [part.children for part in self._partition.parts]
        self._run.do(waits, lambda k: work(k, done), done.__setitem__)
        return done

    def _downwards(
        self, work: Callable[[int], tuple[Value, ...]], take: Callable[[int, Value], None]
    ) -> None:
        """Gives what a task finds of each part, those above first."""
        waits = [() if above < 0 else (above,) for above in self._above]
        self._run.do(waits, work, take)

    def _forget(self, keys: set[str]) -> None:
        for key in keys:
            for kind in OF_A_FACTOR:
                (self._run.folder / f"{kind}-{key}").unlink(missing_ok=True)

    @property
    def statistics(self) -> SolverStatistics:
        """Size of the factorisation."""
        factor, room = np.array(self._sizes).sum(axis=0)
        n, nnz = self.pattern.n, self.pattern.nnz
        return SolverStatistics(self.name, "metis", n, nnz, int(factor) // 8, 0.0, int(room))


def _parents(partition: Partition) -> list[int]:
    above = [-1] * len(partition.parts)
    for k, part in enumerate(partition.parts):
        for child in part.children:
            above[child] = k
    return above


def _entries(pattern: SymmetricPattern, partition: Partition, k: int, entries: IndexArray) -> tasks.Entries:
    """The matrix of a part, its unknowns counted among its own and outer ones."""
    part = partition.parts[k]
    members = np.concatenate([part.own, part.outer])
    local = np.full(pattern.n, -1, np.int32)
    local[partition.unknowns[members]] = np.arange(len(members), dtype=np.int32)
    columns = np.searchsorted(pattern.indptr, entries, "right") - 1
    row, column = local[pattern.indices[entries]], local[columns]
    children = tuple(local[partition.unknowns[partition.parts[child].outer]] for child in part.children)
    low, high = np.minimum(row, column), np.maximum(row, column)
    return tasks.Entries(len(part.own), len(members), high, low, children)
