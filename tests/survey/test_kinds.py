"""Kinds of observations: one object each, and nothing about them elsewhere."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from sources import imports, nodes

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


GENERAL = {f"obseq.survey.kinds.{module}" for module in ("kind", "registry", "formulas")}
FORMATS = (
    "survey/kinds",
    "survey/checks/both_faces.py",
    "formats",
    "project/topo.py",
    "report/tables/named.py",
    "report/drawings/scheme.py",
)
"""Where single kinds have a name: their room, and what files call them (in `report`, those of results)."""


def modules() -> Iterator[tuple[str, Path]]:
    """What may know no kind of observation from another."""
    package = Path(obseq.__file__).parent
    for room in ("survey", "report", "images", "project", "cli"):
        for path in sorted((package / room).rglob("*.py")):
            name = path.relative_to(package).as_posix()
            if not name.startswith(FORMATS):
                yield name, path


def test_nobody_asks_which_kind_it_is() -> None:
    """Initial values, equations, screening and reports ask what the object says of itself."""
    imported = [
        f"{name}:{node.lineno}"
        for name, path in modules()
        if "obseq.survey.kinds." in path.read_text("utf-8")
        for node in imports(path)
        if isinstance(node, ast.ImportFrom)
        and (node.module or "").startswith("obseq.survey.kinds.")
        and node.module not in GENERAL
    ]
    assert imported == []


def test_nobody_names_a_kind() -> None:
    names = {kind.name for kind in KINDS}
    quoted = re.compile(f"""["'](?:{"|".join(names)})["']""")
    named = [
        f"{name}:{node.lineno}: {node.value}"
        for name, path in modules()
        if name.startswith(("survey", "report")) and quoted.search(path.read_text("utf-8"))
        for node in nodes(path, ast.Constant)
        if node.value in names
    ]
    assert named == []
