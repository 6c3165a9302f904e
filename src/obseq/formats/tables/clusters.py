"""Correlated rows of tables: the covariances of each row with those of its cluster that stand before it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from obseq.errors import InputError
from obseq.formats.columns import Columns


class Member(NamedTuple):
    """A row of a cluster.

    Attributes:
        row: Of the field book.
        sigma: Its standard deviation (m, rad).
        unit: What its covariances are multiplied by: the unit of its value.
        place: File and line, or what else messages call it.
    """

    row: int
    sigma: float
    unit: float
    place: str


class Clusters:
    """The clusters of the tables that belong together, while these are read."""

    def __init__(self) -> None:
        self._members: dict[str, list[Member]] = {}
        self._rows: dict[str, list[list[float]]] = {}

    def add(self, name: str, member: Member, numbers: Sequence[float], are_correlations: bool) -> None:
        """Adds a row to the cluster of that name.

        Args:
            name: Of the cluster.
            member: The row.
            numbers: Its covariances with the rows before, in the product of their units; or correlations.
            are_correlations: Whether they are those.

        Raises:
            InputError: There is not one number for each row before.
        """
        before = self._members.setdefault(name, [])
        if len(numbers) != len(before):
            raise InputError(
                f"{member.place}: {len(numbers)} covariances, and {len(before)} rows of cluster {name} "
                "before: give one for each of them, in their order, with blanks between"
            )
        scales = [other.sigma if are_correlations else other.unit for other in before]
        scale = member.sigma if are_correlations else member.unit
        covariances = [scale * other * number for other, number in zip(scales, numbers, strict=True)]
        before.append(member)
        self._rows.setdefault(name, []).append(covariances)

    def give(self, columns: Columns) -> None:
        """Gives the rows of each cluster their covariance.

        Raises:
            InputError: It is not positive definite.
        """
        for name, members in self._members.items():
            if len(members) > 1:
                columns.correlate([member.row for member in members], self._matrix(name, members))

    def _matrix(self, name: str, members: list[Member]) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
        matrix = np.diag([member.sigma**2 for member in members])
        for k, covariances in enumerate(self._rows[name]):
            matrix[k, :k] = matrix[:k, k] = covariances
        sigmas = np.array([member.sigma for member in members])
        try:
            np.linalg.cholesky(matrix / np.outer(sigmas, sigmas))
        except np.linalg.LinAlgError:
            raise InputError(
                f"{members[0].place}: the covariance of cluster {name}, which begins here, is not positive "
                "definite; correct its covariances, or the sigmas"
            ) from None
        return matrix
