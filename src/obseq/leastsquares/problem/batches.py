"""Batches of equations: many observations of one formula, checked once and laid out for the loops."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from operator import attrgetter

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.errors import InputError
from obseq.leastsquares.problem.arguments import real, text, texts, truths
from obseq.leastsquares.problem.clusters import Clusters, Covariance
from obseq.leastsquares.problem.given import (
    Measured,
    block_columns,
    observation_rows,
    rows_given,
    stretched_columns,
)
from obseq.leastsquares.problem.losses import Loss, named_loss
from obseq.leastsquares.problem.padding import fill_padded, padded, padded_length
from obseq.leastsquares.problem.shapes import Move, Shape, carried_of
from obseq.leastsquares.problem.unknowns import UnknownTable
from obseq.leastsquares.problem.weights import Weighing, root_weights
from obseq.leastsquares.sparse import Sparse

Labels = Sequence[str] | Callable[[int], str] | None
"""What to call observations: a name for each, a function of their row, or nothing."""


class Batch:
    """Observations of one formula: the blocks they join, what was measured, sigmas and labels.

    Between two solutions `observations`, `sigmas`, `active`, `loss` and `group` may be replaced; entries of
    `sigmas` and `active` may be changed in place as well.

    Attributes:
        shape: what is known of the formula.
        blocks: (n_roles, n) the block of each observation for each argument of the formula.
        n: number of observations.
        is_constraint: whether its rows count as constraints, as priors do.
        weights: (n_residuals, padded n) inverse sigmas times the roots of robust weights; 0 where inactive.
        clusters: covariances across observations; None without.
        carried: (k, 3) what moves with what, and `carriers`: (rows, padded n) how; see `carry`.
        roots: (m (m + 1) / 2, padded n) upper triangles that whiten correlated residuals; empty without.
        kept: what the loops are given of it, made and looked after by assembly.
    """

    __slots__ = (
        "_active",
        "_group",
        "_label",
        "_loss",
        "_sigmas",
        "_table",
        "_weighed",
        "blocks",
        "carried",
        "carriers",
        "clusters",
        "contexts",
        "is_constraint",
        "kept",
        "n",
        "observation_rows",
        "observation_tiles",
        "roles",
        "roots",
        "shape",
        "starts",
        "weights",
    )

    def __init__(
        self,
        shape: Shape,
        table: UnknownTable,
        blocks: Mapping[str, ArrayLike],
        observations: ArrayLike | Mapping[str, ArrayLike] | None,
        sigmas: ArrayLike,
        labels: Labels,
        group: str | None,
        active: ArrayLike | None,
    ) -> None:
        self.shape = shape
        self._table = table
        self.kept: object = None
        self._group = shape.name if group is None else text(group, f"{shape.name}, group")
        columns = block_columns(table, shape, blocks)
        self.n: int = max(rows_given(shape, observations, columns))
        self.blocks = stretched_columns(shape, columns, self.n)
        self._label = self._labelling(labels)
        self.observation_tiles = np.zeros((len(shape.observation_rows), padded_length(self.n)))
        self.observations = observations
        self._loss: Loss | None = None
        self.is_constraint = False
        self.clusters: Clusters | None = None
        self.roots: FloatArray = np.zeros((0, 0))
        self._sigmas = self._checked_sigmas(sigmas)
        self._active = self._checked_active(active)
        self._weigh()
        self._lay_out()

    def __len__(self) -> int:
        return self.n

    @property
    def name(self) -> str:
        """Name of the formula."""
        return self.shape.name

    @property
    def group(self) -> str:
        """Name under which sums of squares are kept."""
        return self._group

    @group.setter
    def group(self, new: str) -> None:
        self._group = text(new, f"{self.name}, group")

    @property
    def n_scalars(self) -> int:
        """Number of scalar equations that count: residuals of active observations."""
        return int(np.count_nonzero(self.active)) * self.shape.n_residuals

    @property
    def observations(self) -> FloatArray:
        """(n, m) what was measured, a copy that is only read; a row of linear ones: coefficients, value.

        They are replaced as a whole, in any form that `add` takes; (n,) are new values of linear rows.
        """
        return Measured.of(np.array(self.observation_tiles[:, : self.n].T, order="C"))

    @observations.setter
    def observations(self, new: ArrayLike | Mapping[str, ArrayLike] | None) -> None:
        array = observation_rows(self.shape, new, self.n, self.observation_tiles)
        is_finite = np.isfinite(array)
        if np.count_nonzero(is_finite) < is_finite.size:
            wrong = int(is_finite.all(axis=1).argmin())
            raise InputError(f"{self.label(wrong)}: the observation is not finite: {array[wrong]}")
        fill_padded(self.observation_tiles, array.T)

    @property
    def sigmas(self) -> FloatArray:
        """(n, n_residuals) given standard deviations; for correlated residuals, factors of theirs."""
        return self._sigmas

    @sigmas.setter
    def sigmas(self, new: ArrayLike) -> None:
        self._sigmas = self._checked_sigmas(new)
        self._weigh()

    @property
    def active(self) -> BoolArray:
        """(n,) False for observations that have residuals but no influence."""
        return self._active

    @active.setter
    def active(self, new: ArrayLike) -> None:
        self._active = self._checked_active(new)
        self._weigh()

    @property
    def loss(self) -> Loss | None:
        """What gives robust weights; None for least squares."""
        return self._loss

    @loss.setter
    def loss(self, new: Loss | str | None) -> None:
        if isinstance(new, str):
            new = named_loss(new)
        if new is not None and (isinstance(new, type) or not callable(getattr(new, "weights", None))):
            raise InputError(f"{self.name}: a loss is wanted, such as Huber(), not {new!r}")
        had_one, self._loss = self._loss is not None, new
        if had_one:
            self._weigh()

    def set_active(self, row: int, active: bool) -> None:
        """Takes an observation out of the adjustment, or back in; it keeps its place, sigma and residual."""
        chosen = self._active.copy()
        chosen[row] = active
        self.active = chosen

    def settle(self) -> None:
        """Makes the weights anew if entries of `sigmas` or `active` have changed.

        Raises:
            InputError: a sigma is no positive number any more.
        """
        last = self._weighed
        if np.count_nonzero(last.sigmas != self._sigmas) or np.count_nonzero(last.active != self._active):
            self._sigmas = self._checked_sigmas(self._sigmas)
            self._weigh()

    def _weigh(self) -> None:
        whitening = None
        if self.clusters is not None:
            whitening = self.clusters.whitening(np.repeat(self._active, self.shape.n_residuals))
        self._weighed = Weighing(self._sigmas.copy(), self._active.copy(), self.roots, whitening)
        self.weights = np.zeros((self.shape.n_residuals, padded_length(self.n)))
        self.weights[:, : self.n] = root_weights(self._sigmas, self._active).T

    @property
    def is_correlated(self) -> bool:
        """Whether the residuals of one observation are correlated."""
        return bool(self.roots.size)

    def times_weights(self, factors: FloatArray) -> FloatArray:
        """(n_residuals, padded n) factors (n, n_residuals) times the weights."""
        weights = self.weights.copy()
        weights[:, : self.n] *= factors.T
        return weights

    def reweight(self, residuals: FloatArray) -> None:
        """Sets the weights that the loss gives to residuals (n, n_residuals).

        Observations that are correlated with one another have one weight, for the root mean square.
        """
        if self._loss is None:
            return
        ratios = residuals / self._sigmas
        norm = np.sqrt(np.square(ratios).sum(axis=1))
        if self.clusters is not None:
            norm = self.clusters.norms(ratios.ravel()).reshape(ratios.shape)[:, 0]
        roots = np.sqrt(self._loss.weights(np.where(np.isfinite(norm), norm, 0.0)))
        self.weights[:, : self.n] = root_weights(self._sigmas, self._active, roots[:, None]).T

    def carry(self, moves: Sequence[Move]) -> None:
        """Completes the derivatives by blocks of three that move more than themselves.

        What an equation takes as given (a plumb line, a refraction) may follow from where its points are. A
        plumb line that turns moves, in its own axes, what is seen from there: derivatives by the second block
        then are derivatives by the first, too. Called again when the numbers have changed, not the blocks.

        Args:
            moves: the influences.
        """
        self.carriers = np.empty((0, 0))  # the old ones go before the new ones come
        self.carried, self.carriers = carried_of(self.shape, moves, self.n)
        self.kept = None

    def correlate(self, covariances: ArrayLike) -> None:
        """Gives the residuals of each observation a full covariance, (m, m) or (n, m, m), in their units.

        The equations are then whitened: multiplied by U, with U' U the inverse of the covariance; their
        sigmas are 1, and `whitened` gives the residuals that the adjustment sees.

        Raises:
            InputError: a matrix is not symmetric and positive definite; the observation is named.
        """
        m = self.shape.n_residuals
        given = real(covariances, f"{self.name}, covariances")
        if given.shape not in ((m, m), (self.n, m, m)):
            raise InputError(f"{self.name}: covariances have shape {given.shape}; expected {(self.n, m, m)}")
        given = np.broadcast_to(given, (self.n, m, m))
        with np.errstate(invalid="ignore"):
            variances = (
                np.linalg.eigvalsh(given) if np.isfinite(given).all() else np.full((self.n, m), np.nan)
            )
            wrong = np.flatnonzero(
                ~(variances[:, 0] > 0.0) | (given != given.transpose(0, 2, 1)).any(axis=(1, 2))
            )
        if wrong.size:
            raise InputError(
                f"{self.label(wrong[0])}: the covariance is not symmetric and positive definite:\n"
                f"{given[wrong[0]]}"
            )
        roots = np.linalg.cholesky(np.linalg.inv(given)).transpose(0, 2, 1)
        rows, columns = np.triu_indices(m)
        self.roots = padded(roots[:, rows, columns].T, np.float64)
        self.sigmas = np.ones((self.n, m))

    def correlate_all(self, covariance: Covariance) -> None:
        """Gives all residuals, observation by observation, one covariance (see `Clusters`), in their units.

        Their sigmas are 1 then, factors of the whitened residuals.

        Raises:
            InputError: it does not fit, or there are other covariances.
        """
        if self.roots.size:
            raise InputError(f"{self.name}: covariance across observations goes with nothing else")
        self.clusters = Clusters(covariance, self.n * self.shape.n_residuals, f"{self.name}, covariance")
        self.sigmas = np.ones((self.n, self.shape.n_residuals))

    def whitening_matrix(self) -> Sparse:
        """(n m, n m) what makes the residuals of clusters, observation by observation, uncorrelated.

        Each is divided by its factor `sigmas`, and by the root of its robust weight.
        """
        whitening = self._weighed.whitening
        assert whitening is not None
        return whitening.scaled(self.weights[:, : self.n].T.ravel())

    def cluster_roots(self, members: IntArray) -> FloatArray:
        """(k, m, m) parts of the whitening matrix that belong to the residuals (k, m) of clusters."""
        matrix, place = self.whitening_matrix(), np.empty(self.n * self.shape.n_residuals, dtype=np.int64)
        own, (count, m) = matrix.some(members.ravel()), members.shape
        place[members] = np.arange(m)
        return Sparse(own.values, place[own.columns], own.starts, m).toarray().reshape(count, m, m)

    def whitened(self, rows: FloatArray, chosen: IntArray | slice | None = None) -> FloatArray:
        """(m, k, n) residual rows times the roots of the inverse covariances; as they are without any.

        Args:
            rows: (m, k, n) for each residual, k values of each observation.
            chosen: observations that the last axis stands for; all when None.
        """
        if self.clusters is not None and chosen is not None:
            raise InputError(f"{self.name}: observations of a cluster are whitened together, not one by one")
        return self._weighed.whitened(rows, chosen)

    def robust_weights(self) -> FloatArray:
        """(n,) what the loss makes of the weight of each observation: 1 full, 0 none."""
        return self.weighing().robust_weights()

    @property
    def n_rejected(self) -> int:
        """Number of scalar equations that are active and that the loss leaves no weight."""
        if self._loss is None:
            return 0
        none = self.active & (self.weights[0, : self.n] == 0.0)
        return self.shape.n_residuals * int(np.count_nonzero(none))

    def weighing(self) -> Weighing:
        """What its residuals are weighed by, for one who keeps it."""
        last = self._weighed
        if self._loss is None:
            return last
        robust = np.square(self.weights[0, : self.n] * last.sigmas[:, 0])
        return Weighing(last.sigmas, last.active, last.roots, last.whitening, robust)

    def scalars(self) -> IntArray:
        """(n_unknowns, n) positions of the unknowns of each observation."""
        roles = zip(self.blocks, self.shape.roles, strict=True)
        return np.concatenate([self._table.start[ids] + np.arange(role.size)[:, None] for ids, role in roles])

    def label(self, row: int) -> str:
        """What to call one observation in a message: its label, or the blocks it joins."""
        if self._label is not None:
            return f"{self.name} {self._label(int(row))}"
        names = dict.fromkeys(self._table.names[block] for block in self.blocks[:, row])
        return f"{self.name} {' -> '.join(names)} (row {row})"

    def _labelling(self, labels: Labels) -> Callable[[int], str] | None:
        if labels is None or callable(labels):
            return labels
        is_lazy = isinstance(labels, Sequence) and not isinstance(labels, str | list | tuple)
        names = labels if is_lazy else texts(labels, f"{self.shape.name}, labels")  # some are made when asked
        if len(names) != self.n:
            raise InputError(f"{self.shape.name}: {len(names)} labels for {self.n} observations")
        return names.__getitem__

    def _checked_sigmas(self, sigmas: ArrayLike) -> FloatArray:
        shape = (self.n, self.shape.n_residuals)
        array = real(sigmas, f"{self.name}, sigmas")
        if array.ndim == 1 and array.shape == (self.n,):
            array = array[:, None]
        if array.ndim and array.shape not in (shape, (self.n, 1)):
            raise InputError(
                f"{self.name}: sigmas have shape {array.shape}; expected a number, ({self.n},) or {shape}"
            )
        sigmas = np.empty(shape)
        sigmas[:] = array
        is_right = (sigmas > 0.0) & (sigmas < np.inf)
        if np.count_nonzero(is_right) < is_right.size:
            row = int(is_right.all(axis=1).argmin())
            raise InputError(f"{self.label(row)}: sigma must be positive and finite, not {sigmas[row]}")
        return sigmas

    def _checked_active(self, active: ArrayLike | None) -> BoolArray:
        if active is None:
            return np.ones(self.n, dtype=bool)
        return truths(active, (self.n,), f"{self.name}: active")

    def _lay_out(self) -> None:
        """The arrays that the loops take, in their order."""
        shape, table = self.shape, self._table
        contexts = table.context_start[self.blocks]
        if shape.transposed.any():
            contexts += shape.transposed * table.each(attrgetter("transposed_at"), self.blocks)
        self.roles = shape.role_rows
        self.starts = padded(table.start[self.blocks], np.uint32)
        self.carried, self.carriers = carried_of(shape, (), self.n)
        self.contexts = padded(contexts, np.uint32)
        self.observation_rows = shape.observation_places
