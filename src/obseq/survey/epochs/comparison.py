"""Two epochs of a network compared: displacements with their covariances, and which are significant."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import replace

import numpy as np

from obseq import crs
from obseq.arguments import NOTHING, NUMBER, TRUTH, WORDS, expecting, instance
from obseq.arrays import BoolArray, FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.leastsquares.statistics.ellipses import ellipses_of
from obseq.leastsquares.statistics.hypothesis_tests import checked_probability, holm
from obseq.printable import composed
from obseq.records.adjustment import EllipseRecord
from obseq.records.comparison import ComparisonRecord, DisplacementRecord, TestRecord
from obseq.records.shown_units import METRIC
from obseq.survey.adjustment.adjusted import Adjustment
from obseq.survey.epochs.congruence import Tester, congruence, determine, motions_of, relative_to
from obseq.survey.epochs.displacements import MOST_POINTS, Displacements, displacements
from obseq.survey.epochs.grounds import (
    at_odds,
    fits,
    obstacles,
    reservations,
    taken_for_granted,
    told_by_others,
    undecided,
    without_explained,
)
from obseq.survey.epochs.known_points import by_observations, known_points
from obseq.survey.epochs.localisation import moved_references
from obseq.survey.equations.frame import Frame

Epochs = tuple[Adjustment, Adjustment]

LEVEL = 0.05
LEAST_KNOWN = 2
"""Known points that can move against each other."""
EPOCH = instance(Adjustment, what="an adjusted network (what Network.adjust gives)")


@dataclass(frozen=True, eq=False)
class Comparison:
    """What has moved between two epochs.

    Attributes:
        displacements: along east, north and up of each point.
        tests: of each point; None for those that are held.
        overall: (n,) probability of as large a test at any of the points that are tested one by one, where
            none has moved (Holm); NaN for the others.
        congruence: of all that are tested together.
        reference: (n,) the points that are taken to have stayed; None when the datum is that of the epochs.
        moved: names of reference points that were found to have moved.
        undecided: names of reference points some of which have moved, and nothing tells which.
        same_precision: test of the two variance factors; None where one is undefined or not used.
        tester: the level of the tests and what stands behind them.
        epochs: the two adjustments.
        is_known: whether the reference points are known points, of which some have moved.
        doubts: sentences that forbid a verdict beside what the epochs themselves say.
        reservations: sentences that weaken it beside those.
    """

    displacements: Displacements
    tests: tuple[TestRecord | None, ...]
    overall: FloatArray
    congruence: TestRecord
    reference: BoolArray | None
    moved: tuple[str, ...]
    same_precision: TestRecord | None
    tester: Tester
    epochs: tuple[Adjustment, Adjustment]
    undecided: tuple[str, ...] = ()
    is_known: bool = False
    doubts: tuple[str, ...] = ()
    reservations: tuple[str, ...] = ()

    @property
    def obstacles(self) -> tuple[str, ...]:
        """Why there is no verdict, one sentence per reason: gross errors, an epoch that did not converge."""
        return (*self.doubts, *obstacles(self.epochs))

    @property
    def is_quiet(self) -> bool:
        """Whether nothing has moved, and each epoch agrees with its known points."""
        agree = all(epoch.is_whole and fits(epoch) for epoch in self.epochs)
        return agree and self.congruence.passed and not (self.significant or self.marginal)

    @property
    def significant(self) -> tuple[str, ...]:
        """Names of the points that have moved for certain; none where obstacles forbid a verdict.

        All points are judged together (Holm): the level is the probability of naming any that has not moved.
        """
        return self._failing(lambda row: self.overall[row] <= self.tester.level)

    @property
    def marginal(self) -> tuple[str, ...]:
        """Names of the points that fail their own test, as some do by chance among many."""
        return self._failing(lambda row: self.overall[row] > self.tester.level)

    def _failing(self, chosen: Callable[[int], bool]) -> tuple[str, ...]:
        """Of the points that fail their test; reference points that have stayed were tested together."""
        if self.obstacles:
            return ()
        return tuple(
            name
            for row, (name, test) in enumerate(zip(self.displacements.names, self.tests, strict=True))
            if test is not None and not test.passed and name not in self.undecided and chosen(row)
        )

    def record(self) -> ComparisonRecord:
        """What the result file holds and the summary prints."""
        first, second = (set(epoch.points.names) for epoch in self.epochs)
        runs = (self.epochs[0].run, self.epochs[1].run)
        trusted = self.tester.redundancy is None
        return ComparisonRecord(
            level=self.tester.level,
            datum=self._datum,
            congruence=self.congruence,
            moved=self.moved,
            undecided=self.undecided,
            displacements=tuple(sorted(self._displacements(), key=_by_significance)),
            only_first=tuple(sorted(first - second)),
            only_second=tuple(sorted(second - first)),
            sigma0=None if trusted else float(np.sqrt(self.tester.variance_factor)),
            redundancy=sum(epoch.solution.redundancy for epoch in self.epochs),
            same_precision=self.same_precision,
            frame=self.epochs[0].frame,
            runs=runs,
            obstacles=self.obstacles,
            reservations=(*self.reservations, *reservations(self.epochs, trusted=trusted)),
            units=self.epochs[0].shown or METRIC,
            incomplete=tuple(number for number, epoch in enumerate(self.epochs, 1) if not epoch.is_whole),
        )

    @property
    def _datum(self) -> str:
        if self.is_known:
            return "known points"
        return "as adjusted" if self.reference is None else "reference points"

    def _displacements(self) -> Iterator[DisplacementRecord]:
        moved, factor = self.displacements, self.tester.variance_factor
        blocks = np.array([factor * moved.block(row) for row in range(len(moved.names))]).reshape(-1, 3, 3)
        found = ellipses_of(moved.names, blocks, 1.0 - self.tester.level, self.tester.redundancy)
        significant, marginal = set(self.significant), set(self.marginal)
        axes = (found.semi_major.tolist(), found.semi_minor.tolist(), found.bearing.tolist())
        spreads = np.sqrt(np.clip(np.diagonal(blocks, axis1=1, axis2=2), 0.0, None))
        rows = zip(
            moved.names,
            moved.places,
            moved.vectors,
            spreads,
            map(EllipseRecord, *axes),
            self.tests,
            strict=True,
        )
        for row, (name, place, vector, spread, ellipse, test) in enumerate(rows):
            x, y, z, east, north, up, s_east, s_north, s_up = np.concatenate([place, vector, spread]).tolist()
            if moved.without_height is not None and moved.without_height[row]:
                z = up = s_up = None
            yield DisplacementRecord(
                name,
                x,
                y,
                z,
                east,
                north,
                up,
                s_east,
                s_north,
                s_up,
                length=float(np.linalg.norm(vector)),
                ellipse=ellipse,
                test=test,
                is_reference=self.reference is not None and bool(self.reference[row]),
                is_significant=name in significant,
                is_marginal=name in marginal,
                overall=None if np.isnan(self.overall[row]) else float(self.overall[row]),
            )


@expecting(
    first=EPOCH,
    second=EPOCH,
    level=NUMBER,
    points=WORDS | NOTHING,
    reference=WORDS | NOTHING,
    a_priori=TRUTH,
)
def compare(
    first: Adjustment,
    second: Adjustment,
    level: float = LEVEL,
    *,
    points: Collection[str] | None = None,
    reference: Collection[str] | None = None,
    a_priori: bool = False,
) -> Comparison:
    """What has moved between two epochs of a network.

    Without reference points the displacements are those in the datum of the adjustments, in which the errors
    of known coordinates, the same in both, cancel. Where something seems to have moved, what the observations
    alone say of the known points is compared first: if one of these has moved, it is named, and the others
    are the reference points (`Comparison.is_known`). With reference points
    the epochs are fitted together on those of them that have stayed; best when they were adjusted on inner
    constraints of these, `Datum("inner", points=reference)`, so that no known coordinates bend the network.

    Args:
        first: The first epoch.
        second: The second epoch, in the same frame.
        level: Probability that one test finds a movement where there is none.
        points: Names of the points to show and to test together; all common points by default. What is found
            of each does not depend on which others are shown.
        reference: Names of points that should have stayed: those that have not are found and named.
        a_priori: Whether the given sigmas are trusted, instead of being scaled by the estimated sigma0.

    Raises:
        InputError: The epochs are in different frames, have no points in common, or the reference points do
            not agree with one another.
    """
    checked_probability(level, "compare: level")
    points, reference = (None if given is None else [*map(composed, given)] for given in (points, reference))
    common = _common(first, second, points, reference)
    wanted = set(common if points is None else points) | set(reference or ())
    # what is found does not depend on which points are shown, as long as all have room
    epochs, names = (first, second), common
    if points is not None and len(common) > MOST_POINTS:
        wanted_or_known = wanted | set(known_points(epochs, common))
        names = tuple(name for name in common if name in wanted_or_known)
    if reference is not None:
        found = _relative(epochs, names, reference, level, trusted=a_priori)
    else:
        found = _as_adjusted(epochs, names, level, trusted=a_priori)
        found = found if found.is_quiet else _without_moved_known_points(found, trusted=a_priori)
    return found if points is None else _shown(found, wanted)


def _shown(found: Comparison, wanted: Collection[str]) -> Comparison:
    """What was found of some of the points; without reference points, they are tested together."""
    moved = found.displacements
    rows = np.array([row for row, name in enumerate(moved.names) if name in wanted], np.int64)
    shown, staying = moved.of(rows), found.reference
    return replace(
        found,
        displacements=shown,
        tests=tuple(found.tests[row] for row in rows.tolist()),
        overall=found.overall[rows],
        reference=None if staying is None else staying[rows],
        congruence=congruence(shown, shown.tested, found.tester) if staying is None else found.congruence,
    )


def _as_adjusted(epochs: Epochs, names: tuple[str, ...], level: float, *, trusted: bool) -> Comparison:
    """The comparison in the datum of the epochs."""
    moved, tester = displacements(*epochs, names), _tester(*epochs, level, trusted=trusted)
    return _comparison(epochs, moved, tester, congruence(moved, moved.tested, tester), None)


def _relative(
    epochs: Epochs, names: tuple[str, ...], reference: Collection[str], level: float, *, trusted: bool
) -> Comparison:
    """The comparison with epochs that are fitted together on the reference points that have stayed."""
    tester = _tester(*epochs, level, trusted=trusted)
    moved = displacements(*epochs, names)
    chosen = np.array([name in set(reference) for name in names], np.bool_)
    motions = motions_of(epochs, moved, chosen, is_spatial=not _frame(epochs).has_vertical)
    found = moved_references(moved, chosen, tester, motions)
    staying = chosen.copy()
    staying[[*found.certain, *found.undecided]] = False
    is_whole = not found.sets or determine(motions, staying)
    staying = staying if is_whole else chosen
    moved = relative_to(moved, staying, motions)
    compared = _comparison(epochs, moved, tester, congruence(moved, staying, tester), staying)
    sets, rejected = ([[names[row] for row in one] for one in rows] for rows in (found.sets, found.rejected))
    certain, open_ = (tuple(names[row] for row in rows) for rows in (found.certain, found.undecided))
    first, second = (without_explained(epoch, (*certain, *open_), reference) for epoch in epochs)
    return replace(
        compared,
        epochs=(first, second),
        moved=certain,
        undecided=open_,
        doubts=() if is_whole else undecided(sets),
        reservations=told_by_others(sets, rejected, *found.witnesses),
    )


def _without_moved_known_points(found: Comparison, *, trusted: bool) -> Comparison:
    """The comparison, relative to the known points that have stayed where others of them have moved."""
    names = found.displacements.names
    known = known_points(found.epochs, names)
    if len(known) < LEAST_KNOWN:
        return found
    first, second = (by_observations(epoch, known) for epoch in found.epochs)
    if first is None or second is None:
        return replace(found, reservations=taken_for_granted(known))
    try:
        relative = _relative((first, second), names, known, found.tester.level, trusted=trusted)
    except InputError:
        return replace(found, epochs=(first, second), doubts=at_odds(known))
    return replace(relative, is_known=True) if relative.moved or relative.undecided else found


def _comparison(
    epochs: Epochs, moved: Displacements, tester: Tester, together: TestRecord, staying: BoolArray | None
) -> Comparison:
    local = moved.turned(_frame(epochs).vertical(moved.places))
    tests = tuple(
        tester.of(local.vectors[row], local.block(row)) if local.tested[row] else None
        for row in range(len(local.names))
    )
    return Comparison(
        local,
        tests,
        _overall(tests, staying),
        together,
        staying,
        (),
        _same_precision(*epochs, tester),
        tester,
        epochs,
    )


def _overall(tests: tuple[TestRecord | None, ...], staying: BoolArray | None) -> FloatArray:
    """(n,) what each test is worth among all of them; NaN for points that are held, or tested together."""
    single = np.array([test is not None for test in tests])
    if staying is not None:
        single &= ~staying
    found = np.full(len(tests), np.nan)
    found[single] = holm(
        [test.p_value for test, is_one in zip(tests, single, strict=True) if test and is_one]
    )
    return found


def _frame(epochs: Epochs) -> Frame:
    return Frame(crs.parse(epochs[0].frame))


def _common(
    first: Adjustment, second: Adjustment, points: Collection[str] | None, reference: Collection[str] | None
) -> tuple[str, ...]:
    """The points of both epochs, those that are asked for among them."""
    there = set(second.points.names)
    common = tuple(name for name in first.points.names if name in there)
    for what, given in (("points", points), ("reference", reference)):
        unknown = sorted(set(given or ()) - set(common))
        if unknown:
            raise InputError(f"compare: {what} {', '.join(unknown)}: not in both epochs")
    if not common or (points is not None and not points and not reference):
        raise InputError("compare: the two epochs have no point in common")
    if reference is not None and len(set(reference)) < 2:
        raise InputError("compare: give at least two reference points")
    return common


def _tester(first: Adjustment, second: Adjustment, level: float, *, trusted: bool) -> Tester:
    freedoms = [epoch.solution.redundancy for epoch in (first, second)]
    if trusted or sum(freedoms) <= 0:
        return Tester(level)
    squares = sum(
        (epoch.solution.variance_factor or 0.0) * freedom
        for epoch, freedom in zip((first, second), freedoms, strict=True)
    )
    if not squares > 0.0:
        raise InputError("compare: the residuals of both epochs are zero; trust the given sigmas (a_priori)")
    return Tester(level, squares / sum(freedoms), sum(freedoms))


def _same_precision(first: Adjustment, second: Adjustment, tester: Tester) -> TestRecord | None:
    factors = [(epoch.solution.variance_factor, epoch.solution.redundancy) for epoch in (first, second)]
    known = [(value, freedom) for value, freedom in factors if value and freedom > 0]
    if tester.redundancy is None or len(known) < 2:
        return None
    (low, below), (high, above) = sorted(known)
    return tester.of_ratio(high / low, above, below)


def _by_significance(item: DisplacementRecord) -> tuple[bool, float]:
    return (item.test is None, item.test.p_value if item.test else 1.0)
