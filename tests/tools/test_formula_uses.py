"""The table of what uses each formula: complete, and true."""

import importlib
import json
import re
from pathlib import Path

import pytest

from obseq.kernels import formula_names

ROOT = Path(__file__).parents[2]


@pytest.fixture
def tool(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "tools")
    return importlib.import_module("formula_uses")


def test_every_formula_has_a_use_or_a_reason(tool) -> None:
    assert [name for name in formula_names() if not tool.use(name)] == []
    for name in formula_names():  # a kernel that nothing uses is not said to be used as well
        reasons = [why for names, why in tool.KERNELS if re.fullmatch(names, name)]
        assert len(reasons) <= 1 and bool(reasons) == tool.use(name).startswith("kernel only"), name


def test_those_of_mmvii_are_all_in_the_table(tool, shared_data) -> None:
    """191 of them: most are adjusted with; the page gives a reason for each of the few others."""
    path = shared_data / "mmvii-check-values" / "names.json"
    names = {record["name"] for record in json.loads(path.read_text("utf-8"))}
    rows = dict(re.findall(r"^\| `(\w+)` \| (.+) \|$", tool.PAGE.read_text("utf-8"), re.MULTILINE))
    kernels = {name for name in names if rows[name].startswith("kernel only: ")}
    assert len(names) == 191 and 8 * len(kernels) <= len(names)


def test_what_the_table_says_is_so(tool) -> None:
    for names, module, _ in tool.LIBRARY:
        text = (ROOT / "src" / "obseq" / module).read_text("utf-8")
        stems = [re.split(r"[(.\\]", alternative)[0] for alternative in names.split("|")]
        assert all(stem in text for stem in stems), names
    for _, page, word, _ in tool.SHOWN:
        text = (ROOT / "docs" / page).read_text("utf-8")
        assert re.search(rf'site\.add\("\w*{word}', text), word


def test_no_pattern_is_idle(tool) -> None:
    for table in (tool.LIBRARY, tool.SHOWN, tool.KERNELS):
        for names, *_ in table:
            assert any(re.fullmatch(names, name) for name in formula_names()), names


def test_the_page_is_what_the_tool_writes(tool) -> None:
    assert tool.PAGE.read_text("utf-8") == tool.page(), "write it anew: python tools/formula_uses.py"
