"""Mutated files of other programs: some of the cases of the bench."""

import importlib
from collections import Counter
from pathlib import Path

import pytest

from obseq.survey import Network

TOOLS = Path(__file__).parents[2] / "tools" / "benchmarks"


def test_mutated_projects_are_refused_or_give_what_can_be_trusted(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(TOOLS)
    bench = importlib.import_module("fuzz_projects")
    if not bench.DATA.is_dir():
        pytest.skip(f"the data sets are not beside the repository: {bench.DATA}")
    found, counts = bench.seeds(tmp_path), Counter()
    assert len(found) > 20
    failures = [said for number in range(40) if (said := bench.failure(found, number, 0.25, counts))]
    assert failures == []
    assert counts["refused"] > 13
    assert counts["adjusted"] > 0


@pytest.mark.parametrize("name", ["tables", "comp3d", "dna", "sinex", "starnet-gnss", "snap"])
def test_mutated_samples_are_refused_or_give_what_can_be_trusted(monkeypatch, tmp_path, name):
    monkeypatch.syspath_prepend(TOOLS)
    bench, counts = importlib.import_module("fuzz_projects"), Counter()
    found = bench.seeds(tmp_path, f"{name}.*")
    assert len(found) == 1
    failures = [said for number in range(30) if (said := bench.failure(found, number, 0.05, counts))]
    assert failures == []
    assert counts["refused"] > 7
    assert counts["read"] + counts["adjusted"] > 0


def test_mutated_field_books_are_refused_or_give_what_can_be_trusted(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(TOOLS)
    bench, counts = importlib.import_module("fuzz_projects"), Counter()
    found = bench.seeds(tmp_path, "book.*")
    assert len(found) == 10
    failures = [said for number in range(90) if (said := bench.failure(found, number, 0.05, counts))]
    assert failures == []
    assert counts["refused"] > 15
    assert counts["read"] + counts["adjusted"] > 9


@pytest.mark.parametrize("name", ["tables", "comp3d", "dna", "sinex", "starnet-gnss", "snap"])
def test_the_samples_without_mutation_are_adjusted(monkeypatch, tmp_path, name):
    monkeypatch.syspath_prepend(TOOLS)
    bench = importlib.import_module("fuzz_projects")
    (seed,) = bench.seeds(tmp_path, f"{name}.*")
    adjusted = Network.read_project(seed.paths, encoding="latin-1", points_crs=seed.points_crs).adjust()
    assert adjusted.converged
    assert not adjusted.left_out
