"""The equations of variance components: sums of squares, and traces of products of normal matrices."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING, Protocol, TypeVar

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.leastsquares.assembly.normal_equations import NormalEquations

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scipy.sparse import csc_array

    from obseq.arrays import FloatArray
    from obseq.leastsquares.problem.batches import Batch
    from obseq.leastsquares.problem.priors import Prior
    from obseq.leastsquares.statistics.final_state import FinalState
    from obseq.leastsquares.system import LeastSquares


Source = TypeVar("Source", "Batch", "Prior")


@dataclass(frozen=True)
class Component:
    """A part of the variance of some observations.

    Attributes:
        name: what it is called.
        parts: for each batch or prior that it concerns, the variance that it gives each scalar observation
            when its factor is 1: (n, n_residuals), or (n_scalars, 1) for a prior, in squared units.
    """

    name: str
    parts: tuple[tuple[Batch | Prior, FloatArray], ...]


class Traces(Protocol):
    """How the traces of Q G_k Q G_l are computed."""

    def __call__(self, state: FinalState, parts: Sequence[csc_array]) -> FloatArray:
        """(k, k) traces for symmetric sparse matrices G_k."""


@dataclass(frozen=True)
class Exact:
    """Through Q G_k itself: as many solves as unknowns, memory of k dense matrices."""

    def __call__(self, state: FinalState, parts: Sequence[csc_array]) -> FloatArray:
        """(k, k) traces."""
        products = [state.solve(part.toarray()) for part in parts]
        return np.array([[np.sum(one * other.T) for other in products] for one in products])


@dataclass(frozen=True)
class Sampled:
    """Estimated from random vectors z of signs: the mean of z' Q G_k Q G_l z.

    Attributes:
        probes: number of random vectors; errors decrease with its square root.
        seed: of the vectors, the same in each round.
    """

    probes: int
    seed: int

    def __call__(self, state: FinalState, parts: Sequence[csc_array]) -> FloatArray:
        """(k, k) traces."""
        n = state.equations.n_unknowns
        signs = np.random.default_rng(self.seed).choice([-1.0, 1.0], size=(n, self.probes))
        solved = state.solve(signs)
        left = [part @ solved for part in parts]
        right = [state.solve(part @ signs) for part in parts]
        traces = np.array([[np.sum(one * other) for other in right] for one in left]) / self.probes
        return np.asarray((traces + traces.T) / 2.0)


class ComponentEquations:
    """Everything that the equations of some components need of a system, laid out once.

    What no component describes is one more component, of factor 1, the last one.
    """

    def __init__(self, system: LeastSquares, components: Sequence[Component]) -> None:
        equations = system.equations()
        self.names = tuple(component.name for component in components)
        sources: tuple[Batch | Prior, ...] = (*equations.batches, *equations.priors)
        self._parts = [self._parts_of(source, components) for source in sources]
        for source, parts in zip(sources, self._parts, strict=True):
            _refuse_without_variance(source, parts)
        of_batches, of_priors = self._parts[: len(equations.batches)], self._parts[len(equations.batches) :]
        self._sources = sources
        self._clones: list[list[tuple[Batch | Prior, Batch | Prior]]] = []
        self._normals = []
        for k in range(len(components) + 1):
            batches = _clones(equations.batches, of_batches, k)
            priors = _clones(equations.priors, of_priors, k)
            self._clones.append([*batches, *priors])
            clones = [clone for _, clone in batches], [clone for _, clone in priors]
            self._normals.append(NormalEquations(equations.table, *clones))

    def variances(self, factors: FloatArray) -> list[tuple[Batch | Prior, FloatArray]]:
        """Variances of all observations for factors (k,)."""
        extended = np.append(factors, 1.0)
        return [
            (source, np.tensordot(extended, parts, 1))
            for source, parts in zip(self._sources, self._parts, strict=True)
        ]

    def sums(self, state: FinalState, factors: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(k,) sums of squares v' D_k v of normalised residuals, (k,) traces of D_k R and (k,) of D_k."""
        squares, redundancy, weight = (np.zeros(len(factors)) for _ in range(3))
        each = zip(self._shares(state, factors), state.all_normalised(), strict=True)
        for (_, shares, leverages), normalised in each:
            residuals = np.square(normalised)
            squares += np.tensordot(shares[:-1], residuals, 2)
            redundancy += np.tensordot(shares[:-1], 1.0 - leverages, 2)
            weight += shares[:-1].sum(axis=(1, 2))
        return squares, redundancy, weight

    def matrix(self, state: FinalState, factors: FloatArray, traces: Traces) -> tuple[FloatArray, FloatArray]:
        """(k, k) traces of D_k R D_l R, and (k,) what given variances explain of the sums of squares."""
        n = len(factors) + 1
        whole = np.zeros((n, n))
        for source, shares, leverages in self._shares(state, factors):
            flat = shares.reshape(n, -1)
            whole += (flat * (1.0 - 2.0 * leverages.ravel())) @ flat.T
            for k, pairs in enumerate(self._clones):
                for original, clone in pairs:
                    if original is source:
                        clone.weights = source.times_weights(np.sqrt(shares[k]))
        whole += traces(state, [self._part(state, normal) for normal in self._normals])
        return whole[:-1, :-1], whole[:-1, -1]

    def _shares(
        self, state: FinalState, factors: FloatArray
    ) -> list[tuple[Batch | Prior, FloatArray, FloatArray]]:
        """For each source: (k + 1, n, n_residuals) diagonals of D_k, zero where inactive; its leverages."""
        result = []
        each = zip(self.variances(factors), self._parts, state.all_leverages(), strict=True)
        for (source, variances), parts, leverages in each:
            shares = parts / variances
            shares[:, ~source.active] = 0.0
            result.append((source, shares, leverages))
        return result

    @staticmethod
    def _parts_of(source: Batch | Prior, components: Sequence[Component]) -> FloatArray:
        """(k + 1, n, n_residuals) variances of one source by component; last those that none describes."""
        parts = np.zeros((len(components) + 1, *source.sigmas.shape))
        for k, component in enumerate(components):
            for described, variances in component.parts:
                if described is source:
                    parts[k] += variances
        if not any(described is source for component in components for described, _ in component.parts):
            parts[-1] = np.square(source.sigmas)
        return parts

    @staticmethod
    def _part(state: FinalState, normal: NormalEquations) -> csc_array:
        """The matrix G = A' D A of one component, in the numbering of the whole system."""
        from scipy.sparse import csc_array

        n = state.equations.n_unknowns
        if not (normal.batches or normal.priors):
            return csc_array((n, n))
        local = normal.pattern.matrix(normal.assemble().values.copy()).tocoo()
        number = state.equations.free.number[normal.free.scalars]
        return csc_array((local.data, (number[local.row], number[local.col])), shape=(n, n))


def _clones(sources: Sequence[Source], parts: list[FloatArray], k: int) -> list[tuple[Source, Source]]:
    """Copies of the sources that a component concerns, to be weighted by its shares; data are not copied."""
    return [(source, copy.copy(source)) for source, part in zip(sources, parts, strict=True) if part[k].any()]


def _refuse_without_variance(source: Batch | Prior, parts: FloatArray) -> None:
    wrong = np.argwhere(parts.sum(axis=0) <= 0.0)
    if wrong.size:
        label = source.label(int(wrong[0][0]))
        raise InputError(f"{label}: the variance components give it no variance at all")
