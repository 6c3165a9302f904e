"""The witnesses kept in the repository: what they are, and that they are those of the whole collection."""

import importlib.util
import json
import re
from pathlib import Path

import pytest

TESTS = Path(__file__).parent
EXCERPTS = TESTS / "data"
COLLECTION = TESTS.parents[1] / "shared" / "data"
OTHERS = {"README.md", "colmap_models.json"}
"""What stands beside the excerpts and is no part of the collection: its source is told in the README."""


def files(folder: Path) -> dict[str, str]:
    found = (path for path in folder.rglob("*") if path.is_file() and path.name not in OTHERS)
    return {path.relative_to(folder).as_posix(): path.read_text("utf-8") for path in found}


def test_every_folder_has_its_source_and_licence() -> None:
    page = (EXCERPTS / "README.md").read_text("utf-8")
    told = set(re.findall(r"`([\w-]+)`", page.replace("`-", "`gama-textbook-")))
    assert {folder.name for folder in EXCERPTS.iterdir() if folder.is_dir()} <= told


def test_every_other_file_has_its_source_and_licence() -> None:
    page = (EXCERPTS / "README.md").read_text("utf-8")
    beside = {path.name for path in EXCERPTS.iterdir() if path.is_file()}
    assert beside == OTHERS
    assert all(f"| `{name}` |" in page for name in beside - {"README.md"})


def test_they_decide_formulas_statistics_and_networks() -> None:
    records = json.loads((EXCERPTS / "mmvii-check-values" / "check-values.json").read_text("utf-8"))
    assert len(records) == 124 and all(len(record["points"]) >= 2 for record in records)
    assert len(list((EXCERPTS / "nist-strd-dev").glob("*.dat"))) == 15
    assert len(list(EXCERPTS.glob("gama-textbook-*/*.gkf"))) >= 10


@pytest.mark.skipif(not COLLECTION.is_dir(), reason="the whole collection is not beside the repository")
def test_they_are_those_of_the_collection(tmp_path: Path) -> None:
    """Otherwise run tools/excerpts.py."""
    spec = importlib.util.spec_from_file_location("excerpts", TESTS.parent / "tools" / "excerpts.py")
    assert spec is not None and spec.loader is not None
    excerpts = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(excerpts)
    excerpts.write(COLLECTION, tmp_path)
    assert files(tmp_path) == files(EXCERPTS)
