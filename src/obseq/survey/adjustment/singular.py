"""What nothing determines of a network: free motions, loose parts and scales, and what would hold them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.errors import InputError, SingularSystemError
from obseq.graphs import parts
from obseq.leastsquares import LeastSquares
from obseq.leastsquares.diagnosis.free_motions import find_motions
from obseq.leastsquares.diagnosis.singular import grouped
from obseq.records.adjustment import MotionRecord
from obseq.survey.equations.equations import Equations
from obseq.survey.equations.instruments import station_names
from obseq.survey.equations.loose_motions import UNDETERMINED
from obseq.survey.initial.initial_values import InitialValues
from obseq.survey.initial.left_out import Determined
from obseq.survey.initial.unplaced import ISOLATED, Unplaced
from obseq.survey.kinds.registry import IS_ANGLE, among, codes_where
from obseq.survey.model import FieldBook, Points

DECIMALS = 4
"""Of moves, whose largest is 1."""
LEAST = 1e-3
"""Share of the largest direction from which a point is said to move along another."""
SINGULAR = "its observations do not determine it (the system is singular)"
ELSEWHERE = "observe it from other directions"
TILT = "rotation about x"
HOLDS = {
    "the position along": "a known point (flag 1 of the point file; 2 for x and y alone, 3 for z alone)",
    "the rotation about": "an azimuth (Azim, code 8), or another known point, for the rotation",
    TILT: "height differences, zenith angles or known heights (flag 3) for the tilt",
    "the scale": "a distance (Dist, code 3), or another known point, for the scale",
    "of shape": "more observations between these points for the shape",
}
"""What holds a motion, by words of its name."""


def free_motions(equations: Equations, names: Sequence[str]) -> tuple[MotionRecord, ...]:
    """The motions that the datum of a free network takes away; none where known points hold it."""
    if not equations.system.datum_defect:
        return ()
    analysis = equations.system.analysis(reduced=True)
    normal = analysis.equations
    rows = {block: row for row, block in enumerate(equations.points.tolist())}
    found = []
    for motion in find_motions(normal.table, normal.free, normal.pattern, analysis.solver.null_vectors()):
        rounded = np.round(motion.moves, DECIMALS) + 0.0
        moving = rounded.any(axis=1)
        moved = [names[rows[block]] for block in motion.points[moving].tolist()]
        found.append(MotionRecord(motion.text, tuple(moved), tuple(map(tuple, rounded[moving].tolist()))))
    return tuple(found)


def in_words(error: SingularSystemError) -> SingularSystemError:
    """The error of a singular network: which points move, how, and what to give to hold them."""
    if error.kernel is None:  # it comes where the iterations have led
        lost = grouped(error.unknowns) if error.unknowns else "some coordinates"
        told = (
            f"the iterations lead where the observations do not determine {lost} any more. Observe that "
            "more, or give better approximate coordinates (flag 0 of the point file)"
        )
    else:
        told = f"{free_motions_in_words(error)}. Give {_remedy(error)}"
    return SingularSystemError(told, error.unknowns, error.defect, error.kernel, error.movements)


def free_motions_in_words(error: SingularSystemError) -> str:
    """What moves without any residual: "nothing fixes the position along x of A, B (rank deficiency 1)"."""
    free = "; nor ".join(dict.fromkeys(error.movements.values()))
    what = f"nothing fixes {free}" if free else f"the observations do not determine {grouped(error.unknowns)}"
    return what if error.defect is None else f"{what} (rank deficiency {error.defect})"


def _remedy(error: SingularSystemError) -> str:
    """What would hold the motions."""
    free = " and ".join(dict.fromkeys(error.movements.values())).replace("rotation about y", TILT)
    named = [remedy for motion, remedy in HOLDS.items() if motion in free]
    if all(text.endswith(f" of {name}") for name, text in error.movements.items()):
        named.insert(0, "observations from other directions")
    return "; ".join(named) or "more observations of it"


def singular_parts(start: Determined, error: SingularSystemError) -> list[Unplaced]:
    """The points, or else the stations, that a singular system leaves undetermined, with the true reason.

    Raises:
        SingularSystemError: these are all unknown points, or none: then nothing can be done without them.
    """
    names = points_of(error)
    free = start.points.is_free.any(axis=1)
    points = [row for row in np.flatnonzero(free).tolist() if start.points.names[row] in names]
    found = _loose_points(start, points, error) if points else _loose_stations(start, names)
    if not found or len(points) == np.count_nonzero(free) > 0:
        raise in_words(error)
    return found


def points_of(error: SingularSystemError) -> set[str]:
    """The names of the points and stations that a singular system does not determine."""
    return {name.rsplit(".", 1)[0] for name in error.unknowns}


def _loose_stations(start: Determined, names: set[str]) -> list[Unplaced]:
    """The stations of these names."""
    book, reason = start.book, f"{SINGULAR}; {ELSEWHERE}"
    return [
        Unplaced(
            f"{name} ({book.place(int(book.stations.observations(k)[0]))})",
            reason,
            int(book.stations.origins[k]),
            k,
        )
        for k, name in enumerate(station_names(start.points, book))
        if name in names
    ]


def _loose_points(start: Determined, rows: list[int], error: SingularSystemError) -> list[Unplaced]:
    """Points of a singular system, with what nothing holds of them."""
    named = [start.points.names[row] for row in rows]
    along = [()] * len(rows) if error.kernel is None else directions(named, error.unknowns, error.kernel)
    linked = linked_to_known(start.points, start.book)
    return [
        Unplaced(f"point {name}", _reason(name, axes, error, bool(linked[row])), row, None, axes or None)
        for name, row, axes in zip(named, rows, along, strict=True)
    ]


def _reason(name: str, axes: tuple[tuple[float, ...], ...], error: SingularSystemError, linked: bool) -> str:
    """Why a point is loose: it hangs on nothing, or moves together with others, or in some directions."""
    if not linked:
        return ISOLATED
    if name in error.movements and not error.movements[name].endswith(f" of {name}"):
        return f"{SINGULAR}; nothing fixes {error.movements[name]}"
    listed = " and ".join(f"({x:.2f}, {y:.2f}, {z:.2f})" for x, y, z in axes)
    return f"{SINGULAR}; {ELSEWHERE}" + (f"; nothing holds it along {listed}" if axes else "")


def directions(
    names: Sequence[str], unknowns: Sequence[str], kernel: FloatArray
) -> list[tuple[tuple[float, ...], ...]]:
    """Of each point, unit vectors along which it may move without any residual, the most undetermined first.

    Args:
        names: The points.
        unknowns: (n) names of unknowns, such as "P.x".
        kernel: (n, k) what the vectors of the kernel do to them.
    """
    rows = {unknown: row for row, unknown in enumerate(unknowns)}
    at = np.array([[rows.get(f"{name}.{axis}", -1) for axis in "xyz"] for name in names]).reshape(-1, 3)
    moved = np.where(at[:, :, None] >= 0, kernel[at], 0.0)
    least = LEAST * np.abs(kernel).max(initial=0.0)
    axes, sizes, _ = np.linalg.svd(moved, full_matrices=False)
    found = zip(np.round(axes.swapaxes(1, 2), DECIMALS) + 0.0, sizes > least, strict=True)
    return [tuple(map(tuple, own[large].tolist())) for own, large in found]


def linked_to_known(points: Points, book: FieldBook) -> BoolArray:
    """(n,) whether a chain of observations links each point to a coordinate that is known or observed."""
    rows, parts = book.observations, parts_of(book)
    known = np.flatnonzero(~points.is_free.all(axis=1) | points.in_datum.any(axis=1))
    observed = rows.from_points[rows.active & among(rows.types, codes_where(lambda kind: kind.is_absolute))]
    return np.isin(parts, parts[np.concatenate([known, observed])])


def parts_of(book: FieldBook) -> IntArray:
    """(n,) for each point the part it belongs to: active observations join its points, however indirectly."""
    rows, n = book.observations, len(book.point_names)
    third = rows.active & (rows.backsights >= 0)
    groups = [
        (members[0], other) for row, members in book.barycentres if rows.active[row] for other in members
    ]
    grouped = np.array(groups, np.int32).reshape(-1, 2).T
    first = np.concatenate([rows.from_points[rows.active], rows.from_points[third], grouped[0]])
    second = np.concatenate([rows.to_points[rows.active], rows.backsights[third], grouped[1]])
    return np.asarray(parts(n, first, second), np.int64)


def check_scales(
    start: Determined,
    equations: Equations,
    equations_of: Callable[[Determined], Equations],
    whole: Callable[..., Determined],
) -> None:
    """Refuses to estimate a scale of instruments that the observations and the datum do not determine.

    Args:
        start: The network.
        equations: Its equations.
        equations_of: A network -> its equations.
        whole: A network -> what of it is determined.

    Raises:
        InputError: naming the scales.
    """
    scales = equations.shared.scales()
    if not scales:
        return
    equations = equations_of(start)
    before = _defect(equations.system)
    equations.system.freeze(list(scales.values()))
    if before > _defect(equations.system):
        raise _unscaled(scales)
    equations = equations_of(whole(start))
    solution = equations.system.solve(max_iterations=0, covariance=True)
    scales = equations.shared.scales()
    sigmas = solution.precisions(list(scales.values()), a_priori=True)[:, 0].tolist()
    named = zip(scales, sigmas, strict=True)
    if loose := [f"{name} (+- {sigma:.0%})" for name, sigma in named if sigma > UNDETERMINED]:
        raise _unscaled(loose)


def _defect(system: LeastSquares) -> int:
    """Number of unknowns that nothing but a datum determines."""
    try:
        system.solve(max_iterations=1)
    except SingularSystemError as error:
        return error.defect or 0
    return system.datum_defect


def _unscaled(names: Iterable[str]) -> InputError:
    return InputError(
        f"nothing determines the scale of {', '.join(names)}: the network has no length beside the distances "
        "whose scale is asked for; let two known points hold it (datum given; inner constraints give no "
        "length), or do not estimate the scale"
    )


LISTED = 8
"""Names given in a message before it says how many more there are."""

SHORTEST_HORIZONTAL = 1e-5
"""Horizontal distance (m) below which a direction means nothing: 1 um turns it by 0.1 rad."""


def check_datum(points: Points, book: FieldBook) -> None:
    """Raises InputError when no coordinate of any point is known, or observed, or carries a datum."""
    if not points.is_free.all() or points.in_datum.any():
        return
    absolute = among(book.observations.types, codes_where(lambda kind: kind.is_absolute))
    if not (absolute & book.observations.active).any():
        raise InputError(
            "no point is known: nothing fixes the position of the network. Give at least one point of the "
            "point file as known with its sigma (flag 1; of a levelling 5, and 4 for points between)"
        )


def check_counts(points: Points, book: FieldBook) -> None:
    """Raises InputError naming the points that have fewer observations than free coordinates."""
    observations, n = book.observations, len(points)
    count = book.counts(observations.active, n)
    lacking = np.flatnonzero(count < points.is_unknown.sum(axis=1))
    if lacking.size:
        listed = ", ".join(f"{points.names[row]} ({count[row]})" for row in lacking[:LISTED])
        more = f" and {lacking.size - LISTED} more" if lacking.size > LISTED else ""
        raise InputError(
            f"points with fewer active observations (in brackets) than unknown coordinates: {listed}{more}. "
            f"Observe them more, or remove them from the point file"
        )


def check_sights(book: FieldBook, initial: InitialValues) -> None:
    """Raises InputError at the first angle whose target is on the vertical axis of its station."""
    observations = book.observations
    is_angle = IS_ANGLE[observations.types] & (observations.stations >= 0)
    rows = np.flatnonzero(is_angle & observations.active)
    coordinates = initial.coordinates
    sights = coordinates[observations.to_points[rows]] - coordinates[observations.from_points[rows]]
    seen = np.einsum("nji,nj->ni", initial.rotations[observations.stations[rows]], sights)
    vertical = np.flatnonzero(np.hypot(seen[:, 0], seen[:, 1]) < SHORTEST_HORIZONTAL)
    if vertical.size:
        row, target = int(rows[vertical[0]]), book.point_names[observations.to_points[rows[vertical[0]]]]
        coincide = abs(seen[vertical[0], 2]) < SHORTEST_HORIZONTAL
        where = "has the coordinates of the station" if coincide else "is on the vertical of the station"
        raise InputError(
            f"{book.label(row)}: the target {where}; its direction is undefined. "
            f"Remove the line, or correct the coordinates of {target}"
        )
