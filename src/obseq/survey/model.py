"""Observations and stations of a survey network, in columns (metres, radians); its points are in `points`."""

from __future__ import annotations

import enum
from dataclasses import fields, replace

import numpy as np
import numpy.typing as npt

from obseq.arguments import expecting, instance
from obseq.arrays import BoolArray, FloatArray
from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.records.adjustment import UnusedRecord
from obseq.survey.kinds.registry import BY_CODE, KINDS, among, codes
from obseq.survey.points import CoordinateCovariance as CoordinateCovariance
from obseq.survey.points import Points as Points
from obseq.survey.points import make_points as make_points
from obseq.survey.points import merge_points as merge_points
from obseq.survey.points import points_of_lines as points_of_lines

IntArray = npt.NDArray[np.int32]
_ORIENTING = codes(*(kind for kind in KINDS if kind.orients > 0))
_ORIENTING_UNLESS_ZERO = codes(*(kind for kind in KINDS if kind.orients < 0))


class Orientation(enum.IntEnum):
    """How a station is turned: local axes, plumb with an unknown zero, free, along the grid, as an image.

    `GRID` is Comp3D's, for differences of coordinates: east and north are those of the origin of the frame.
    `CAM` is a camera, which reads directions in its own axes; its point is called like its image.
    Arrays are compared with its `value`: NumPy asks members for attributes, and loses interruptions then.
    """

    FIX = 0
    VERT = 1
    BASC = 2
    GRID = 3
    CAM = 4

    @property
    def keyword(self) -> str:
        """The status line of OBS files, such as `#VERT`."""
        return f"#{self.name}"


@dataclass(frozen=True, eq=False)
class Observations:
    """Observations, one row each, in reading order.

    Attributes:
        types: (n,) int16 codes of kinds (`obseq.survey.kinds.registry`).
        from_points: (n,) int32 rows of the field book's `point_names`.
        to_points: (n,) int32, likewise.
        values: (n,) float64 m or rad, as read (angles are not normalised).
        sigmas: (n,) float64 m or rad, positive (the absolute value for inactive ones).
        relative_sigmas: (n,) float64 what is added to the sigma: of lengths, this share of the distance; of
            angles, this length (m) over the distance.
        from_heights: (n,) float64 m, height of the instrument above its point.
        to_heights: (n,) float64 m, height of the target above its point.
        active: (n,) bool, false when the file switches the observation off.
        stations: (n,) int32 station of the observation; -1 for kinds that need none.
        groups: (n,) int32 group of the observation, which has unknowns of its own; -1 for none.
        file_indices: (n,) int32 index in the field book's `files`.
        lines: (n,) int32 line in that file, from 1.
        backsights: (n,) int32 rows of `point_names` of the third point of angles; -1 for all others.
    """

    types: npt.NDArray[np.int16]
    from_points: IntArray
    to_points: IntArray
    values: FloatArray
    sigmas: FloatArray
    relative_sigmas: FloatArray
    from_heights: FloatArray
    to_heights: FloatArray
    active: BoolArray
    stations: IntArray
    groups: IntArray
    file_indices: IntArray
    lines: IntArray
    backsights: IntArray

    def __len__(self) -> int:
        return len(self.types)

    def naming(self, points: BoolArray) -> BoolArray:
        """(k,) whether each observation names one of some points (a mask over `point_names`)."""
        third = np.append(points, np.False_)[self.backsights]
        return np.asarray(points[self.from_points] | points[self.to_points] | third)

    def counts(self, chosen: BoolArray, n: int) -> IntArray:
        """(n,) how many chosen observations (a mask) name each of the first n points."""
        others = chosen & (self.to_points != self.from_points)
        ends = (self.from_points[chosen], self.to_points[others])
        third = self.backsights[chosen & (self.backsights >= 0)]
        named = np.concatenate([*ends, third])
        return np.bincount(named, minlength=n)[:n].astype(np.int32)

    @property
    def n_inactive(self) -> int:
        """Number of observations that the files switch off."""
        return int(np.count_nonzero(~self.active))


@dataclass(frozen=True, eq=False)
class Stations:
    """Station sets: the observations of one set-up of an instrument share one orientation.

    Attributes:
        origins: (m,) int32 rows of the field book's `point_names`.
        orientations: (m,) int8 values of `Orientation`, as declared.
        starts: (m + 1,) int32 where the members of each station begin in `members`.
        members: int32 rows of `Observations`, active or not, station by station in reading order.
    """

    origins: IntArray
    orientations: npt.NDArray[np.int8]
    starts: IntArray
    members: IntArray

    def __len__(self) -> int:
        return len(self.origins)

    def observations(self, station: int) -> IntArray:
        """Rows of the observations of one station."""
        return self.members[self.starts[station] : self.starts[station + 1]]


class GroupKind(enum.Enum):
    """What observations are grouped by.

    `UNKNOWNS` have unknowns of their own. Those of an `INSTRUMENT` that a file names, or the distances of a
    polar `FRAME`, get some when the user asks for them (`--estimate`).
    """

    UNKNOWNS = "unknowns"
    INSTRUMENT = "instrument"
    FRAME = "frame"


@dataclass(frozen=True)
class Group:
    """Observations that share unknowns of their own: those of an axis of rotation, equal distances.

    Attributes:
        name: For messages.
        parent: The group whose unknowns it has besides its own (an axis, of a turning target); -1 for none.
        numbers: What the formula of its observations takes before the value, where files give that.
        kind: What its observations are grouped by.
        members: Rows of the field book's `point_names`: the points of a barycentre.
        weights: Their weights in it, of a positive sum; in rows of normal equations, coefficients.
    """

    name: str
    parent: int = -1
    numbers: tuple[float, ...] = ()
    kind: GroupKind = GroupKind.UNKNOWNS
    members: tuple[int, ...] = ()
    weights: tuple[float, ...] = ()

    @property
    def shares(self) -> FloatArray:
        """(k,) what each member counts for in the barycentre; their sum is 1."""
        weights = np.array(self.weights, np.float64)
        return np.asarray(weights / weights.sum())

    def renumbered(self, numbers: IntArray) -> Group:
        """The same with new rows of its members."""
        members = numbers[list(self.members)].tolist() if self.members else ()
        return replace(self, members=tuple(members))


@dataclass(frozen=True, eq=False)
class Cluster:
    """Observations that are correlated with one another; their sigmas do not count.

    Attributes:
        rows: (k,) int64 rows of the field book, ascending, of kinds of one family.
        covariance: (k, k) in squares of m and rad, symmetric and positive definite.
    """

    rows: npt.NDArray[np.int64]
    covariance: FloatArray

    def among(self, chosen: BoolArray) -> Cluster:
        """What is left of it when only some observations (a mask of the field book) count."""
        kept = chosen[self.rows]
        return Cluster(self.rows[kept], self.covariance[np.ix_(kept, kept)])


@dataclass(frozen=True, eq=False)
class FieldBook:
    """What OBS files contain.

    Attributes:
        point_names: names that observations quote, in order of appearance.
        observations: all observations.
        stations: the station sets; each has at least one active observation.
        files: names of the files read.
        groups: the groups of observations that share unknowns.
        clusters: observations that are correlated with one another; none stands in two of them.
        warnings: things that were read and not used, one sentence each.
        unused: observations that take no part, though the files do not switch them off.
    """

    point_names: tuple[str, ...]
    observations: Observations
    stations: Stations
    files: tuple[str, ...]
    groups: tuple[Group, ...] = ()
    clusters: tuple[Cluster, ...] = ()
    warnings: tuple[str, ...] = ()
    unused: tuple[UnusedRecord, ...] = ()

    def place(self, row: int) -> str:
        """`file:line` of an observation."""
        observations = self.observations
        return f"{self.files[observations.file_indices[row]]}:{observations.lines[row]}"

    def naming(self, points: BoolArray) -> BoolArray:
        """(k,) whether each observation, or its group, names one of some points (a mask)."""
        touched = self.observations.naming(points)
        for row, members in self.barycentres:
            touched[row] |= points[members].any()
        return touched

    def counts(self, chosen: BoolArray, n: int) -> IntArray:
        """(n,) how many chosen observations (a mask), or groups of them, name each of the first n points."""
        found = self.observations.counts(chosen, n)
        for row, members in self.barycentres:
            if chosen[row]:
                found[[member for member in members[1:] if member < n]] += 1
        return found

    @cached_property
    def barycentres(self) -> list[tuple[int, list[int]]]:
        """Rows of the conditions of barycentres, with the members."""
        has_members = np.array([*(bool(group.members) for group in self.groups), False], np.bool_)
        groups = self.observations.groups
        rows = np.flatnonzero(has_members[groups])
        return [(row, list(self.groups[groups[row]].members)) for row in rows.tolist()]

    def in_groups(self, *kinds: GroupKind) -> BoolArray:
        """(n,) whether each observation is in a group of these kinds."""
        wanted = np.array([*(group.kind in kinds for group in self.groups), False], np.bool_)
        return np.asarray(wanted[self.observations.groups])

    @property
    def has_shared_unknowns(self) -> bool:
        """Whether some observations have unknowns of their group."""
        return any(group.kind is GroupKind.UNKNOWNS for group in self.groups)

    @property
    def of_cameras(self) -> BoolArray:
        """(n,) observations of stations that are cameras."""
        is_camera = np.append(self.stations.orientations == Orientation.CAM.value, np.False_)
        return np.asarray(is_camera[self.observations.stations] & self.observations.active)

    def without(self, rows: BoolArray) -> FieldBook:
        """The same with some more observations (a mask) switched off."""
        observations = replace(self.observations, active=self.observations.active & ~rows)
        return replace(self, observations=observations)

    def only(self, rows: BoolArray) -> FieldBook:
        """Some of its observations (a mask) alone, and the members of its stations among them."""
        columns = {entry.name: getattr(self.observations, entry.name)[rows] for entry in fields(Observations)}
        starts, members = group_by_station(columns["stations"], len(self.stations))
        numbers, left = np.cumsum(rows) - 1, [cluster.among(rows) for cluster in self.clusters]
        return replace(
            self,
            observations=Observations(**columns),
            stations=replace(self.stations, starts=starts, members=members),
            clusters=tuple(replace(one, rows=numbers[one.rows]) for one in left if len(one.rows)),
        )

    def warned(self, *sentences: str) -> FieldBook:
        """The same with more warnings."""
        return replace(self, warnings=(*self.warnings, *sentences))

    def label(self, row: int) -> str:
        """`Hz S1 -> T4 (survey.obs:37)`, for messages; an angle has its backsight first."""
        rows = self.observations
        kind = BY_CODE[int(rows.types[row])].name
        ends = (rows.backsights[row], rows.from_points[row], rows.to_points[row])
        names = dict.fromkeys(self.point_names[end] for end in ends if end >= 0)
        return f"{kind} {' -> '.join(names)} ({self.place(row)})"


def group_by_station(stations: IntArray, n_stations: int) -> tuple[IntArray, IntArray]:
    """(starts, members) of `Stations` from the station of each observation (-1: none)."""
    order = np.argsort(stations, kind="stable")
    first = np.searchsorted(stations[order], np.arange(n_stations + 1))
    members = order[first[0] :]
    return (first - first[0]).astype(np.int32), members.astype(np.int32)


@expecting(book=instance(FieldBook))
def automatic_fix(book: FieldBook) -> npt.NDArray[np.int8]:
    """Orientations after MMVII's rule: a station without any active Hz, DX or DY becomes FIX; so does GRID.

    A DX or DY of exactly zero (a target plumb over its mark) turns with no station, and does not count.

    Returns:
        (m,) int8 values of `Orientation`.
    """
    observations = book.observations
    orienting = among(observations.types, _ORIENTING)
    orienting |= (observations.values != 0.0) & among(observations.types, _ORIENTING_UNLESS_ZERO)
    kept = orienting & observations.active & (observations.stations >= 0)
    is_oriented = book.stations.orientations == Orientation.CAM.value
    is_oriented[observations.stations[kept]] = True
    declared = np.where(
        book.stations.orientations == Orientation.GRID.value,
        np.int8(Orientation.FIX.value),
        book.stations.orientations,
    )
    return np.where(is_oriented, declared, np.int8(Orientation.FIX.value)).astype(np.int8)


@expecting(points=instance(Points), book=instance(FieldBook))
def join(points: Points, book: FieldBook) -> tuple[Points, FieldBook]:
    """Gives points and observations one numbering.

    Points that active observations name and no file describes are added, free and without coordinates.

    Returns:
        The completed points, and the field book whose rows `from_points`, `to_points` and `origins` are
        rows of these points. Names that only inactive observations quote come after them in `point_names`.
    """
    rows = dict(points.index)
    quoted = _quoted_by_active(book)
    added = [name for name, used in zip(book.point_names, quoted, strict=True) if used and name not in rows]
    for name in added:
        rows[name] = len(rows)
    unused = [name for name in book.point_names if name not in rows]
    for name in unused:
        rows[name] = len(rows)
    numbers = np.array([rows[name] for name in book.point_names], np.int32)
    completed = merge_points([points, make_points(added, np.full((len(added), 3), np.nan))])
    return completed, _renumbered(book, numbers, (*completed.names, *unused))


def _quoted_by_active(book: FieldBook) -> list[bool]:
    observations = book.observations
    used = np.zeros(len(book.point_names), np.bool_)
    used[observations.from_points[observations.active]] = True
    used[observations.to_points[observations.active]] = True
    used[observations.backsights[observations.active & (observations.backsights >= 0)]] = True
    for row, members in book.barycentres:
        used[members] |= observations.active[row]
    return [bool(flag) for flag in used]


def _renumbered(book: FieldBook, numbers: IntArray, names: tuple[str, ...]) -> FieldBook:
    observations = replace(
        book.observations,
        from_points=numbers[book.observations.from_points],
        to_points=numbers[book.observations.to_points],
        backsights=np.where(
            book.observations.backsights < 0, np.int32(-1), numbers[book.observations.backsights]
        ),
    )
    stations = replace(book.stations, origins=numbers[book.stations.origins])
    groups = tuple(group.renumbered(numbers) for group in book.groups)
    return replace(book, point_names=names, observations=observations, stations=stations, groups=groups)
