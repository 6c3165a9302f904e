"""The hypotheses of a network, made once; their columns, made at each linearisation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from random import Random

import numpy as np

from obseq.arrays import Array, FloatArray, IndexArray, IntArray
from obseq.dataclass import dataclass
from obseq.diagnosis.columns import Columns
from obseq.diagnosis.hypotheses import Family, Hypotheses
from obseq.diagnosis.linear import Linear
from obseq.leastsquares.sparse import Sparse
from obseq.survey.causes.cause import Cause, Groups, KnownCause
from obseq.survey.causes.effects import Effects
from obseq.survey.causes.notes import Notes
from obseq.survey.causes.registry import CAUSES, OF_KNOWN
from obseq.survey.equations.equations import Equations
from obseq.survey.equations.known_coordinates import KnownCoordinates

ROW, KNOWN, KNOWN_PLAN = "S100", "S110", "S111"
_FEW = 200_000
"""Entries up to which matrices are plain arrays: sparse ones take longer to begin."""
RARITY = {ROW: 0.0, KNOWN: 1.0, KNOWN_PLAN: 4.0}


@dataclass(frozen=True, eq=False)
class Named:
    """What one hypothesis is.

    Attributes:
        code: Of its cause.
        rows: Of the field book, that it concerns.
        known: Point and component (0 to 2) of the known coordinates that it concerns.
        cause: None for single observations and known coordinates.
        of_known: A mistake that all known coordinates share; else None.
        groups, number: Where it stands among the groups of the cause.
    """

    code: str
    rows: IntArray
    known: tuple[tuple[int, int], ...] = ()
    cause: Cause | None = None
    of_known: KnownCause | None = None
    groups: Groups | None = None
    number: int = 0


class Catalogue:
    """What may be wrong with a network.

    Attributes:
        hypotheses: In the order single observations, known coordinates, causes.
        rows: (m,) the observation of each equation of observations.
        known: (k, 2) point and component of each equation of known coordinates.
    """

    def __init__(self, notes: Notes, equations: Equations) -> None:
        """Makes them.

        Args:
            notes: The network.
            equations: Its equations.
        """
        self.notes = notes
        none = np.zeros(0, np.int64)
        kept = [rows[batch.active] for rows, batch in equations.batches.values()]
        self.rows = np.concatenate([none, *(rows for rows, _ in equations.batches.values())])
        self.known = equations.known.coordinates()
        self._active = np.zeros(len(notes.book.observations), np.bool_)
        self._active[np.concatenate([none, *kept])] = True
        self._column = np.full(len(notes.book.observations), -1, np.int64)
        self._column[self.rows] = np.arange(len(self.rows))
        self._single: list[tuple[Cause, Groups]] = []
        self._parts: list[tuple[Cause, Groups]] = []
        self.of_known: list[tuple[KnownCause, IntArray]] = []
        self.hypotheses = Hypotheses([*self._alone(), *self._of_causes(), *self._of_all_known()])

    def _alone(self) -> list[Family]:
        """Single observations, but components of vectors; known coordinates, and both in plan of a point."""
        own = np.flatnonzero(self._active[self.rows] & (self.notes.vectors[self.rows] < 0))
        first, points, components = len(self.rows), self.known[:, 0], self.known[:, 1]
        plan = np.flatnonzero(components < 2)
        plan = plan[np.lexsort((components[plan], points[plan]))]
        pairs = np.flatnonzero(np.diff(points[plan]) == 0)
        both = np.column_stack([plan[pairs], plan[pairs + 1]]) if pairs.size else np.zeros((0, 2), np.int64)
        return [
            Family.alone(ROW, own, RARITY[ROW], is_start=True),
            Family.alone(KNOWN, first + np.arange(len(points)), RARITY[KNOWN], is_start=True),
            Family(
                KNOWN_PLAN,
                2 * np.arange(len(both) + 1),
                first + both.ravel(),
                RARITY[KNOWN_PLAN],
                is_block=True,
            ),
        ]

    def _of_causes(self) -> list[Family]:
        """All others: columns of their own, or those of their rows."""
        self._n_alone = len(self.rows) + len(self.known)
        families, start = [], self._n_alone
        seen: dict[str, Array] = {}
        marks = np.frombuffer(Random(0).randbytes(8 * len(self._active)), dtype=np.uint64)
        for cause in CAUSES:
            for groups in cause.where(self.notes, self._active):
                groups = _not_seen(groups, marks, cause, seen)
                if not len(groups):
                    continue
                self._parts.append((cause, groups))
                about = {"needs_slip": cause.needs_slip, "is_bent": cause.is_bent, "is_start": cause.is_one}
                if cause.effect is None:
                    columns = self._column[groups.rows]
                    families.append(
                        Family(
                            cause.code,
                            groups.starts,
                            columns,
                            cause.rarity,
                            is_block=not cause.is_one,
                            **about,
                        )
                    )
                else:
                    self._single.append((cause, groups))
                    count = cause.width * len(groups)
                    starts = cause.width * np.arange(len(groups) + 1)
                    columns = start + np.arange(count)
                    families.append(
                        Family(cause.code, starts, columns, cause.rarity, **about, most=cause.most)
                    )
                    start += count
        self._n_columns = start
        return families

    def _of_all_known(self) -> list[Family]:
        """What all known coordinates may share."""
        families = []
        for cause in OF_KNOWN:
            chosen = np.flatnonzero(np.isin(self.known[:, 1], cause.takes))
            if len(set(self.known[chosen, 0].tolist())) < cause.least:
                continue
            columns = self._n_columns + np.arange(cause.width)
            families.append(Family(cause.code, np.array([0, cause.width]), columns, cause.rarity))
            self.of_known.append((cause, chosen))
            self._n_columns += cause.width
        return families

    def columns(self, linear: Linear, equations: Equations, effects: Effects) -> Columns:
        """What errors of one unit do to the equations, at a linearisation."""
        is_local = np.arange(self._n_columns) < self._n_alone
        values, places, starts = self._entries(equations, effects)
        if isinstance(linear.whitening, np.ndarray):
            plain = np.zeros((linear.n, self._n_columns))
            plain[places, np.repeat(np.arange(self._n_columns), np.diff(starts))] = values
            return Columns(linear.whitening.diagonal()[:, None] * plain, is_local)
        sparse, whitening = Sparse(values, places, starts, linear.n), linear.whitening
        if len(whitening.values) > linear.n:  # observations that are correlated
            return Columns(sparse @ whitening.T, is_local)
        sparse.values *= whitening.values[places]
        return Columns(sparse, is_local)

    def _entries(self, equations: Equations, effects: Effects) -> tuple[FloatArray, IndexArray, IntArray]:
        """Values of the columns in units of observations, their equations, and where columns begin."""
        scales, first, at = equations.scales(effects.coordinates), len(self.rows), self._n_alone
        wide = [(len(groups.rows), cause.width) for cause, groups in self._single]
        wide += [(len(chosen), cause.width) for cause, chosen in self.of_known]
        values = np.empty(at + sum(n * width for n, width in wide))
        places, starts = np.empty(len(values), np.int32), [np.arange(at)]
        values[:at], places[:at] = (
            np.append(-scales[self.rows], np.full(len(self.known), -1.0)),
            np.arange(at),
        )
        for cause, groups in self._single:
            assert cause.effect is not None
            change = _by_parts(cause.effect(effects)[groups.rows]) * scales[groups.rows, None]
            own, counts = self._column[groups.rows], np.repeat(np.diff(groups.starts), cause.width)
            end = at + change.size
            for part, place in zip(change.T, _places_of_parts(groups.starts, cause.width), strict=True):
                values[at:end][place], places[at:end][place] = part, own
            starts.append(at + np.cumsum(counts) - counts)
            at = end
        for of_known, chosen in self.of_known:
            change = -self.too_large(of_known, chosen, equations.known)
            end = at + change.size
            values[at:end], places[at:end] = change.T.ravel(), np.tile(first + chosen, of_known.width)
            starts.append(at + len(chosen) * np.arange(of_known.width))
            at = end
        return values, places, np.append(np.concatenate(starts), at)

    def too_large(self, cause: KnownCause, chosen: IntArray, known: KnownCoordinates) -> FloatArray:
        """(k, parts) by how much (m) one unit of a mistake makes known coordinates too large."""
        return cause.effect(known.about_centre()[chosen], self.known[chosen, 1], known.curvature)

    @property
    def is_small(self) -> bool:
        """Whether all columns are few enough to be a plain array."""
        n = self._n_alone
        return n * self._n_columns <= _FEW

    def named(self, index: int) -> Named:
        """What a hypothesis is."""
        family, k = self.hypotheses.place(index)
        code = self.hypotheses.codes[family]
        if family == 0:
            return Named(code, self.rows[self.hypotheses.of(index)])
        if family < 3:
            own = self.hypotheses.of(index) - len(self.rows)
            return Named(code, np.zeros(0, np.int64), self._points(own))
        if family - 3 >= len(self._parts):
            of_known, chosen = self.of_known[family - 3 - len(self._parts)]
            return Named(code, np.zeros(0, np.int64), self._points(chosen), of_known=of_known)
        cause, groups = self._parts[family - 3]
        rows = groups.of(k)
        return Named(code, rows, cause=cause, groups=groups, number=k)

    def _points(self, equations: IntArray) -> tuple[tuple[int, int], ...]:
        """Points and components of some equations of known coordinates."""
        return tuple((int(point), int(part)) for point, part in self.known[equations])


def _places_of_parts(starts: IntArray, width: int) -> Iterator[IntArray]:
    """Of each part, the places (m,) of members of groups: by group, there by part, by member."""
    counts = np.diff(starts)
    place, count = np.arange(starts[-1]) + (width - 1) * starts[:-1].repeat(counts), counts.repeat(counts)
    for _ in range(width):
        yield place
        place = place + count


def _by_parts(effect: FloatArray) -> FloatArray:
    """(n, parts) an effect of one size or of several."""
    return effect if effect.ndim > 1 else effect[:, None]


def _not_seen(groups: Groups, marks: Array, cause: Cause, seen: dict[str, Array]) -> Groups:
    """Those of some groups of which no other has the same effect on the same rows."""
    if not len(groups):
        return groups
    keys = np.add.reduceat(marks[groups.rows], groups.starts[:-1])
    order = keys.argsort(kind="stable")
    kept = np.zeros(len(keys), np.bool_)
    kept[order[np.append(True, np.diff(keys[order]) != 0)]] = True
    before = seen.get(cause.code)
    if before is not None:
        kept[kept] = ~np.isin(keys[kept], before, assume_unique=True)  # else it would load masked arrays
    seen[cause.code] = keys[kept] if before is None else np.append(before, keys[kept])
    if kept.all():
        return groups
    counts = np.diff(groups.starts)
    return replace(
        groups,
        starts=np.append(0, np.cumsum(counts[kept])),
        rows=groups.rows[np.repeat(kept, counts)],
        labels=groups.labels[kept],
    )
