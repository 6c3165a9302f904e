"""Observations as they would be: exact values at the coordinates of a network, with or without noise."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.arguments import NOTHING, SEED, TRUTH, expecting, instance
from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.survey.equations.equations import Equations
from obseq.survey.equations.plumb import Plumb
from obseq.survey.kinds.registry import BY_CODE
from obseq.survey.network import Network
from obseq.survey.planning.truth import placed, truth, with_values

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, IntArray
    from obseq.survey.initial.initial_values import InitialValues
    from obseq.survey.model import Points

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
