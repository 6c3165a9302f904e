"""How well the observations of one batch, or the equations of one prior, are controlled."""

from __future__ import annotations

from dataclasses import field
from typing import Generic, TypeVar

import numpy as np

from obseq.arrays import BoolArray, FloatArray
from obseq.dataclass import dataclass
from obseq.leastsquares.problem.batches import Batch
from obseq.leastsquares.problem.priors import Prior
from obseq.leastsquares.statistics.hypothesis_tests import normal_p_values, tau_p_values
from obseq.leastsquares.statistics.joint_tests import JointTest

Source = TypeVar("Source", bound="Batch | Prior", covariant=True)


@dataclass(frozen=True)
class ObservationReliability(Generic[Source]):
    """The quality of the observations of one batch, or of the equations of one prior.

    All arrays are (n, n_residuals), (n_scalars, 1) for a prior; NaN for inactive observations.

    Attributes:
        source: the batch or the prior.
        residuals: computed minus observed, in the unit of the observation.
        sigmas: given standard deviations.
        redundancy: redundancy numbers r, from 0 (not controlled) to 1 (fully controlled); those of correlated
            residuals may lie outside.
        controlled: True where other observations control this one: w is defined there.
        w: Baarda's standardised residual v / (sigma sqrt(r)), standard normal without blunder; NaN where
            uncontrolled.
        tau: Pope's, w / sigma0 with sigma0 estimated; NaN where uncontrolled, or without redundancy.
        detectable: minimal detectable bias, in the unit of the observation: what the test of w finds with the
            level and the power of the analysis; infinite where uncontrolled.
        left_out_residuals: what the residual would be if this scalar equation alone were left out (v / r when
            uncorrelated), to first order; NaN where uncontrolled. Minus this is the estimate of a blunder.
        external: external reliability, the length sqrt(dx' N dx) of what an undetected bias of that size does
            to the unknowns: no function of them moves by more than this many of its standard deviations.
        joint: the tests of groups of observations as one, where groups were given.
    """

    source: Source
    residuals: FloatArray
    sigmas: FloatArray
    redundancy: FloatArray
    controlled: BoolArray
    w: FloatArray
    tau: FloatArray
    detectable: FloatArray
    left_out_residuals: FloatArray
    external: FloatArray
    _total_redundancy: int = field(repr=False)
    joint: tuple[JointTest, ...] = ()

    @property
    def active(self) -> BoolArray:
        """True where the observation took part in the adjustment."""
        return np.asarray(np.isfinite(self.redundancy))

    @property
    def w_p_values(self) -> FloatArray:
        """Probability of a larger `|w|` without blunder, the given sigmas being right."""
        return normal_p_values(self.w)

    @property
    def tau_p_values(self) -> FloatArray:
        """Probability of a larger `|tau|` without blunder, the sigmas being right up to one factor."""
        return tau_p_values(self.tau, self._total_redundancy)

    def label(self, row: int) -> str:
        """What to call an observation in a message."""
        return self.source.label(row)

    def columns(self) -> dict[str, list[str] | list[int] | list[float]]:
        """A table by columns, a line per scalar equation; `component` numbers those of an observation."""
        n, k = self.redundancy.shape
        lines = [(row, component) for row in range(n) for component in range(k)]
        numbers = {
            "residual": self.residuals,
            "sigma": self.sigmas,
            "redundancy": self.redundancy,
            "w": self.w,
            "tau": self.tau,
            "detectable": self.detectable,
            "external": self.external,
        }
        return {
            "observation": [self.label(row) for row, _ in lines],
            "component": [component for _, component in lines],
            **{name: np.asarray(array, dtype=np.float64).ravel().tolist() for name, array in numbers.items()},
        }
