"""The hypotheses of a block, made once; their columns, made at each linearisation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.diagnosis.columns import Columns
from obseq.diagnosis.hypotheses import Family, Hypotheses
from obseq.diagnosis.linear import Linear
from obseq.images.adjustment.equations import roots_of
from obseq.images.causes.cause import Cause
from obseq.images.causes.numbering import Numbering
from obseq.images.causes.registry import CAUSES
from obseq.leastsquares.sparse import Sparse, on_diagonal, stacked

STEP = 1e-5
"""Share of the focal length, and of 1 for the other parameters, by which derivatives are taken."""
STEP_OF_POINT = 0.1
"""Pixels: the same of a principal point."""


@dataclass(frozen=True, eq=False)
class Named:
    """What one hypothesis is.

    Attributes:
        cause: of it.
        label: where, in the numbers of the cause.
        columns: that it changes.
    """

    cause: Cause
    label: tuple[int, ...]
    columns: IntArray


class Catalogue:
    """What may be wrong with a block.

    Attributes:
        numbering: of its equations.
        hypotheses: cause by cause.
    """

    def __init__(self, numbering: Numbering) -> None:
        self.numbering = numbering
        self._members = [(cause, cause.where(numbering)) for cause in CAUSES]
        self._members = [(cause, members) for cause, members in self._members if len(members.labels)]
        self.hypotheses = Hypotheses(
            [
                Family(
                    cause.code,
                    members.starts,
                    members.columns,
                    cause.rarity,
                    is_block=cause.is_block,
                    is_bent=cause.is_bent,
                    is_start=cause.is_start,
                )
                for cause, members in self._members
            ]
        )

    def named(self, index: int) -> Named:
        """What a hypothesis is."""
        family, k = self.hypotheses.place(index)
        cause, members = self._members[family]
        return Named(cause, tuple(members.labels[k].tolist()), self.hypotheses.of(index))

    def columns(self, linear: Linear) -> Columns:
        """What errors of one unit do to the equations at a linearisation; the unknowns are at it."""
        alone = (cast("Sparse", linear.whitening) @ self._mixtures()).scaled(np.full(linear.n, -1.0))
        parameters = [self._of_parameter(linear, k) for k in range(len(self.numbering.parameters))]
        own = Sparse.of_dense(np.reshape(parameters, (-1, linear.n)))
        made = stacked([alone.T, own, self._of_held(linear).T])
        return Columns(made, np.arange(made.shape[0]) < linear.n)

    def _mixtures(self) -> Sparse:
        """(n, n) from errors of observations to those of equations: coordinates may be whitened already."""
        numbering = self.numbering
        batch, given = numbering.equations.control
        if batch is None:
            return Sparse.of_diagonal(np.ones(numbering.n))
        rest = numbering.n - numbering.first_control - len(given)
        before, after = (Sparse.of_diagonal(np.ones(count)) for count in (numbering.first_control, rest))
        return on_diagonal([before, Sparse.of_dense(self._coordinates()), after])

    def _coordinates(self) -> FloatArray:
        """(k, k) what one unit of each control coordinate is in the equations of its point."""
        numbering, start = self.numbering, self.numbering.equations.start
        points, axes = numbering.control.T
        given = start.is_control[:, None] & ~start.is_held & ~start.is_free
        roots = roots_of(start.covariances, given)
        same = points[:, None] == points[None]
        return np.where(same, roots[points[:, None], axes[:, None], axes[None]], 0.0)

    def _of_parameter(self, linear: Linear, k: int) -> FloatArray:
        """(n,) what one unit of a held parameter adds to computed minus observed."""
        numbering = self.numbering
        parameter, system = numbering.parameters[k], numbering.equations.system
        at = system.unknowns.components(parameter.block).index(parameter.name)
        step = STEP_OF_POINT if parameter.name.startswith("PP") else STEP
        step *= float(system.values([parameter.block])[0, at]) if parameter.name == "F" else 1.0
        return np.asarray(linear.whitening @ self._moved([parameter.block], at, step))

    def _moved(self, blocks: Sequence[int] | IntArray, component: int, step: float) -> FloatArray:
        """(n,) what an unknown of some blocks adds to computed minus observed, for one unit of it."""
        system, found = self.numbering.equations.system, []
        value = system.values(blocks)
        for sign in (1.0, -1.0):
            moved = value.copy()
            moved[:, component] += sign * step
            system.set_values(blocks, moved)
            measures = self.numbering.equations.measures
            found.append(np.concatenate([system.residuals(item.batch).ravel() for item in measures]))
        system.set_values(blocks, value)
        change = np.zeros(self.numbering.n)
        change[: self.numbering.first_control] = np.nan_to_num(found[0] - found[1]) / (2.0 * step)
        change[: self.numbering.first_control][~np.repeat(self.numbering.kept, 2)] = 0.0
        return change

    def _of_held(self, linear: Linear) -> Sparse:
        """(n, h) what one unit of each held coordinate adds: all along one axis are moved at once."""
        numbering, equations = self.numbering, self.numbering.equations
        points, axes = numbering.held.T
        values, places, columns = [np.zeros(0)], [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
        for axis in sorted(set(axes.tolist())):
            (own,) = np.nonzero(axes == axis)
            blocks = equations.points[points[own]]
            change = self._moved(blocks, axis, STEP * self._distance)
            column = np.full(len(equations.points), -1)
            column[points[own]] = own
            of = np.repeat(column[numbering.point], 2)
            (rows,) = np.nonzero(of >= 0)
            values, places, columns = [*values, change[rows]], [*places, rows], [*columns, of[rows]]
        entries = np.concatenate(values), np.concatenate(places), np.concatenate(columns)
        return cast("Sparse", linear.whitening) @ Sparse.of_entries(*entries, (numbering.n, len(points)))

    @property
    def _distance(self) -> float:
        """How far points are from images, about."""
        equations = self.numbering.equations
        near, far = equations.system.values(equations.centres), equations.system.values(equations.points)
        off = far[self.numbering.point] - near[self.numbering.image]
        return float(np.median(np.linalg.norm(off, axis=1)))
