"""Equations by the names of their parts: which points, images, stations and unknowns a formula takes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError, nearest
from obseq.kernels.loading import Kernel, load
from obseq.leastsquares import LeastSquares
from obseq.leastsquares.problem.batches import Batch
from obseq.leastsquares.problem.losses import Loss
from obseq.leastsquares.problem.shapes import formula_shape

KNOWN_AS = {
    "Point3": (("Point3", "{}"), ("Point3", "{} centre")),
    "Point2": (("Point2", "{}"),),
    "Rotation": (("Rotation", "{}"), ("PlumbRotation", "station {}")),
    "Direction": (("Direction", "{}"), ("Direction", "{} axis")),
    "Vector": (("Vector", "{}"), ("Vector", "{} correction"), ("Scalar", "{}")),
    "Scalar": (("Scalar", "{}"), ("Vector", "{}")),
}
"""What a name may stand for where a formula wants a kind: kinds of unknowns, and how these are called."""


class Column(NamedTuple):
    """A residual of a formula, and what was measured for it.

    Attributes:
        type: name of the formula; with that of the residual where it has several.
        residual: its number.
        values: (n,) what was measured; empty where the residual is that of nothing measured.
        unit: of it; empty where there is none.
    """

    type: str
    residual: int
    values: FloatArray
    unit: str


@dataclass(frozen=True, eq=False)
class NamedEquation:
    """Observations of one formula, whose parts are named.

    Attributes:
        formula: its name, or a compiled formula.
        parts: names (n,) of what stands for each block of the formula.
        observations: (n, m) what was measured and what else is given.
        sigmas: (n,) or (n, n_residuals), in the unit of the residuals.
        group: under which sums of squares are kept.
        loss: robust weights.
    """

    formula: str | Kernel
    parts: Mapping[str, tuple[str, ...]]
    observations: FloatArray
    sigmas: FloatArray
    group: str
    loss: Loss | str | None = None

    def __len__(self) -> int:
        return len(self.observations)

    @property
    def named(self) -> set[tuple[str, str]]:
        """Kind and name of all its parts."""
        kinds = {role.name: role.kind for role in formula_shape(self.formula).roles}
        return {(kinds[role], name) for role, names in self.parts.items() for name in names}

    @property
    def columns(self) -> Iterator[Column]:
        """Its residuals. One that is called like a measured number is computed minus that number."""
        kernel = load(self.formula) if isinstance(self.formula, str) else self.formula
        units = {one.start + k: one.unit for one in kernel.inputs for k in range(one.size)}
        measured = {kernel.observations[place]: (k, units[place]) for k, place in enumerate(kernel.measured)}
        for k, name in enumerate(kernel.residuals):
            kind = kernel.name if len(kernel.residuals) == 1 else f"{kernel.name} {name}"
            own, unit = measured.get(name, (-1, ""))
            yield Column(kind, k, self.observations[:, own] if own >= 0 else np.empty(0), unit)

    def rows(self, chosen: Sequence[int]) -> NamedEquation:
        """Some of its observations."""
        rows = list(chosen)
        parts = {role: tuple(names[row] for row in rows) for role, names in self.parts.items()}
        sigmas = self.sigmas if self.sigmas.ndim == 0 else self.sigmas[rows]
        return replace(self, parts=parts, observations=self.observations[rows], sigmas=sigmas)

    def label(self, row: int) -> str:
        """An observation in words: its formula and its parts."""
        return " ".join(self._names(row))

    def ends(self, row: int) -> tuple[str, str]:
        """The first two names of an observation: where from, and where to; empty where there is none."""
        first, second, *_ = (*self._names(row), "", "")
        return first, second

    def _names(self, row: int) -> list[str]:
        return list(dict.fromkeys(names[row] for names in self.parts.values()))


def named_equation(
    formula: str | Kernel,
    named: Mapping[str, object],
    sigma: ArrayLike,
    group: str | None = None,
    loss: Loss | str | None = None,
) -> NamedEquation:
    """Observations from what a formula takes, by the names of its arguments.

    Args:
        formula: its name, or a compiled formula.
        named: for each argument that is unknown, a name or n names; for each other one, its value, or n of
            them. An argument of several parts, such as a station, is one name, or its parts by names such as
            `station.centre`. A dot in the name of an argument may be written as `_`.
        sigma: one number, (n,) or (n, n_residuals), in the unit of the residuals.
        group: under which sums of squares are kept; the formula's name when None.
        loss: robust weights.

    Raises:
        InputError: an argument is missing, unknown, or does not fit.
    """
    shape = formula_shape(formula)
    kernel = load(formula) if isinstance(formula, str) else formula
    given = dict(named)
    parts = {role.name: _names(shape.name, role.name, _taken(given, role.name)) for role in shape.roles}
    values = {one.name: _taken(given, one.name) for one in kernel.inputs}
    for name in {role.name.partition(".")[0] for role in shape.roles} & given.keys():
        del given[name]  # an argument of several parts
    takes = [*dict.fromkeys(role.name.partition(".")[0] for role in shape.roles), *values]
    if given:
        raise InputError(
            f"{shape.name} has no argument {nearest(min(given), takes)}; it takes {', '.join(takes)}"
        )
    arrays = {one.name: _rows(shape.name, one.name, values[one.name], one.size) for one in kernel.inputs}
    counts = {len(names) for names in parts.values()} | {len(array) for array in arrays.values()}
    n = max(counts)
    if counts - {1, n}:
        raise InputError(f"{shape.name}: its arguments have {', '.join(map(str, sorted(counts)))} rows")
    observations = np.empty((n, len(kernel.measured)))
    place = {scalar: k for k, scalar in enumerate(kernel.measured)}
    for one in kernel.inputs:
        columns = [place[one.start + k] for k in range(one.size)]
        observations[:, columns] = arrays[one.name]
        if one.name.startswith("distance") and arrays[one.name].min(initial=0.0) < 0.0:
            raise InputError(f"{shape.name}: a {one.name} is negative ({arrays[one.name].min():g})")
    sigmas = np.asarray(sigma, dtype=np.float64)
    if not (np.isfinite(sigmas).all() and (sigmas > 0.0).all()):
        raise InputError(f"{shape.name}: sigma must be above zero, not {sigma!r}")
    full = {role: names if len(names) == n else names * n for role, names in parts.items()}
    return NamedEquation(formula, full, observations, sigmas, group or shape.name, loss)


def _taken(given: dict[str, object], name: str) -> object:
    """The value of an argument, taken out; that of the argument that it is a part of stays."""
    for key in (name, name.replace(".", "_")):
        if key in given:
            return given.pop(key)
    return given.get(name.partition(".")[0])


def _names(formula: str, role: str, value: object) -> tuple[str, ...]:
    if isinstance(value, str):
        return (value,)
    names = tuple(value) if isinstance(value, (list, tuple)) else ()
    if not names or not all(isinstance(name, str) for name in names):
        what = "is missing" if value is None else f"is a name, or a list of names, not {value!r}"
        raise InputError(f"{formula}: {role} {what}")
    return names


def _rows(formula: str, name: str, value: object, size: int) -> FloatArray:
    """(n, size) numbers."""
    if value is None:
        raise InputError(f"{formula}: {name} is missing")
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.array(np.nan)
    if not np.isfinite(array).all() or (array.ndim > 2 and array.size % size):
        raise InputError(f"{formula}: {name} takes numbers, not {value!r}")
    if size == 1 and array.ndim < 2:
        return array.reshape(-1, 1)
    if array.size % size or (array.shape[-1] != size and array.shape[-2:] != (size // 3, 3)):
        raise InputError(f"{formula}: {name} takes {size} numbers, or n rows of them")
    return array.reshape(-1, size)


def add_named(system: LeastSquares, equation: NamedEquation, also: Mapping[str, str]) -> Batch:
    """Adds observations to a system that has their parts.

    Args:
        system: the system.
        equation: the observations.
        also: other names of vectors: the camera of an image.

    Raises:
        InputError: a name is that of nothing of the kind that the formula wants.
    """
    shape = formula_shape(equation.formula)
    blocks = {
        role.name: _ids(system, f"{shape.name}, {role.name}", role.kind, equation.parts[role.name], also)
        for role in shape.roles
    }
    measured = equation.observations if equation.observations.shape[1] else None
    return system.add(
        equation.formula,
        blocks,
        measured,
        equation.sigmas,
        equation.label,
        equation.group,
        loss=equation.loss,
    )


def _ids(
    system: LeastSquares, where: str, kind: str, names: Sequence[str], also: Mapping[str, str]
) -> IntArray:
    found = {name: _id(system, where, kind, name, also) for name in dict.fromkeys(names)}
    return np.array([found[name] for name in names], dtype=np.int64)


def _id(system: LeastSquares, where: str, kind: str, name: str, also: Mapping[str, str]) -> int:
    known: list[str] = []
    for label, pattern in KNOWN_AS.get(kind, ((kind, "{}"),)):
        for called in (pattern.format(name), *([also[name]] if kind == "Vector" and name in also else [])):
            table = system.unknowns.called(label)
            if called in table:
                return table[called]
            known += table
    raise InputError(f"{where}: no {kind} is called {nearest(name, known)}")
