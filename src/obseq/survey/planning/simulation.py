"""Observations as they would be, at coordinates that count as true; adjustments of such draws, as a check."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from obseq.arguments import NOTHING, SEED, TRUTH, expecting, instance
from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.errors import InputError, ObseqError
from obseq.leastsquares.statistics.distributions import chi_square_tails
from obseq.printable import listed
from obseq.records.plan import DrawsRecord
from obseq.stopwatch import Progress
from obseq.survey.adjustment.adjusted import Adjustment
from obseq.survey.equations.equations import Equations
from obseq.survey.equations.plumb import Plumb
from obseq.survey.initial.approximations import sentences_of
from obseq.survey.initial.initial_values import InitialValues
from obseq.survey.initial.orienting import plumb_rotation
from obseq.survey.kinds.registry import BY_CODE
from obseq.survey.model import Orientation, Points, automatic_fix
from obseq.survey.network import Network
from obseq.survey.sights.sights import GIVEN

TURN = 2.0 * np.pi


@dataclass(frozen=True)
class Simulation:
    """What would be observed in a network whose coordinates are true.

    Attributes:
        network: points with their true coordinates, and the intended observations; their values do not count.
    """

    network: Network

    @cached_property
    def truth(self) -> InitialValues:
        """Where points and instruments are."""
        return truth(self.network)

    @cached_property
    def _equations(self) -> Equations:
        network = self.network
        Plumb(network.frame, network.points).check(network.book, self.truth.orientations)
        return Equations(network.frame, network.point_system, network.points, network.book, self.truth)

    @cached_property
    def _fitted(self) -> tuple[FloatArray, FloatArray]:
        """(n,) residuals of the values that are there, and (n,) sigmas."""
        return self._equations.fitted(self._equations.system)

    @cached_property
    def exact(self) -> FloatArray:
        """(n,) values without error, m or rad; those of inactive observations stay as they are."""
        observations = self.network.book.observations
        residuals, _ = self._fitted
        values = observations.values + np.where(observations.active, np.nan_to_num(residuals), 0.0)
        kinds = [BY_CODE[code] for code in observations.types.tolist()]
        is_circle = np.array([kind.is_angle for kind in kinds], np.bool_) & observations.active
        return np.where(is_circle, np.mod(values, TURN), values)

    @property
    def sigmas(self) -> FloatArray:
        """(n,) sigmas of the observations, relative parts included."""
        return self._fitted[1]

    def without_errors(self) -> Network:
        """The network with exact observations."""
        return with_values(self.network, self.exact)

    def drawn(self, rng: np.random.Generator) -> Network:
        """The network with normal errors in its observations and in its known coordinates."""
        drawn = with_values(self.network, self.exact + self._errors(rng))
        return replace(drawn, points=self._known(rng))

    def _errors(self, rng: np.random.Generator) -> FloatArray:
        """(n,) errors of the observations, with their covariances."""
        book = self.network.book
        errors = rng.standard_normal(len(book.observations)) * self.sigmas
        for cluster in book.clusters:
            errors[cluster.rows] = _correlated(rng, cluster.covariance)
        return np.where(book.observations.active, errors, 0.0)

    def _known(self, rng: np.random.Generator) -> Points:
        """The points with errors in the coordinates that are known with a sigma."""
        points, system = self.network.points, self.network.point_system
        errors = rng.standard_normal((len(points), 3)) * np.nan_to_num(points.sigmas)
        if points.covariance is not None:
            where = tuple(np.array(_places(points)).T)
            errors[where] = _correlated(rng, points.covariance.matrix)
        axes, _ = system.axes(points.coordinates)
        moved = points.coordinates + np.linalg.solve(axes, errors[:, :, None])[:, :, 0]
        return replace(points, coordinates=moved)


@expecting(network=instance(Network), seed=SEED | NOTHING, noise=TRUTH)
def simulate(network: Network, seed: int | None = None, *, noise: bool = True) -> Network:
    """The network as it would be observed if its coordinates were true.

    Args:
        network: Points and the intended observations. Where all points have coordinates, the values of the
            observations do not count; otherwise they place the points. Placeholders (0 0 0, or several points
            at one place, which the observations contradict) are no coordinates.
        seed: Of the random numbers; the same seed gives the same errors.
        noise: Whether observations and known coordinates have errors, normal ones with their sigmas.

    Returns:
        The same points and observations with other values; known coordinates are moved by their errors.

    Raises:
        InputError: points have no coordinates, and the observations do not place them.
    """
    simulation = Simulation(placed(network))
    return simulation.drawn(np.random.default_rng(seed)) if noise else simulation.without_errors()


def _correlated(rng: np.random.Generator, covariance: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.cholesky(covariance) @ rng.standard_normal(len(covariance)))


def _places(points: Points) -> list[tuple[int, int]]:
    """Row and component of the coordinates that have a covariance."""
    given: IntArray | tuple[tuple[str, int], ...] = points.covariance.coordinates if points.covariance else ()
    return [(points.index[str(name)], int(component)) for name, component in given]


MOST_NAMED = 10


def truth(network: Network) -> InitialValues:
    """Where points and instruments are, if the coordinates of the network are true.

    The zero of every horizontal circle points to the north of its place.

    Args:
        network: all its points have coordinates.

    Raises:
        InputError: a plumb instrument stands where there is no vertical.
    """
    points, book = network.points, network.book
    orientations = automatic_fix(book)
    stations = len(book.stations)
    if not network.frame.has_vertical and (orientations == Orientation.VERT.value).any():
        first = int(book.stations.observations(int(np.argmax(orientations == Orientation.VERT.value)))[0])
        raise InputError(f"{book.label(first)}: a #VERT station needs a frame in which there is a vertical")
    verticals = network.frame.vertical(points.coordinates[book.stations.origins])
    return InitialValues(
        coordinates=points.coordinates.copy(),
        rotations=plumb_rotation(verticals, np.zeros(stations)),
        g0=np.zeros(stations),
        orientations=orientations,
        point_steps=(GIVEN,) * len(points),
        station_steps=(GIVEN,) * stations,
        unplaced=(),
        expected_sigmas=np.zeros(len(points)),
    )


def placed(network: Network) -> Network:
    """The network with true coordinates for all points.

    Those of an adjustment where some have none, or placeholders, which are approximations at the origin or at
    another point (0 0 0, say) that an adjustment would not use; a warning says so of these. Other coordinates
    count, whatever the observed values are.

    Raises:
        InputError: the observations do not place such points, or contradict each other.
    """
    points = network.points
    unusable = ~points.has_coordinates | _are_placeholders(network)
    if not unusable.any():
        return network
    lacking = _lacking(points, unusable)
    try:
        adjustment = network.adjust()
    except ObseqError as error:
        raise InputError(f"{lacking}, and the observations do not place them: {error}") from error
    if adjustment.left_out:
        raise InputError(f"{lacking}; {adjustment.left_out[0].sentence}")
    if not adjustment.converged or adjustment.gross_errors:
        raise InputError(f"{lacking}, and the observed values do not agree with each other")
    rows = np.asarray(points.is_free.any(axis=1))
    coordinates = np.where(rows[:, None], adjustment.points.places, points.coordinates)
    unobserved = adjustment.points.points.is_invented & np.isnan(points.coordinates)
    invented = points.is_invented | unobserved
    book = network.book.warned(*sentences_of(adjustment.replaced))
    return replace(network, points=replace(points, coordinates=coordinates, invented=invented), book=book)


def _are_placeholders(network: Network) -> BoolArray:
    """(n,) free points at the origin of their system, or where another is, if an adjustment moves them."""
    points, there = network.points, network.given_points().coordinates
    _, which, counts = np.unique(there, axis=0, return_inverse=True, return_counts=True)
    is_shared = counts[which.reshape(-1)] > 1
    is_origin = (there[:, :2] == 0.0).all(axis=1)
    found = np.asarray(points.is_free.any(axis=1) & (is_shared | is_origin))
    if found.any():
        doubted = list(network.fieldwork.initial_values().replaced)
        found[np.setdiff1d(np.arange(len(points)), doubted)] = False
    return found


def with_values(network: Network, values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> Network:
    """The network with other observed values (n,), m or rad."""
    observations = replace(network.book.observations, values=values)
    return replace(network, book=replace(network.book, observations=observations))


def _lacking(points: Points, unusable: BoolArray) -> str:
    """What is wrong with a network some of whose points have no coordinates, or placeholders."""
    names = [name for name, is_one in zip(points.names, unusable, strict=True) if is_one]
    has_none = not points.has_coordinates[unusable].any()
    have = "have none: add them to" if has_none else "have none, or a placeholder (0 0 0): correct them in"
    told = f"{listed(names, MOST_NAMED)} {have} the point file"
    return f"planning needs approximate coordinates of all points; {told}"


LEVEL = 0.001
"""Probability of calling a right prediction wrong."""
RANK = 1e-9
"""Share of the largest variance of a point below which a direction counts as known."""
MAX_ITERATIONS = 10


class Drawn(NamedTuple):
    """What adjustments of drawn observations gave.

    Attributes:
        errors: (draws, n, 3) adjusted minus true coordinates, m.
        variance_factors: (draws,) squared sigma0; NaN without redundancy.
        failed: how many others did not converge.
    """

    errors: FloatArray
    variance_factors: FloatArray
    failed: int


def draw(simulation: Simulation, count: int, seed: int, progress: Progress | None = None) -> Drawn:
    """Adjusts drawn observations.

    Args:
        simulation: the network, whose coordinates count as true.
        count: number of draws.
        seed: of the random numbers.
        progress: receives how far it is.
    """
    rng = np.random.default_rng(seed)
    errors, factors = [], []
    for number in range(count):
        if progress is not None:
            progress(f"draw {number + 1} of {count}")
        found = _adjusted(simulation, rng)
        if found is not None:
            errors.append(found[0])
            factors.append(found[1])
    shape = (-1, len(simulation.network.points), 3)
    return Drawn(np.array(errors).reshape(shape), np.array(factors), count - len(errors))


def compared(drawn: Drawn, planned: Adjustment, seed: int) -> DrawsRecord:
    """Drawn errors against the precisions of a plan."""
    covariances = planned.points.covariances
    is_unknown = np.trace(covariances, axis1=1, axis2=2) > 0.0
    rows = np.flatnonzero(is_unknown & np.isfinite(covariances).all(axis=(1, 2)))
    inverses, ranks = _inverses(covariances[rows])
    count = len(drawn.errors)
    sums = np.einsum("dni,nij,dnj->n", drawn.errors[:, rows], inverses, drawn.errors[:, rows])
    single = np.array(
        [2.0 * min(chi_square_tails(s, count * rank)) for s, rank in zip(sums, ranks, strict=True)]
    )
    worst = int(np.argmin(single))
    p_value = float(-np.expm1(len(rows) * np.log1p(-min(float(single[worst]), 1.0 - 1e-16))))
    ratios = sums / (count * ranks)
    with_redundancy = np.isfinite(drawn.variance_factors).any()
    return DrawsRecord(
        draws=count + drawn.failed,
        seed=seed,
        ratio=float(ratios.mean()),
        ratio_sigma=float(np.sqrt(2.0 / (count * ranks.mean()))),
        worst_point=planned.points.names[rows[worst]],
        worst_ratio=float(ratios[worst]),
        p_value=p_value,
        agrees=p_value > LEVEL,
        sigma0=float(np.sqrt(np.nanmean(drawn.variance_factors))) if with_redundancy else None,
        failed=drawn.failed,
    )


def _adjusted(simulation: Simulation, rng: np.random.Generator) -> tuple[FloatArray, float] | None:
    """(n, 3) errors of the coordinates in one draw, and its variance factor; None if it did not converge."""
    network, start = simulation.drawn(rng), simulation.truth
    equations = Equations(network.frame, network.point_system, network.points, network.book, start)
    try:
        solution = equations.system.solve(
            max_iterations=MAX_ITERATIONS, before_iteration=equations.follow, strategy="controlled"
        )
    except ObseqError:
        return None
    if not solution.converged:
        return None
    factor = np.nan if solution.variance_factor is None else solution.variance_factor
    return solution.values(equations.points) - start.coordinates, factor


def _inverses(covariances: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Inverses (n, 3, 3) in the directions that are not known exactly, and how many these are."""
    values, vectors = np.linalg.eigh(covariances)
    free: BoolArray = values > RANK * values[:, -1:]
    inverted = np.where(free, 1.0 / np.where(free, values, 1.0), 0.0)
    return np.einsum("nij,nj,nkj->nik", vectors, inverted, vectors), free.sum(axis=1).astype(np.float64)
