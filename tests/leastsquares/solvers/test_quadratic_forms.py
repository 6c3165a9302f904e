"""Quadratic forms of sparse rows with the inverse are those of solves, whichever solver has it."""

import numpy as np
import pytest

from obseq.leastsquares import Blocks
from obseq.leastsquares.blocks.solver import BlockSolver
from obseq.leastsquares.solution.cofactors import Cofactors
from obseq.leastsquares.solvers import cholesky
from obseq.leastsquares.solvers.cholesky import SupernodalCholesky
from obseq.leastsquares.solvers.dense import DenseCholesky
from obseq.leastsquares.solvers.protocol import SymmetricPattern
from obseq.leastsquares.sparse import Sparse


@pytest.fixture
def factored(build):
    """A network of 400 points, and rows of a few entries each, one twice in a row and one row without any."""
    matrix = build.survey(400)
    pattern, values = SymmetricPattern.of(matrix)
    rng = np.random.default_rng(3)
    dense = np.zeros((150, pattern.n))
    rows = np.repeat(np.arange(149), 5)
    dense[rows, rng.integers(0, pattern.n, len(rows))] = rng.normal(size=len(rows))
    sparse = Sparse.of_dense(dense)
    doubled = Sparse(
        np.repeat(0.5 * sparse.values, 2), np.repeat(sparse.columns, 2), 2 * sparse.starts, pattern.n
    )
    return pattern, values, doubled, dense


def test_forms_are_those_of_solves(factored, monkeypatch):
    pattern, values, rows, dense = factored
    solver = SupernodalCholesky()
    solver.analyse(pattern)
    solver.factor(values)
    expected = np.einsum("kn,nk->k", dense, solver.solve(dense.T))
    own = rows.values, rows.columns, rows.starts
    assert solver.quadratic_forms(*own) == pytest.approx(expected, rel=1e-10, abs=1e-14)
    monkeypatch.setattr(cholesky, "NUMBERS", 7 * pattern.n)  # seven at a time
    assert solver.quadratic_forms(*own) == pytest.approx(expected, rel=1e-10, abs=1e-14)


def test_parts_are_met_from_files(factored):
    pattern, values, rows, dense = factored
    with Blocks(parts=6) as blocks:
        solver = BlockSolver(blocks.run)
        solver.analyse(pattern)
        solver.factor(values)
        assert len(solver._partition.parts) > 4
        expected = np.einsum("kn,nk->k", dense, solver.solve(dense.T))
        assert solver.quadratic_forms(rows.values, rows.columns, rows.starts) == pytest.approx(
            expected, rel=1e-10, abs=1e-14
        )


def test_other_solvers_solve_for_them(factored):
    pattern, values, rows, dense = factored
    solver = DenseCholesky()
    solver.analyse(pattern)
    solver.factor(values)
    found = Cofactors.__new__(Cofactors)
    found.pattern, found._solver = pattern, solver
    expected = np.einsum("kn,nk->k", dense, solver.solve(dense.T))
    assert found.quadratic_forms(rows) == pytest.approx(expected, rel=1e-10, abs=1e-14)
