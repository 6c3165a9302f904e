"""Any member of a family by its name."""

import pytest

from obseq.errors import FormulaError
from obseq.formulas import REGISTRY
from obseq.formulas.bundles import PointOnFirstBundle
from obseq.formulas.colinearity import Colinearity
from obseq.formulas.distortion import Degree
from obseq.formulas.families import formula, from_name
from obseq.formulas.projections import FE_EquiSolid
from obseq.formulas.sensors import CorrectedSensor


@pytest.mark.parametrize("registered", REGISTRY, ids=lambda registered: registered.name)
def test_names_of_the_registry_give_its_formulas(registered):
    assert formula(registered.name) is registered


def test_other_members_of_families_are_made():
    name = "EqColinearityCamPPC_FE_EquiSolid_Dist_Rad4_Dec2_XY3"
    assert formula(name) == Colinearity(FE_EquiSolid(), Degree(4, 2, 3))
    assert formula(name).name == name


def test_unknown_names_get_the_nearest_ones():
    assert from_name("EqColinearity") is None
    with pytest.raises(FormulaError, match=r"'EqDist_Dist_Rad3_Dec1_X1'.*EqDist_Dist_Rad3_Dec1_XY1"):
        formula("EqDist_Dist_Rad3_Dec1_X1")


def test_impossible_members_are_refused():
    for make in (
        lambda: Degree(3, -1, 1),
        lambda: CorrectedSensor(-1),
        lambda: PointOnFirstBundle("Distance"),
    ):
        with pytest.raises(FormulaError, match=r"at least 0|one of Angle, Product"):
            make()
