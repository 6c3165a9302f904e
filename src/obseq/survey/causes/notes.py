"""A network as causes look at it: which observations are of what kind, and who shares what with whom."""

from __future__ import annotations

import numpy as np

from obseq.arrays import BoolArray, IntArray
from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.survey.adjustment.joint_groups import vector_numbers
from obseq.survey.kinds.kind import Start
from obseq.survey.kinds.registry import AXIS_OF_VECTOR, among, codes_for, codes_where
from obseq.survey.model import FieldBook, GroupKind, Points


@dataclass(frozen=True, eq=False)
class Notes:
    """Points and observations, looked at column by column; all arrays are (n,), one for each observation.

    Attributes:
        points: The points.
        book: The observations.
    """

    points: Points
    book: FieldBook

    @cached_property
    def is_direction(self) -> BoolArray:
        """Which are readings of a horizontal circle."""
        return among(self.book.observations.types, codes_where(lambda kind: kind.is_of_circle))

    @cached_property
    def is_zenith(self) -> BoolArray:
        """Which are zenith angles."""
        return among(self.book.observations.types, codes_for(Start.ZENITH))

    @cached_property
    def is_between(self) -> BoolArray:
        """Which are angles between two points."""
        return among(self.book.observations.types, codes_for(Start.ANGLE))

    @cached_property
    def is_slope(self) -> BoolArray:
        """Which are slope distances."""
        return among(self.book.observations.types, codes_for(Start.DISTANCE))

    @cached_property
    def is_length(self) -> BoolArray:
        """Which are distances of an instrument."""
        return self.is_slope | among(self.book.observations.types, codes_for(Start.FLAT))

    @cached_property
    def is_rise(self) -> BoolArray:
        """Which are height differences."""
        return among(self.book.observations.types, codes_for(Start.RISE, Start.DZ))

    @cached_property
    def is_levelled(self) -> BoolArray:
        """Which are differences of levelling."""
        return among(self.book.observations.types, codes_for(Start.RISE))

    @cached_property
    def is_raised(self) -> BoolArray:
        """Which depend on the heights of instrument and target."""
        return self.is_zenith | self.is_slope | self.is_rise

    @cached_property
    def is_vector(self) -> BoolArray:
        """Which are components of vectors or positions."""
        return np.asarray(AXIS_OF_VECTOR[self.book.observations.types] >= 0)

    @cached_property
    def vectors(self) -> IntArray:
        """The vector that each is a component of, by what files give as one; -1 for none."""
        numbers = vector_numbers(self.book)
        return np.where(np.isin(numbers, np.flatnonzero(np.bincount(numbers[numbers >= 0]) > 1)), numbers, -1)

    @cached_property
    def setups(self) -> IntArray:
        """The set-up of each; -1 for none. Lengths read among the directions of one are part of it.

        So are the lengths from a point that has no other set-up.
        """
        rows = self.book.observations
        n, found = len(rows), rows.stations.astype(np.int64)
        if not n or not len(self.book.stations):
            return found
        changes = np.append(True, (np.diff(rows.from_points) != 0) | (np.diff(rows.file_indices) != 0))
        runs, places = np.cumsum(changes), np.arange(n)
        before = np.maximum.accumulate(np.where(found >= 0, places, -1))
        after = np.minimum.accumulate(np.where(found >= 0, places, n)[::-1])[::-1]
        is_loose = (found < 0) & (self.is_length | self.is_levelled)
        for near in (after, before):  # what was read before goes first
            known = is_loose & (near >= 0) & (near < n)
            known[known] = runs[near[known]] == runs[known]
            found[known] = rows.stations[near[known]]
        origins = self.book.stations.origins
        counts = np.bincount(origins, minlength=len(self.book.point_names))
        only = np.full(len(self.book.point_names), -1, np.int64)
        only[origins] = np.arange(len(origins))
        is_loose &= (found < 0) & (counts[rows.from_points] == 1)
        found[is_loose] = only[rows.from_points[is_loose]]
        return found

    @cached_property
    def sights(self) -> IntArray:
        """The sight of each, from a set-up to a target; -1 for those of no set-up."""
        rows, width = self.book.observations, len(self.book.point_names)
        return np.where(self.setups >= 0, self.setups * width + rows.to_points, -1)

    @cached_property
    def readings(self) -> IntArray:
        """The sight of each, counted anew where the same is read again: a round of its own; -1 for none."""
        rows, sights = self.book.observations, self.sights
        keys = sights * (1 + int(rows.types.max(initial=0))) + rows.types
        order = np.lexsort((np.arange(len(keys)), keys))
        firsts = np.append(True, np.diff(keys[order]) != 0)[: len(keys)]
        places = np.arange(len(keys))
        rounds = np.empty(len(keys), np.int64)
        rounds[order] = places - np.maximum.accumulate(np.where(firsts, places, 0))
        return np.where(sights >= 0, sights * (1 + int(rounds.max(initial=0))) + rounds, -1)

    def in_file(self, points: IntArray) -> IntArray:
        """Numbers of points, another one in each file."""
        files = self.book.observations.file_indices.astype(np.int64)
        return np.asarray(files * len(self.book.point_names) + points)

    @cached_property
    def instruments(self) -> IntArray:
        """The instrument that a file names; -1 for none."""
        named = self.book.in_groups(GroupKind.INSTRUMENT)
        return np.where(named, self.book.observations.groups, -1)
