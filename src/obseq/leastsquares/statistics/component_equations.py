"""The equations of variance components: sums of squares, and traces of products of normal matrices."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol, TypeVar

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.leastsquares.assembly.normal_equations import NormalEquations
from obseq.leastsquares.assembly.store import store_layout
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

    def __call__(self, state: FinalState, parts: Sequence[FloatArray]) -> FloatArray:
        """(k, k) traces for matrices G_k, given as values (nnz,) on the pattern of the normal matrix."""


@dataclass(frozen=True)
class Exact:
    """Through Q G_k itself: as many solves as unknowns, memory of k dense matrices."""

    def __call__(self, state: FinalState, parts: Sequence[FloatArray]) -> FloatArray:
        """(k, k) traces."""
        products = [state.solve(state.equations.pattern.dense(part)) for part in parts]
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

    def __call__(self, state: FinalState, parts: Sequence[FloatArray]) -> FloatArray:
        """(k, k) traces."""
        n, times = state.equations.n_unknowns, state.equations.pattern.product
        signs = np.random.default_rng(self.seed).choice([-1.0, 1.0], size=(n, self.probes))
        solved = state.solve(signs)
        left = [times(part, solved) for part in parts]
        right = [state.solve(times(part, signs)) for part in parts]
        traces = np.array([[np.sum(one * other) for other in right] for one in left]) / self.probes
        return np.asarray((traces + traces.T) / 2.0)


@dataclass(frozen=True, eq=False)
class Share:
    """What the components have in the variance of one source.

    Attributes:
        source: the batch or the prior.
        of_components: (k + 1, m) diagonals of D_k, zero where inactive; m scalar observations.
        leverages: (m,) theirs.
    """

    source: Batch | Prior
    of_components: FloatArray
    leverages: FloatArray


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
        layout = store_layout(equations.table, equations.batches, equations.used)
        tables = dict(zip(equations.batches, layout.batches, strict=True))
        for k in range(len(components) + 1):
            batches = _clones(equations.batches, of_batches, k)
            priors = _clones(equations.priors, of_priors, k)
            self._clones.append([*batches, *priors])
            clones = [clone for _, clone in batches], [clone for _, clone in priors]
            own = replace(layout, batches=tuple([tables[source] for source, _ in batches]))
            self._normals.append(NormalEquations(equations.table, *clones, layout=own))

    def variances(self, factors: FloatArray) -> list[tuple[Batch | Prior, FloatArray]]:
        """Variances of all observations for factors (k,)."""
        extended = np.append(factors, 1.0)[None]
        return [
            (source, (extended @ parts.reshape(parts.shape[0], -1)).reshape(parts.shape[1:]))
            for source, parts in zip(self._sources, self._parts, strict=True)
        ]

    def shares(self, state: FinalState, factors: FloatArray) -> list[Share]:
        """What the components have in the variance of each source, for factors (k,)."""
        result = []
        each = zip(self.variances(factors), self._parts, state.all_leverages(), strict=True)
        for (source, variances), parts, leverages in each:
            shares = parts / variances
            if not source.active.all():
                shares[:, ~source.active] = 0.0
            result.append(Share(source, shares.reshape(len(parts), -1), leverages.ravel()))
        return result

    def sums(self, state: FinalState, shares: list[Share]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(k,) sums of squares v' D_k v of normalised residuals, (k,) traces of D_k R and (k,) of D_k."""
        sums = np.zeros((3, len(self.names)))
        for share, normalised in zip(shares, state.all_normalised(), strict=True):
            described = share.of_components[:-1]
            sums[0] += described @ np.square(normalised.ravel())
            sums[1] += described @ (1.0 - share.leverages)
            sums[2] += described.sum(axis=1)
        return sums[0], sums[1], sums[2]

    def matrix(self, state: FinalState, shares: list[Share], traces: Traces) -> tuple[FloatArray, FloatArray]:
        """(k, k) traces of D_k R D_l R, and (k,) what given variances explain of the sums of squares."""
        whole = np.zeros((len(self.names) + 1,) * 2)
        for share in shares:
            flat, source = share.of_components, share.source
            whole += (flat * (1.0 - 2.0 * share.leverages)) @ flat.T
            for pairs, own in zip(self._clones, flat, strict=True):
                for original, clone in pairs:
                    if original is source:
                        clone.weights = source.times_weights(np.sqrt(own).reshape(source.sigmas.shape))
        whole += traces(state, [normal.assemble().values for normal in self._normals])
        return whole[:-1, :-1], whole[:-1, -1]

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


def _clones(sources: Sequence[Source], parts: list[FloatArray], k: int) -> list[tuple[Source, Source]]:
    """Copies of the sources that a component concerns, to be weighted by its shares; data are not copied."""
    return [(source, copy.copy(source)) for source, part in zip(sources, parts, strict=True) if part[k].any()]


def _refuse_without_variance(source: Batch | Prior, parts: FloatArray) -> None:
    wrong = np.argwhere(parts.sum(axis=0) <= 0.0)
    if wrong.size:
        label = source.label(int(wrong[0][0]))
        raise InputError(f"{label}: the variance components give it no variance at all")
