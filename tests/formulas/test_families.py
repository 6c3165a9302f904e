"""Any member of a family by its name."""

from dataclasses import dataclass

import pytest
from families import of_each

from obseq.errors import FormulaError
from obseq.formulas import FAMILIES, find, formula
from obseq.formulas.bundles import PointOnFirstBundle
from obseq.formulas.colinearity import Colinearity
from obseq.formulas.distortion import Degree
from obseq.formulas.naming import Patterned
from obseq.formulas.projections import FE_EquiSolid
from obseq.formulas.sensors import CorrectedSensor

REFUSALS = r"at least [01] |one of (Angle|Stenope)|a Degree|True or False"


@of_each()
def test_names_of_the_registry_give_its_formulas(registered):
    assert formula(registered.name) is registered


def test_other_members_of_families_are_made():
    name = "EqColinearityCamPPC_FE_EquiSolid_Dist_Rad4_Dec2_XY3"
    assert formula(name) == Colinearity(FE_EquiSolid(), Degree(4, 2, 3))
    assert formula(name).name == name


def test_unknown_names_get_the_nearest_ones():
    assert find("EqColinearity") is None
    with pytest.raises(FormulaError, match=r"'EqDist_Dist_Rad3_Dec1_X1'.*EqDist_Dist_Rad3_Dec1_XY1"):
        formula("EqDist_Dist_Rad3_Dec1_X1")


@of_each()
def test_one_pattern_gives_the_name_and_the_member(registered):
    found = [member for family in FAMILIES if (member := family.from_name(registered.name)) is not None]
    assert found == ([registered] if type(registered) in FAMILIES else [])


@pytest.mark.parametrize("name", ["Base_Rad1", "Rad01_Dec1_XY1", "Rad1_Dec1_XY1 ", "Rad1_Dec1_XY1_D1aXbX_"])
def test_a_name_is_the_whole_of_the_pattern(name):
    assert Degree.from_name(name) is None


def test_impossible_members_are_refused():
    for make in (
        lambda: Degree(3, -1, 1),
        lambda: CorrectedSensor(-1),
        lambda: PointOnFirstBundle("Distance"),
        lambda: Colinearity(Degree(), Degree()),
        lambda: Colinearity(FE_EquiSolid(), FE_EquiSolid()),
        lambda: Degree(fraser=2),
        lambda: find("SumSquare_0"),
    ):
        with pytest.raises(FormulaError, match=REFUSALS):
            make()


@pytest.mark.parametrize(
    "name",
    ["EqDist_Dist_Rad99999999_Dec1_XY1", "SumSquare_99999999", "RadiomVignetLin_201", "Clino_0_99999999"],
)
def test_members_too_large_to_make_are_refused_at_once(name):
    with pytest.raises(FormulaError, match=r"at most 200, not \d+$"):
        find(name)


def test_formulas_of_too_many_scalars_are_refused_at_once():
    with pytest.raises(FormulaError, match=r"Rad0_Dec0_XY50: 2648 .*at most 1000$"):
        formula("EqDist_Dist_Rad0_Dec0_XY50").expressions()


def test_names_of_any_length_are_refused_in_a_line():
    for name in ("SumSquare_" + "9" * 10_000_000, "x" * 10_000_000):
        with pytest.raises(FormulaError) as refusal:
            formula(name)
        assert len(str(refusal.value)) < 200


def test_a_pattern_names_fields_that_say_how_they_are_spelt():
    @dataclass(frozen=True)
    class Misspelt(Patterned):
        degree: int
        pattern = "Misspelt_{degrees}"

    @dataclass(frozen=True)
    class Unsaid(Patterned):
        degree: float
        pattern = "Unsaid_{degree}"

    with pytest.raises(FormulaError, match="Misspelt: the pattern names no field degrees"):
        Misspelt(1)
    with pytest.raises(FormulaError, match="Unsaid: annotate degree"):
        Unsaid(1.5)
