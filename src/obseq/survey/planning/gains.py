"""What one more observation would bring: candidates, and how much each lowers the variances of the points.

With the cofactors Q of the plan and the row a of a candidate divided by its sigma, its observation lowers Q
by ``Q a' a Q / (1 + a Q a')``. The candidates stand in the system of the plan with sigmas so large that they
do not count, so that their rows are those of its unknowns.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, replace

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.leastsquares import LeastSquaresResult
from obseq.leastsquares.problem.batches import Batch
from obseq.leastsquares.statistics.final_state import FinalState, final_state
from obseq.records.plan import GainRecord
from obseq.survey.equations.equations import Equations
from obseq.survey.initial.initial_values import InitialValues
from obseq.survey.kinds.registry import BY_CODE
from obseq.survey.model import FieldBook, GroupKind, Observations, group_by_station
from obseq.survey.network import Network

FAINT = 1e8
"""What the sigmas of candidates are multiplied with: their share of a weight is below rounding."""
MOST_CANDIDATES = 20_000
"""Of each kind; the shortest sights are tried."""
AT_A_TIME = 256


@dataclass(frozen=True)
class Candidates:
    """Observations that are not in a plan.

    Attributes:
        network: the plan with the candidates behind its observations.
        first: row of the first candidate.
    """

    network: Network
    first: int

    def __len__(self) -> int:
        return len(self.network.book.observations) - self.first


def candidates(network: Network, farthest: float | None = None) -> Candidates:
    """Every observation of a kind of the plan that it does not have.

    Those that need an instrument are tried from every set-up of the plan, the others between all points. Each
    has the median sigma of its kind.

    Args:
        network: the plan.
        farthest: longest sight, m; by default the longest of the plan.
    """
    observations = network.book.observations
    limit = _longest(network) if farthest is None else farthest
    added = [
        _of_kind(network, code, limit)
        for code in np.unique(observations.types[observations.active]).tolist()
        if _can_be_tried(network.book, code)
    ]
    book = _appended(network.book, [part for part in added if len(part)])
    return Candidates(replace(network, book=book), len(observations))


def gains(tried: Candidates, start: InitialValues, counted: BoolArray) -> list[GainRecord]:
    """What each candidate would bring, the best first.

    Args:
        tried: the candidates.
        start: where points and instruments of the plan are.
        counted: (n,) the points whose precisions matter.
    """
    network = tried.network
    equations = Equations(network.frame, network.point_system, network.points, network.book, start)
    for rows, batch in equations.batches.values():
        batch.sigmas[rows >= tried.first] *= FAINT
    solution = equations.system.solve(max_iterations=0, covariance=True)
    weighing = _Weighing(network, equations.points, solution, counted)
    if not weighing.total > 0.0:
        return []
    state = final_state(equations.system, solution)
    found: list[GainRecord] = []
    for rows, batch in equations.batches.values():
        chosen = np.flatnonzero(rows >= tried.first)
        for part in np.split(chosen, range(AT_A_TIME, len(chosen), AT_A_TIME)):
            found.extend(weighing.of(state, batch, part, rows[part]))
    return sorted(found, key=lambda gain: gain.after)


class _Weighing:
    """Weighs candidates by the variances of the points that count."""

    def __init__(
        self, network: Network, blocks: IntArray, solution: LeastSquaresResult, counted: BoolArray
    ) -> None:
        self._network = network
        self._rows = np.flatnonzero(counted & ~network.points.is_held.all(axis=1))
        variances = np.diagonal(solution.covariance(blocks[self._rows], a_priori=True), axis1=1, axis2=2)
        self._scalars = solution.cofactors.table.scalars(blocks[self._rows], "planning")
        self._variances = variances.sum(axis=1)
        self._n = int(np.count_nonzero(variances > 0.0))
        self.total = float(self._variances.sum())

    def of(self, state: FinalState, batch: Batch, chosen: IntArray, rows: IntArray) -> Iterator[GainRecord]:
        """What candidates of a batch would bring."""
        if not chosen.size:
            return
        whitened = state.rows(batch, chosen)[:, 0] * FAINT
        moved = state.solve(np.ascontiguousarray(whitened.T))
        below = 1.0 + np.einsum("ku,uk->k", whitened, moved)
        numbers = state.equations.free.number[self._scalars]
        for k, row in enumerate(rows.tolist()):
            moves = np.where(numbers >= 0, moved[numbers, k], 0.0)
            yield self._record(row, np.square(moves).sum(axis=1) / below[k])

    def _record(self, row: int, shares: FloatArray) -> GainRecord:
        book = self._network.book
        observations, kind = book.observations, BY_CODE[int(book.observations.types[row])]
        best = int(np.argmax(shares))
        after = max(self.total - float(shares.sum()), 0.0)
        return GainRecord(
            type=kind.name,
            origin=book.point_names[observations.from_points[row]],
            target=book.point_names[observations.to_points[row]],
            sigma=float(observations.sigmas[row]),
            unit=kind.unit,
            before=float(np.sqrt(self.total / self._n)),
            after=float(np.sqrt(after / self._n)),
            point=self._network.points.names[self._rows[best]],
            point_before=float(np.sqrt(self._variances[best])),
            point_after=float(np.sqrt(max(self._variances[best] - shares[best], 0.0))),
        )


def _can_be_tried(book: FieldBook, code: int) -> bool:
    """Whether a kind joins two points, one by one, and has no unknowns of its own."""
    observations = book.observations
    rows = observations.types == code
    alone = not book.in_groups(GroupKind.UNKNOWNS)[rows].any() and (observations.backsights[rows] < 0).all()
    apart = (observations.from_points[rows] != observations.to_points[rows]).all()
    correlated = np.zeros(len(rows), np.bool_)
    for cluster in book.clusters:
        correlated[cluster.rows] = True
    return bool(alone and apart and not correlated[rows].any())


def _longest(network: Network) -> float:
    observations, places = network.book.observations, network.points.coordinates
    rows = observations.active  # the others may name points that the network does not have
    sights = places[observations.to_points[rows]] - places[observations.from_points[rows]]
    return float(np.nanmax(np.linalg.norm(sights, axis=1), initial=0.0))


def _of_kind(network: Network, code: int, farthest: float) -> Observations:
    """The candidates of a kind, the shortest first."""
    book, places = network.book, network.points.coordinates
    rows = np.flatnonzero((book.observations.types == code) & book.observations.active)
    stations, origins, targets = _pairs(network, code, rows)
    lengths = np.linalg.norm(places[targets] - places[origins], axis=1)
    order = np.argsort(lengths, kind="stable")
    kept = order[(lengths[order] > 0.0) & (lengths[order] <= farthest)][:MOST_CANDIDATES]
    template = _taken(book.observations, np.repeat(rows[:1], len(kept)))
    nothing = np.zeros(len(kept))
    return replace(
        template,
        from_points=origins[kept].astype(np.int32),
        to_points=targets[kept].astype(np.int32),
        stations=stations[kept].astype(np.int32),
        values=nothing,
        sigmas=np.full(len(kept), np.median(book.observations.sigmas[rows])),
        relative_sigmas=np.full(len(kept), np.median(book.observations.relative_sigmas[rows])),
        from_heights=nothing,
        to_heights=nothing,
    )


def _pairs(network: Network, code: int, rows: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Set-ups, origins and targets of the sights of a kind that the plan does not have."""
    book, n = network.book, len(network.points)
    observations = book.observations
    if not BY_CODE[code].needs_station:
        present = np.zeros((n, n), np.bool_)
        present[observations.from_points[rows], observations.to_points[rows]] = True
        origins, targets = np.nonzero(np.triu(~(present | present.T), 1))
        return np.full(len(origins), -1), origins, targets
    used = np.unique(observations.stations[rows]).astype(np.int64)
    absent = np.ones((len(used), n), np.bool_)
    absent[np.searchsorted(used, observations.stations[rows]), observations.to_points[rows]] = False
    absent[np.arange(len(used)), book.stations.origins[used]] = False
    numbers, targets = np.nonzero(absent)
    return used[numbers], book.stations.origins[used[numbers]].astype(np.int64), targets


def _taken(observations: Observations, rows: IntArray) -> Observations:
    columns = {item.name: getattr(observations, item.name)[rows] for item in fields(observations)}
    return type(observations)(**columns)


def _appended(book: FieldBook, parts: list[Observations]) -> FieldBook:
    """The field book with more observations behind its own."""
    whole = [book.observations, *parts]
    columns = {
        item.name: np.concatenate([getattr(part, item.name) for part in whole])
        for item in fields(book.observations)
    }
    observations = type(book.observations)(**columns)
    starts, members = group_by_station(observations.stations, len(book.stations))
    return replace(
        book, observations=observations, stations=replace(book.stations, starts=starts, members=members)
    )
