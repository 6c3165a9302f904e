"""Mutated files of other programs: a few hundred of the cases of the bench."""

import importlib
from collections import Counter
from pathlib import Path

import pytest

TOOLS = Path(__file__).parents[2] / "tools" / "benchmarks"


@pytest.mark.slow  # reads three hundred projects, adjusts some
def test_mutated_projects_are_refused_or_give_what_can_be_trusted(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(TOOLS)
    bench = importlib.import_module("fuzz_projects")
    if not bench.DATA.is_dir():
        pytest.skip(f"the data sets are not beside the repository: {bench.DATA}")
    found, counts = bench.seeds(tmp_path), Counter()
    assert len(found) > 20
    failures = [said for number in range(300) if (said := bench.failure(found, number, 0.1, counts))]
    assert failures == []
    assert counts["refused"] > 100
    assert counts["adjusted"] > 3
