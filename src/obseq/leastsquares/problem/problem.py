"""What a least squares system consists of: its unknowns, its equations, what holds exactly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import BoolArray
from obseq.errors import InputError
from obseq.kernels.loading import Kernel
from obseq.leastsquares.problem.batches import Batch, Labels
from obseq.leastsquares.problem.clusters import Covariance
from obseq.leastsquares.problem.datum import NO_DATUM, Motions, datum_of
from obseq.leastsquares.problem.linear import linear_batch, root_rows
from obseq.leastsquares.problem.losses import Loss
from obseq.leastsquares.problem.priors import Prior, Viscosity
from obseq.leastsquares.problem.shapes import formula_shape
from obseq.leastsquares.problem.unknown_blocks import UnknownBlocks
from obseq.leastsquares.problem.unknown_objects import matching
from obseq.leastsquares.problem.unknowns import UnknownTable


class Problem:
    """Unknowns in blocks, equations in batches, priors, hard constraints, datum; nothing is solved here.

    Attributes:
        unknowns: the table of unknowns.
        blocks: what adds and changes its blocks.
        datum: what a free network is fixed by.
    """

    def __init__(self) -> None:
        self.unknowns = UnknownTable()
        self.blocks = UnknownBlocks(self.unknowns)
        self._batches: list[Batch] = []
        self._priors: list[Prior] = []
        self._viscosities: list[Viscosity] = []
        self._constraints: list[Batch] = []
        self.datum = NO_DATUM

    # Equations

    def add(
        self,
        formula: str | Kernel,
        blocks: Mapping[str, ArrayLike],
        observations: ArrayLike | None,
        sigmas: ArrayLike | None = None,
        labels: Labels = None,
        group: str | None = None,
        active: ArrayLike | None = None,
        loss: Loss | str | None = None,
        covariances: ArrayLike | None = None,
        covariance: Covariance = None,
    ) -> Batch:
        """Adds observations of one formula.

        Args:
            formula: its name, or a loaded kernel.
            blocks: ids (n,) for each block of the formula; one id alone stands for all rows.
            observations: (n, m) what was measured, or (n,) when m is 1; None when the formula takes none.
            sigmas: one number, (n,) or (n, n_residuals), positive, in the unit of the residuals.
            labels: (n,) what to call the observations in messages, or a function of their row.
            group: name under which sums of squares are kept; the formula's when None.
            active: (n,) False for observations that have residuals but no influence; all are active when
                None.
            loss: robust weights, or their name such as `huber` (see `losses`); None for least squares.
            covariances: (m, m) or (n, m, m) instead of sigmas, for m correlated residuals.
            covariance: (n m, n m) of all residuals, observation by observation, for observations that are
                correlated with one another: dense, sparse, or a list of dense blocks, cluster by cluster.

        Raises:
            InputError: an argument does not fit; the message names formula, argument and row.
        """
        shape = formula_shape(formula)
        if sum(given is not None for given in (sigmas, covariances, covariance)) != 1:
            raise InputError(f"{shape.name}: give either sigmas or covariances")
        given = 1.0 if sigmas is None else sigmas
        batch = Batch(shape, self.unknowns, blocks, observations, given, labels, group, active)
        if covariances is not None:
            batch.correlate(covariances)
        if covariance is not None:
            batch.correlate_all(covariance)
        if loss is not None:
            batch.loss = loss
        return self._added(batch)

    def add_linear(
        self,
        columns: Sequence[ArrayLike],
        coefficients: Sequence[ArrayLike],
        values: ArrayLike,
        sigmas: ArrayLike,
        labels: Labels = None,
        group: str | None = None,
        is_constraint: bool = False,
        is_tangent: bool = False,
    ) -> Batch:
        """Adds plain linear rows: sum of coefficients times unknowns = value.

        The `observations` of the batch are (n, m), the coefficients of each row and its value; (n,) given to
        them later are new values.

        Args:
            columns: for each of k places in the rows, the ids (n,) of the blocks that stand there.
            coefficients: for each place, (n, block size).
            values: (n,) right-hand sides.
            sigmas: one number or (n,).
            labels: (n,) what to call the rows in messages.
            group: name under which sums of squares are kept; "linear" when None.
            is_constraint: True for rows that count as constraints, as priors do, not as observations.
            is_tangent: True for rows that stand for other equations near the current values and are made anew
                before each linearisation; rotations and directions then have coefficients of their small
                steps, which are 0 at the current values.
        """
        batch = linear_batch(self.unknowns, columns, coefficients, values, sigmas, labels, group, is_tangent)
        batch.is_constraint = is_constraint
        return self._added(batch)

    def add_normal_equations(
        self, ids: ArrayLike, matrix: ArrayLike, vector: ArrayLike, group: str = "normal equations"
    ) -> Batch:
        """Adds what another adjustment found of some unknowns: x' A x - 2 b' x, as independent linear rows.

        With A = Q^-1 and b = A x0, for cofactors Q and values x0, they are observations of x0 with their full
        covariance. Directions that A does not determine (eigenvalues of zero) give no row.

        Args:
            ids: (k,) different blocks of points, vectors or scalars, of any sizes.
            matrix: (m, m) A, symmetric and positive semi-definite, m unknowns in the order of the blocks.
            vector: (m,) b.
            group: name under which sums of squares are kept.
        """
        blocks = self.unknowns.checked(ids, "normal equations")
        size = self.unknowns.size[blocks]
        rows, right = root_rows(matrix, vector, int(size.sum()))
        parts = np.split(rows, np.cumsum(size)[:-1], axis=1)
        columns = [np.repeat(block, len(rows)) for block in blocks]
        return self.add_linear(columns, parts, right, 1.0, group=group)

    def add_prior(self, ids: ArrayLike, values: ArrayLike, sigmas: ArrayLike, group: str = "prior") -> Prior:
        """Adds soft constraints x = value +- sigma for blocks that are alike.

        Args:
            ids: (n,) blocks.
            values: (n, k) given values.
            sigmas: number, (n,) or (n, k); infinite where a component has no constraint.
            group: name under which sums of squares are kept.
        """
        prior = Prior(self.unknowns, ids, values, sigmas, group)
        self.unknowns.owner.check()
        self._priors.append(prior)
        return prior

    def add_viscosity(self, ids: ArrayLike, sigmas: ArrayLike) -> None:
        """Slows blocks that are alike: each step is pulled to the current values with these sigmas.

        It changes the way to the solution, not the solution; it counts neither as an observation nor in
        covariances. Rotations take it too (sigmas in radians).
        """
        self.unknowns.owner.check()
        self._viscosities.append(Viscosity.of(self.unknowns, ids, sigmas))

    def _added(self, batch: Batch) -> Batch:
        self.unknowns.owner.check()
        self._batches.append(batch)
        return batch

    # Hard constraints

    def constrain(
        self,
        formula: str | Kernel,
        blocks: Mapping[str, ArrayLike],
        observations: ArrayLike | None,
        labels: Labels = None,
    ) -> Batch:
        """Adds equations of a formula that the solution satisfies exactly (arguments as in `add`).

        They are linearised anew at each iteration, and substituted: each takes one unknown out of the system.
        """
        shape = formula_shape(formula)
        return self._constrained(Batch(shape, self.unknowns, blocks, observations, 1.0, labels, None, None))

    def constrain_linear(
        self,
        columns: Sequence[ArrayLike],
        coefficients: Sequence[ArrayLike],
        values: ArrayLike,
        labels: Labels = None,
        is_tangent: bool = False,
    ) -> Batch:
        """Adds linear equations that the solution satisfies exactly (arguments as in `add_linear`)."""
        return self._constrained(
            linear_batch(self.unknowns, columns, coefficients, values, 1.0, labels, None, is_tangent)
        )

    def share(self, ids: ArrayLike, components: Sequence[str | int] | None = None) -> Batch:
        """Makes unknowns of several blocks equal: whole blocks that are alike, or chosen components."""
        blocks, _, size = self.unknowns.uniform(ids, "share")
        if len(blocks) < 2:
            raise InputError("share: it takes two blocks or more")
        index = self.unknowns.component_index(blocks[:1], components, "share")
        unit = np.eye(size)[(index - self.unknowns.start[blocks[0]]).ravel()]
        rows = np.tile(unit, (len(blocks) - 1, 1))
        other, first = np.repeat(blocks[1:], len(unit)), np.repeat(blocks[:1], len(rows))
        names = self.unknowns.names
        labels = [f"{names[block]} = {names[blocks[0]]}" for block in other]
        return self.constrain_linear([first, other], [-rows, rows], np.zeros(len(rows)), labels)

    def share_matching(self, pattern: str) -> Batch:
        r"""Makes equal, component by component, all unknowns whose full name matches an expression.

        `camera .*\.(F|PPx|PPy)` shares three parameters among all cameras, whose components must be alike.
        """
        found = matching(self.unknowns, pattern)
        first = next(iter(found.values()))
        for block, components in found.items():
            if components != first:
                names = self.unknowns.names
                raise InputError(
                    f"share_matching: {pattern!r} matches other components of {names[block]!r} than of "
                    f"{names[next(iter(found))]!r}"
                )
        return self.share(list(found), first)

    def remove_constraint(self, constraint: Batch) -> None:
        """Takes a constraint out again."""
        if constraint not in self._constraints:
            raise InputError(
                f"this {getattr(constraint, 'name', constraint)} constraint is not in the system"
            )
        self.unknowns.owner.check()
        self._constraints.remove(constraint)

    def _constrained(self, batch: Batch) -> Batch:
        self.unknowns.owner.check()
        self._constraints.append(batch)
        return batch

    # Free networks

    def set_datum(
        self,
        ids: ArrayLike,
        components: Sequence[str | int] | Sequence[Sequence[str | int]] | BoolArray | None = None,
        motions: Motions | None = None,
        n_held: int | None = None,
    ) -> None:
        """Puts a free network on a datum: the changes of these unknowns from their present values are least.

        These inner constraints replace known coordinates: they take away what the observations leave free
        (position, orientation, scale), whatever it is, and nothing else.

        Args:
            ids: (n,) blocks of points, vectors or scalars; none for no datum. They may be eliminated ones.
            components: numbers or names of the components that count, for all blocks, or a list of them for
                each; or (n, k) True for those that count; all when None.
            motions: Values (n, size) of these blocks -> (n, size, k) what they do, about one unit far, along
                directions that the observations determine weakly or not at all. Not for eliminated blocks.
            n_held: How many of the directions, the first ones, are held whatever the observations say of
                them, and count as free parameters (the turn about the vertical, where nothing but the
                curvature of the Earth orients a network); all when None. Those that are free are among
                them. The others are determined, and need no more than the digits that they have.

        Raises:
            InputError: a rotation or a direction is among them, or movements do not fit.
        """
        datum = datum_of(self.unknowns, ids, components, motions, n_held)
        self.unknowns.owner.check()
        self.datum = datum

    def settle(self) -> None:
        """Makes weights anew where sigmas were changed in place."""
        for batch in self._batches:
            batch.settle()

    # What it consists of

    @property
    def batches(self) -> tuple[Batch, ...]:
        """The observations, in the order in which they were added."""
        return tuple(self._batches)

    @property
    def priors(self) -> tuple[Prior, ...]:
        """The soft constraints."""
        return tuple(self._priors)

    @property
    def constraints(self) -> tuple[Batch, ...]:
        """The hard constraints."""
        return tuple(self._constraints)

    @property
    def viscosities(self) -> tuple[Viscosity, ...]:
        """What slows unknowns."""
        return tuple(self._viscosities)

    # Counting

    @property
    def n_observations(self) -> int:
        """Number of scalar equations of active observations."""
        return sum(batch.n_scalars for batch in self._batches if not batch.is_constraint)

    @property
    def n_free(self) -> int:
        """Number of unknowns that are not frozen."""
        return int(np.count_nonzero(~self.unknowns.frozen))

    @property
    def groups(self) -> set[str]:
        """Names under which sums of squares are kept."""
        return {batch.group for batch in self._batches} | {prior.group for prior in self._priors}

    @property
    def n_constraints(self) -> int:
        """Number of scalar equations of priors, and of rows that count as constraints."""
        rows = sum(batch.n_scalars for batch in self._batches if batch.is_constraint)
        return rows + sum(prior.n_scalars for prior in self._priors)
