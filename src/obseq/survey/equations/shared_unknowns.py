"""Unknowns that groups of observations have of their own: axes of rotation, radii, equal distances."""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.errors import InputError
from obseq.leastsquares import LeastSquares, LeastSquaresResult
from obseq.survey.kinds.kind import Shared, Site
from obseq.survey.kinds.registry import BY_CODE
from obseq.survey.model import FieldBook

UNITS = {"constant": " m", "scale": "", "refraction": ""}
"""Units of the unknowns of instruments, which results tell."""


class SharedUnknowns:
    """Blocks of the unknowns of groups, added where active observations need them.

    An unknown that several groups of one parent name and that the parent is to have (the axis of several
    targets) belongs to the parent: it is added once, from the group that gives it first.
    """

    def __init__(self, system: LeastSquares, book: FieldBook) -> None:
        self._system = system
        self._book = book
        self._blocks: dict[tuple[int, str], int] = {}

    def __len__(self) -> int:
        return len(self._blocks)

    def add(self, site: Site, coordinates: FloatArray) -> None:
        """Adds the unknowns of all groups, starting from coordinates of the points."""
        observations = self._book.observations
        grouped = np.flatnonzero((observations.groups >= 0) & observations.active)
        order = grouped[np.argsort(observations.groups[grouped], kind="stable")]
        numbers, starts = np.unique(observations.groups[order], return_index=True)
        for number, rows in zip(numbers.tolist(), np.split(order, starts)[1:], strict=True):
            kind = BY_CODE[int(observations.types[rows[0]])]
            for part, unknown in kind.shared_unknowns(site, rows, coordinates).items():
                self._add(number, part, unknown)
        self._require_axes(order)

    def _add(self, group: int, part: str, unknown: Shared) -> None:
        parent = self._book.groups[group].parent
        owner = parent if unknown.is_direction and parent >= 0 else group
        if (owner, part) in self._blocks:
            return
        name = f"{part} of {self._book.groups[owner].name}"
        add = self._system.add_directions if unknown.is_direction else self._system.add_scalars
        self._blocks[owner, part] = int(add([name], np.asarray([unknown.value]))[0])

    def sentences(self, solution: LeastSquaresResult, a_priori: bool) -> tuple[str, ...]:
        """What was found of instruments and refraction, with standard deviations where there are some."""
        found = []
        for (owner, part), block in self._blocks.items():
            if part in UNITS:
                value = float(solution.values([block])[0, 0])
                sigma = "?" if solution.weak else f"{float(solution.precisions([block], a_priori)[0, 0]):.2g}"
                found.append(
                    f"{part} of {self._book.groups[owner].name}: {value:.6g} +- {sigma}{UNITS[part]}"
                )
        return tuple(found)

    def scales(self) -> dict[str, int]:
        """Blocks of the scales, by the name of what has them."""
        return {
            self._book.groups[owner].name: at for (owner, part), at in self._blocks.items() if part == "scale"
        }

    def corrections(self) -> tuple[float, ...]:
        """Present values (m, parts) of the unknowns of instruments and refraction."""
        blocks = [block for (_, part), block in self._blocks.items() if part in UNITS]
        return tuple(float(self._system.values([block])[0, 0]) for block in blocks)

    def _require_axes(self, rows: IntArray) -> None:
        """Raises InputError for an axis whose direction no target gives."""
        for row in rows.tolist():
            group = int(self._book.observations.groups[row])
            parent = self._book.groups[group].parent
            if parent >= 0 and (parent, "axis") not in self._blocks:
                raise InputError(
                    f"{self._book.label(row)}: no direction of {self._book.groups[parent].name} can be "
                    "found: one "
                    "target needs three positions with coordinates that are not on a line"
                )

    def values(self, rows: IntArray, part: str) -> FloatArray:
        """(n, m) present values of these blocks."""
        return self._system.values(self.blocks(rows, part))

    def blocks(self, rows: IntArray, part: str) -> IntArray:
        """Blocks (n,) that observations have under a name, in their group or its parent."""
        groups = self._book.observations.groups[rows].tolist()
        found = []
        for group in groups:
            parent = self._book.groups[group].parent
            owner = group if (group, part) in self._blocks else parent
            found.append(self._blocks[owner, part])
        return np.array(found, np.int64)
