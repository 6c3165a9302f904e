"""Kinds of observations: one object each, and nothing about them elsewhere."""

import re
from pathlib import Path

import pytest

import obseq
import obseq.survey
from obseq.survey import KINDS, read_obs


def test_codes_and_names_are_unique() -> None:
    assert len({kind.code for kind in KINDS}) == len({kind.name for kind in KINDS}) == len(KINDS)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_every_kind_has_its_formulas(kind) -> None:
    names = set(obseq.formula_names())
    assert kind.formula in names or (not kind.formula and kind.is_linear(None))
    assert not kind.takes_heights or f"{kind.formula}Off" in names


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind.is_line], ids=lambda kind: kind.name)
def test_every_kind_is_read_by_its_code(kind, tmp_path) -> None:
    (tmp_path / "k.obs").write_text(f"{kind.code} A B 1 0.01\n")
    book = read_obs(tmp_path / "k.obs")
    assert book.observations.types.tolist() == [kind.code]
    assert book.label(0).startswith(f"{kind.name} A -> B (")
    assert (book.observations.stations[0] >= 0) == kind.needs_station


def test_nobody_asks_for_a_kind_by_its_name() -> None:
    """Readers, equations and reports ask the object; only initial values compare kinds in one place."""
    folder = Path(obseq.survey.__file__).parent
    names = "|".join(kind.name for kind in KINDS)
    found = [
        f"{path.name}:{number}: {line.strip()}"
        for path in sorted(folder.rglob("*.py"))
        if path.parent.name != "kinds"
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1)
        if re.search(rf'== "({names})"|\["({names})"\]', line)
    ]
    assert found == []


def test_the_former_name_of_codes_still_works_and_says_what_to_use() -> None:
    with pytest.warns(DeprecationWarning, match=r"objects now, obseq\.survey\.KINDS"):
        former = obseq.survey.ObservationType
    assert (former.Dist, former(5).name, former.Hz.is_angle, former.DH.needs_station) == (
        3,
        "Hz",
        True,
        False,
    )
