"""Files that are broken anyhow: every image reader reads them or refuses them in words."""

import importlib
from pathlib import Path

BENCHMARKS = Path(__file__).parents[2] / "tools" / "benchmarks"


def test_no_reader_ends_in_another_error(monkeypatch):
    monkeypatch.syspath_prepend(BENCHMARKS)
    counts, failures = importlib.import_module("fuzz_blocks").run(0, 900)
    assert failures == []
    assert counts["refused"] > 500
    assert counts["read"] > 25


def test_a_reader_that_fails_is_reported(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(BENCHMARKS)
    fuzz = importlib.import_module("fuzz_blocks")
    seed = ({"f.txt": b"1 2 3"}, lambda folder: int("x"))
    counts = fuzz.Counter()
    found = fuzz.failure(tmp_path, "numbers", seed, 7, counts)
    assert found.startswith("numbers, seed 7: ValueError")
    assert counts["failed"] == 1
