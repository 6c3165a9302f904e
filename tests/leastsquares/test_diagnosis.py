"""A system that cannot be solved says which unknowns are undetermined."""

import numpy as np
import pytest
from networks import levelled_square

from obseq import InputError, SingularSystemError
from obseq.leastsquares import LeastSquares
from obseq.leastsquares.diagnosis import singular


def test_an_empty_system():
    system = LeastSquares()
    system.add_scalars(["x"], [0.0])
    with pytest.raises(InputError, match="no equations"):
        system.solve()


def test_unknowns_that_no_equation_touches():
    system, *_ = levelled_square()
    system.add_points(["PtE", "PtF"], np.zeros((2, 3)))
    system.freeze(system.ids(["PtE"]), ("x", "z"))
    with pytest.raises(SingularSystemError, match=r"no equation touches PtE.y, PtF.x, PtF.y, PtF.z") as error:
        system.solve()
    assert error.value.unknowns == ("PtE.y", "PtF.x", "PtF.y", "PtF.z")


@pytest.mark.parametrize("solver", ["dense", "superlu"])
def test_a_levelling_network_without_datum(solver):
    system, *_ = levelled_square()
    other = LeastSquares(solver)
    other.add_scalars(["A", "B", "C", "D"], np.zeros(4))
    batch = system.batches[0]
    other.add_linear(list(batch.blocks), [[[-1.0]] * 5, [[1.0]] * 5], batch.observations[:, 2], 0.01)
    with pytest.raises(SingularSystemError, match=r"1 unknown.* undetermined") as error:
        other.solve()
    assert set(error.value.unknowns) == {"A", "B", "C", "D"}
    assert other.values(other.ids(["A", "B"], "Scalar")).ravel().tolist() == [0.0, 0.0]


def test_a_point_in_the_plane_of_its_distances():
    """Distances in one horizontal plane say nothing of a height, and only that is named."""
    system = LeastSquares()
    known = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [10.0, 10.0, 0.0]])
    ids = system.add_points(["A", "B", "C", "D"], known)
    system.freeze(ids)
    new = system.add_points(["E"], [[4.0, 3.0, 0.0]])
    lengths = np.linalg.norm(known - np.array([4.0, 3.0, 0.0]), axis=1)
    system.add("Dist3D", {"p1": ids, "p2": new}, lengths, 0.001)
    with pytest.raises(SingularSystemError) as error:
        system.solve()
    assert error.value.unknowns == ("E.z",)


def test_more_unknowns_than_equations():
    system = LeastSquares()
    ids = system.add_points(["A", "B"], [[0.0, 0.0, 0.0], [3.0, 4.0, 1.0]])
    system.freeze(ids[:1])
    system.add("Dist3D", {"p1": ids[:1], "p2": ids[1:]}, [5.0], 0.001)
    with pytest.raises(SingularSystemError, match=r"2 unknown.* undetermined") as error:
        system.solve()
    assert set(error.value.unknowns) == {"B.x", "B.y", "B.z"}


def test_where_whole_parts_are_loose_only_pivots_are_named(monkeypatch):
    """Vectors of all that moves would take unknowns times pivots numbers."""
    ids = [f"P{k}" for k in range(40)]

    def error_of(numbers):
        monkeypatch.setattr(singular, "NUMBERS", numbers)
        system = LeastSquares()
        points = system.add_points(ids, np.arange(120.0).reshape(40, 3) ** 1.5)
        system.add("Dist3D", {"p1": points[:-1], "p2": points[1:]}, np.ones(39), 0.001)
        with pytest.raises(SingularSystemError, match=r"81 unknown.* undetermined") as error:
            system.solve()
        return error.value

    whole, brief = error_of(81 * 120), error_of(81 * 120 - 1)
    assert whole.kernel is not None and len(whole.unknowns) > 81
    assert brief.kernel is None and len(brief.unknowns) == brief.defect == 81
    assert set(brief.unknowns) <= set(whole.unknowns)
