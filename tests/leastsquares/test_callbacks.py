"""What callbacks of a solution may change, and what is refused by name."""

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.leastsquares import Huber, LeastSquares
from obseq.leastsquares.iterations.strategies import NAMES


def two_rows():
    """x = 1 measured, x = 0 given, both with a sigma of 1: the mean is 0.5."""
    system = LeastSquares()
    x = system.add_scalars(["x"], [0.0])
    batch = system.add_linear([x], [[[1.0]]], [1.0], 1.0)
    prior = system.add_prior(x, [[0.0]], 1.0)
    return system, x, batch, prior


@pytest.mark.parametrize("strategy", sorted(set(NAMES) - {"l1"}))
def test_sigmas_written_in_a_callback_are_heeded(strategy):
    system, x, batch, _ = two_rows()

    def widen(*_):
        batch.sigmas[:] = 2.0

    result = system.solve(before_iteration=widen, strategy=strategy)
    assert result.values(x)[0, 0] == pytest.approx(0.2)  # weights 1/4 and 1
    assert result.normalised_residuals(batch)[0, 0] == pytest.approx(-0.4)
    assert result.cost == pytest.approx(0.16 + 0.04)


def test_observations_priors_and_values_are_heeded():
    system, x, batch, prior = two_rows()

    def change(current, number):
        batch.observations = [3.0]
        batch.loss = Huber(1e3)
        prior.values, prior.sigmas = [1.0], [1.0]
        current.set_values(x, [[float(number)]])

    assert system.solve(before_iteration=change, tolerance=-1.0, max_iterations=2).cost == pytest.approx(
        1.0 + 1.0  # at x = 2, where the last call has put it
    )


CHANGES = {
    "added to the observations: linear": lambda s, x, b, p: s.add_linear([x], [[[1.0]]], [5.0], 1.0),
    "added to the priors: prior": lambda s, x, b, p: s.add_prior(x, [[1.0]], 1.0),
    "added to the viscosities: a pull": lambda s, x, b, p: s.add_viscosity(x, 1.0),
    "added to the constraints: linear": lambda s, x, b, p: s.constrain_linear([x], [[[1.0]]], [1.0]),
    "took away some of the constraints": lambda s, x, b, p: s.remove_constraint(s.constraints[0]),
    r"changed `active` of linear x \(row 0\)": lambda s, x, b, p: b.active.__setitem__(0, False),
    "froze x": lambda s, x, b, p: s.freeze(x),
    "freed y": lambda s, x, b, p: s.unfreeze([1]),
    "changed whether 'x' is to be eliminated": lambda s, x, b, p: s.eliminate(x),
    "added the unknowns 'z'": lambda s, x, b, p: s.add_scalars(["z"], [0.0]),
    "changed the datum": lambda s, x, b, p: s.set_datum(x),
}


@pytest.mark.parametrize("how", ["before_iteration", "progress"])
@pytest.mark.parametrize("words", CHANGES)
def test_other_changes_are_refused_by_name(words, how):
    system, x, batch, prior = two_rows()
    system.freeze(system.add_scalars(["y"], [0.0]))
    held = system.add_scalars(["w"], [0.0])
    system.constrain_linear([held], [[[1.0]]], [1.0])
    with pytest.raises(InputError, match=f"solve: a callback {words}.*between two solutions"):
        system.solve(**{how: lambda *_: CHANGES[words](system, x, batch, prior)})
    assert np.isfinite(system.values(x)).all()


def test_a_wrong_sigma_of_a_callback_is_named():
    system, _, batch, _ = two_rows()
    with pytest.raises(InputError, match=r"linear x \(row 0\): sigma must be positive"):
        system.solve(before_iteration=lambda *_: batch.sigmas.__setitem__(0, -1.0))
