"""What a least squares system consists of: its unknowns, its equations, what holds exactly."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from obseq.errors import InputError
from obseq.leastsquares.problem.arguments import finite, listed, real, table_of_rows, texts, truths
from obseq.leastsquares.problem.batches import Batch
from obseq.leastsquares.problem.manifolds import (
    DIRECTION,
    POINT2,
    POINT3,
    ROTATION,
    SCALAR,
    VECTOR,
    Manifold,
)
from obseq.leastsquares.problem.objects import matching
from obseq.leastsquares.problem.priors import Prior, Viscosity
from obseq.leastsquares.problem.shapes import formula_shape, linear_shape
from obseq.leastsquares.problem.unknowns import UnknownTable

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike

    from obseq.arrays import BoolArray, FloatArray, IntArray
    from obseq.kernels.loading import Kernel
    from obseq.leastsquares.problem.losses import Loss
    from obseq.leastsquares.problem.objects import UnknownObject


class Datum(NamedTuple):
    """What a free network is fixed by.

    Attributes:
        scalars: positions of the unknowns whose changes are least; none without a datum.
        reference: their values when it was set.
    """

    scalars: IntArray
    reference: FloatArray


class Definition:
    """Unknowns in blocks, equations in batches, priors, hard constraints, datum; nothing is solved here."""

    def __init__(self) -> None:
        self.unknowns = UnknownTable()
        self._batches: list[Batch] = []
        self._priors: list[Prior] = []
        self._viscosities: list[Viscosity] = []
        self._constraints: list[Batch] = []
        self._objects: list[UnknownObject] = []
        self.datum = Datum(np.zeros(0, dtype=np.int64), np.zeros(0))

    # Unknowns

    def add_points(self, names: Sequence[str], coordinates: ArrayLike) -> IntArray:
        """Adds points of (n, 3) or (n, 2) coordinates, in metres; returns their ids."""
        names = texts(names, "add_points")
        array = table_of_rows(coordinates, len(names), "add_points")
        if array.shape[1] not in (2, 3):
            raise InputError(f"add_points: coordinates have {array.shape[1]} columns; expected 2 or 3")
        return self.unknowns.add(POINT3 if array.shape[1] == 3 else POINT2, names, array)

    def add_rotations(self, names: Sequence[str], matrices: ArrayLike) -> IntArray:
        """Adds rotations from a local frame to the world frame, (n, 3, 3); returns their ids."""
        return self._add_shaped(ROTATION, names, matrices, "add_rotations")

    def add_directions(self, names: Sequence[str], vectors: ArrayLike) -> IntArray:
        """Adds unit directions, given by vectors (n, 3) of any length but zero; returns their ids."""
        return self._add_shaped(DIRECTION, names, vectors, "add_directions")

    def add_vectors(
        self, names: Sequence[str], values: ArrayLike, component_names: Sequence[str] | None = None
    ) -> IntArray:
        """Adds vectors of unknowns, (n, k); `component_names` (k,) are for messages; returns their ids."""
        names = texts(names, "add_vectors")
        array = table_of_rows(values, len(names), "add_vectors")
        size = array.shape[1]
        numbers = [str(number) for number in range(size)]
        components = texts(component_names or numbers, "add_vectors, component_names")
        if len(components) != size or not size:
            raise InputError(f"add_vectors: {len(components)} component names for vectors of {size}")
        return self.unknowns.add(VECTOR, names, array, components)

    def add_scalars(self, names: Sequence[str], values: ArrayLike) -> IntArray:
        """Adds single unknowns, values (n,); returns their ids."""
        names = texts(names, "add_scalars")
        array = finite(values, (len(names),), "add_scalars")
        return self.unknowns.add(SCALAR, names, array[:, None])

    def add_blocks(self, manifold: Manifold, names: Sequence[str], values: ArrayLike) -> IntArray:
        """Adds blocks of a kind of unknown, which may be one's own (see `Manifold`); returns their ids.

        Args:
            manifold: the kind; it names the components.
            names: (n,) names of the blocks.
            values: (n, ...) their values, in the shape that the kind says.
        """
        if not isinstance(manifold, Manifold) or not manifold.components:
            raise InputError(
                f"add_blocks: a kind of unknown with components is wanted, a Manifold; not {manifold!r}"
            )
        return self._add_shaped(manifold, names, values, "add_blocks")

    def _add_shaped(self, manifold: Manifold, names: Sequence[str], values: ArrayLike, what: str) -> IntArray:
        names = texts(names, what)
        shape = manifold.shape(len(manifold.components))
        return self.unknowns.add(manifold, names, finite(values, (len(names), *shape), what), what=what)

    def ids(self, names: Sequence[str], kind: str = "Point3") -> IntArray:
        """Ids by name of blocks of a kind: Point3, Point2, Rotation, Direction, Vector, Scalar or yours."""
        return self.unknowns.find(names, kind)

    def values(self, ids: ArrayLike) -> FloatArray:
        """Current values of blocks that are alike: (n, k); (n, 3, 3) for rotations; (n, 3) for directions."""
        return self.unknowns.read(ids)

    def set_values(self, ids: ArrayLike, values: ArrayLike) -> None:
        """Gives blocks that are alike new current values, in the shape that `values` returns."""
        self.unknowns.write(ids, values)

    def freeze(self, ids: ArrayLike, components: Sequence[str | int] | None = None) -> None:
        """Keeps unknowns at their current values: whole blocks, or components by number or by name."""
        self.unknowns.set_frozen(ids, components, True)

    def freeze_matching(self, pattern: str, frozen: bool = True) -> None:
        """Freezes (or frees) all unknowns whose full name (`camera.rotation.z`) matches an expression."""
        for block, components in matching(self.unknowns, pattern).items():
            self.unknowns.set_frozen([block], components, frozen)

    def unfreeze(self, ids: ArrayLike, components: Sequence[str | int] | None = None) -> None:
        """Frees unknowns again."""
        self.unknowns.set_frozen(ids, components, False)

    def eliminate(self, ids: ArrayLike, eliminated: bool = True) -> None:
        """Marks blocks to be eliminated from the normal equations before these are solved (Schur complement).

        The solution is the same, and so are residuals, redundancy and covariances; it comes sooner when
        there are many such blocks that meet few others each, such as tie points. Eliminated blocks that
        observations join to one another, such as centre and rotation of a pose, form a group.

        Args:
            ids: blocks.
            eliminated: False to treat them as others again.
        """
        self.unknowns.set_eliminated(ids, eliminated)

    # Equations

    def add(
        self,
        formula: str | Kernel,
        blocks: Mapping[str, ArrayLike],
        observations: ArrayLike | None,
        sigmas: ArrayLike | None = None,
        labels: Sequence[str] | None = None,
        group: str | None = None,
        active: ArrayLike | None = None,
        loss: Loss | str | None = None,
        covariances: ArrayLike | None = None,
        covariance: Any = None,
    ) -> Batch:
        """Adds observations of one formula.

        Args:
            formula: its name, or a loaded kernel.
            blocks: ids (n,) for each block of the formula; one id alone stands for all rows.
            observations: (n, m) what was measured, or (n,) when m is 1; None when the formula takes none.
            sigmas: one number, (n,) or (n, n_residuals), positive, in the unit of the residuals.
            labels: (n,) what to call the observations in messages.
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
        batch.loss = loss
        return self._added(batch)

    def add_linear(
        self,
        columns: Sequence[ArrayLike],
        coefficients: Sequence[ArrayLike],
        values: ArrayLike,
        sigmas: ArrayLike,
        labels: Sequence[str] | None = None,
        group: str | None = None,
        is_constraint: bool = False,
    ) -> Batch:
        """Adds plain linear rows: sum of coefficients times unknowns = value.

        Args:
            columns: for each of k places in the rows, the ids (n,) of the blocks that stand there.
            coefficients: for each place, (n, block size).
            values: (n,) right-hand sides.
            sigmas: one number or (n,).
            labels: (n,) what to call the rows in messages.
            group: name under which sums of squares are kept; "linear" when None.
            is_constraint: True for rows that count as constraints, as priors do, not as observations.
        """
        batch = self._linear(columns, coefficients, values, sigmas, labels, group)
        batch.is_constraint = is_constraint
        return self._added(batch)

    def _linear(
        self,
        columns: Sequence[ArrayLike],
        coefficients: Sequence[ArrayLike],
        values: ArrayLike,
        sigmas: ArrayLike,
        labels: Sequence[str] | None,
        group: str | None,
    ) -> Batch:
        ids = [self.unknowns.checked(column, "linear rows") for column in listed(columns, "linear rows")]
        parts = [real(part, "linear rows, coefficients") for part in listed(coefficients, "linear rows")]
        if not ids or len(ids) != len(parts):
            raise InputError(f"linear rows: {len(parts)} sets of coefficients for {len(ids)} blocks")
        shape, right = linear_shape(self.unknowns, ids), real(values, "linear rows, values")
        n = max(*(len(column) for column in ids), *(len(rows) for rows in (*parts, right) if rows.ndim))
        for part, role in zip(parts, shape.roles, strict=True):
            finite(part, (n, role.size), f"linear rows, coefficients {role.name}")
        rows = np.column_stack([*parts, finite(right, (n,), "linear rows, values")])
        blocks = {role.name: column for role, column in zip(shape.roles, ids, strict=True)}
        return Batch(shape, self.unknowns, blocks, rows, sigmas, labels, group, None)

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
        m = int(size.sum())
        given = finite(matrix, (m, m), "normal equations, matrix")
        values, vectors = np.linalg.eigh(given)
        if np.abs(given - given.T).max() > 1e-9 * np.abs(given).max() or values[0] < -1e-9 * values[-1]:
            raise InputError("normal equations: the matrix must be symmetric and positive semi-definite")
        kept = values > 1e-12 * values[-1]
        roots = np.sqrt(values[kept])
        rows = vectors[:, kept].T * roots[:, None]
        right = vectors[:, kept].T @ finite(vector, (m,), "normal equations, vector") / roots
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
        labels: Sequence[str] | None = None,
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
        labels: Sequence[str] | None = None,
    ) -> Batch:
        """Adds linear equations that the solution satisfies exactly (arguments as in `add_linear`)."""
        return self._constrained(self._linear(columns, coefficients, values, 1.0, labels, None))

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
    ) -> None:
        """Puts a free network on a datum: the changes of these unknowns from their present values are least.

        These inner constraints replace known coordinates: they take away what the observations leave free
        (position, orientation, scale), whatever it is, and nothing else.

        Args:
            ids: (n,) blocks of points, vectors or scalars; none for no datum. They may be eliminated ones.
            components: numbers or names of the components that count, for all blocks, or a list of them for
                each; or (n, k) True for those that count; all when None.

        Raises:
            InputError: a rotation or a direction is among them.
        """
        blocks = self.unknowns.checked(ids, "datum")
        if not all(self.unknowns.manifold(block).is_flat for block in np.unique(blocks)):
            raise InputError("datum: a rotation or a direction has no coordinates to keep; choose points")
        chosen = np.zeros(0, dtype=np.int64)
        if blocks.size:
            chosen = np.unique(self._datum_scalars(blocks, components))
        self.unknowns.owner.check()
        self.datum = Datum(chosen, self.unknowns.values[chosen])

    def _datum_scalars(self, blocks: IntArray, components: Any) -> IntArray:
        """Positions of the chosen components of blocks, which need not be alike."""
        if getattr(components, "dtype", None) == np.bool_:
            scalars = self.unknowns.scalars(blocks, "datum")
            return scalars[truths(components, scalars.shape, "datum, components")]
        each = [components] * len(blocks)
        if components is not None and any(_is_list(of_block) for of_block in listed(components, "datum")):
            each = list(components)
            if len(each) != len(blocks):
                raise InputError(f"datum: components of {len(each)} blocks for {len(blocks)} blocks")
        index = self.unknowns.component_index
        return np.concatenate(
            [index([block], of_block, "datum").ravel() for block, of_block in zip(blocks, each, strict=True)]
        )

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
    def n_constraints(self) -> int:
        """Number of scalar equations of priors, and of rows that count as constraints."""
        rows = sum(batch.n_scalars for batch in self._batches if batch.is_constraint)
        return rows + sum(prior.n_scalars for prior in self._priors)


def _is_list(components: object) -> bool:
    return components is None or isinstance(components, list | tuple | np.ndarray)
