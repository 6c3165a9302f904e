"""What is done with one part, by this process or by any worker: from files to files, the same each time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from obseq.arrays import FloatArray, IndexArray, IntArray
from obseq.errors import InputError
from obseq.leastsquares.blocks.files import (
    VERSIONS,
    Value,
    read_numbers,
    read_object,
    write_numbers,
    write_object,
)
from obseq.leastsquares.solvers.blas import one_blas_thread
from obseq.leastsquares.solvers.cholesky import SupernodalCholesky
from obseq.leastsquares.solvers.protocol import Defect, SymmetricPattern

OF_AN_ELIMINATION = ("defect", "factor", "rest")
"""Files of an elimination, the one that is written last first."""


class Entries(NamedTuple):
    """The matrix of a part; its unknowns are counted in the order of elimination, own ones before outer ones.

    Attributes:
        own: number of its own unknowns.
        n: number of all its unknowns.
        rows, columns: (k,) of its entries, in the order in which their values come.
        children: for each part below, where its outer unknowns are here, ascending.
    """

    own: int
    n: int
    rows: IndexArray
    columns: IndexArray
    children: tuple[IndexArray, ...]


class Prepared(NamedTuple):
    """A part whose pattern was analysed.

    Attributes:
        own: number of its own unknowns.
        solver: without a factor.
        entries: (k,) places of its entries among the values of its pattern.
        children: for each part below, places of the lower triangle of what it leaves, column by column.
    """

    own: int
    solver: SupernodalCholesky
    entries: IndexArray
    children: tuple[IndexArray, ...]


def task(versions: str, function: Callable[..., Value], folder: str, *arguments: Value) -> Value:
    """Does a task, if this process makes the same numbers as the one that asks.

    Raises:
        InputError: it has other versions.
    """
    if versions != VERSIONS:
        raise InputError(f"a worker has {VERSIONS}, this process {versions}: give them the same")
    with one_blas_thread():
        return function(Path(folder), *arguments)


def prepare(folder: Path, part: str) -> tuple[int, int]:
    """Analyses a part; returns bytes of its factor and of the room that an elimination takes beside."""
    place = folder / f"prepared-{part}"
    if not place.exists():
        write_object(place, _prepared(read_object(folder / f"entries-{part}")))
    (folder / f"entries-{part}").unlink(missing_ok=True)
    statistics = read_object(place).solver.statistics
    return 8 * statistics.nnz_factor, statistics.memory


def _prepared(given: Entries) -> Prepared:
    key = given.columns.astype(np.int64) * given.n + given.rows
    outer = np.arange(given.own, given.n) * (given.n + 1)
    cliques = [_triangle(child, given.n) for child in given.children]
    keys = np.sort(np.concatenate([key, outer, *cliques]))
    keys = keys[np.append(True, keys[1:] != keys[:-1])]
    indptr = np.searchsorted(keys, np.arange(given.n + 1) * given.n)
    pattern = SymmetricPattern(given.n, indptr, (keys % max(given.n, 1)).astype(np.int32))
    solver = SupernodalCholesky(ordering="natural", last=np.arange(given.own, given.n))
    solver.analyse(pattern)
    solver.take_factor()
    places = [np.searchsorted(keys, wanted).astype(np.int32) for wanted in (key, *cliques)]
    return Prepared(given.own, solver, places[0], tuple(places[1:]))


def _triangle(places: IndexArray, n: int) -> IntArray:
    """Keys of the lower triangle over ascending places, column by column."""
    wide = places.astype(np.int64)
    columns = [wide[k] * n + wide[k:] for k in range(len(wide))]
    return np.concatenate(columns) if columns else np.zeros(0, np.int64)


def eliminate(folder: Path, part: str, key: str, children: tuple[str, ...], tolerance: float) -> Defect:
    """Eliminates a part from the values of its entries and what the parts below left; keeps the factor."""
    names = [folder / f"{kind}-{key}" for kind in OF_AN_ELIMINATION]
    if all(name.exists() for name in names):
        found: Defect = read_object(names[0])
        return found
    prepared: Prepared = read_object(folder / f"prepared-{part}")
    solver, values = prepared.solver, np.zeros(prepared.solver.pattern.nnz)
    values[prepared.entries] = read_numbers(folder / f"values-{key}")
    diagonal = values[solver.pattern.diagonal]
    for places, child in zip(prepared.children, children, strict=True):
        values[places] += read_numbers(folder / f"rest-{child}")
    solver.put_factor()
    defect = solver.eliminate_replacing(values, tolerance, diagonal)
    write_numbers(names[2], solver.schur_columns())
    write_numbers(names[1], solver.take_factor())
    write_object(names[0], defect)
    return defect


def reduce(
    folder: Path, part: str, key: str, right: FloatArray, given: list[tuple[int, FloatArray]]
) -> FloatArray:
    """(m, k) what a part leaves of right-hand sides, from those of its own unknowns and of parts below."""
    prepared, solver = _factored(folder, part, key)
    return solver.reduce(_gathered(folder, prepared, right, given))


def square(
    folder: Path,
    part: str,
    key: str,
    entries: tuple[IntArray, IntArray, FloatArray],
    k: int,
    given: list[tuple[int, FloatArray]],
) -> tuple[FloatArray, FloatArray]:
    """The same, and (k,) the squares of what is found of its own unknowns: together they are b' N^-1 b.

    Of k right-hand sides the entries are given: rows, columns, values.
    """
    (prepared, solver), (rows, columns, values) = _factored(folder, part, key), entries
    right = np.zeros((prepared.own, k))
    np.add.at(right, (rows, columns), values)
    return solver.reduce_and_square(_gathered(folder, prepared, right, given))


def expand(
    folder: Path,
    part: str,
    key: str,
    right: FloatArray,
    given: list[tuple[int, FloatArray]],
    outer: FloatArray,
) -> tuple[FloatArray, ...]:
    """Solutions (n, k) of the own unknowns of a part, and of the outer ones of each part below."""
    prepared, solver = _factored(folder, part, key)
    found = solver.expand(_gathered(folder, prepared, right, given), outer)
    pattern = solver.pattern
    return found[: prepared.own], *(found[_members(pattern, places)] for places in prepared.children)


def _gathered(
    folder: Path, prepared: Prepared, right: FloatArray, given: list[tuple[int, FloatArray]]
) -> FloatArray:
    if prepared.own == prepared.solver.pattern.n and not given:
        return right
    whole = np.zeros((prepared.solver.pattern.n, right.shape[1]))
    whole[: prepared.own] = right
    for child, rest in given:
        whole[_members(prepared.solver.pattern, prepared.children[child])] += rest
    return whole


def _members(pattern: SymmetricPattern, places: IndexArray) -> IntArray:
    """The unknowns of a triangle: its first column has all of them."""
    return pattern.indices[places[: _order(len(places))]].astype(np.int64)


def _order(entries: int) -> int:
    """The order of a triangle with so many entries."""
    return int((np.sqrt(8.0 * entries + 1.0) - 1.0) / 2.0 + 0.5)


def invert(folder: Path, part: str, key: str, name: str, below: tuple[str, ...]) -> None:
    """Writes the inverse at the entries of a part, and on the outer unknowns of each part below.

    An inverse depends on the parts above too: it and those below have names of their own.
    """
    place = folder / f"inverse-{name}"
    if place.exists():
        return
    prepared, solver = _factored(folder, part, key)
    pattern = solver.pattern
    given = read_numbers(folder / f"outer-{name}") if pattern.n > prepared.own else np.zeros(0)
    selected = solver.expand_inverse(_square(given))
    for places, child in zip(prepared.children, below, strict=True):
        write_numbers(folder / f"outer-{child}", selected[places])
    write_numbers(place, selected[prepared.entries])


def _square(triangle: FloatArray) -> FloatArray:
    """A symmetric matrix from its lower triangle, column by column."""
    n = _order(len(triangle))
    square, at = np.zeros((n, n)), 0
    for k in range(n):
        square[k:, k] = square[k, k:] = triangle[at : at + n - k]
        at += n - k
    return square


def _factored(folder: Path, part: str, key: str) -> tuple[Prepared, SupernodalCholesky]:
    prepared: Prepared = read_object(folder / f"prepared-{part}")
    prepared.solver.put_factor(read_numbers(folder / f"factor-{key}"))
    return prepared, prepared.solver
