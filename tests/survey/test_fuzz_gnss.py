"""Mutated DNA, DynaML and SINEX files: refused in one message that names the file, or read."""

import importlib.util
import random
from collections import Counter
from pathlib import Path

import pytest
import test_dynadjust
import test_sinex

from obseq.errors import InputError
from obseq.formats.conversion import write_dynaml
from obseq.survey import Network

BENCH = Path(__file__).parents[2] / "tools" / "benchmarks" / "fuzz_readers.py"


def mutated():
    spec = importlib.util.spec_from_file_location("fuzz_readers", BENCH)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.mutated


def seeds(folder):
    """The files of each format, by name."""
    stn, msr = test_dynadjust.dna(test_dynadjust.Site())
    kept = "\n".join(line for line in msr.splitlines() if not line.startswith("L "))
    paths = test_dynadjust.written(folder, (stn, kept))
    write_dynaml(folder / "n.xml", Network.read_project(paths))
    return {
        "dna": {"n.stn": stn, "n.msr": msr},
        "dynaml": {"n.xml": (folder / "n.xml").read_text()},
        "sinex": {"n.snx": test_sinex.sinex(test_sinex.covariance())},
    }


def outcome(folder, texts, change, chance):
    """What becomes of files of which one is changed."""
    chosen = chance.choice(list(texts))
    for name, text in texts.items():
        (folder / name).write_bytes(change(text, chance) if name == chosen else text.encode())
    try:
        Network.read_project([folder / name for name in texts])
    except InputError as error:
        assert any(name in str(error) for name in texts), str(error)
        str(error).encode("utf-8")
        return "refused"
    return "read"


@pytest.mark.parametrize("form", ["dna", "dynaml", "sinex"])
def test_mutated_files_are_refused_or_read(tmp_path, form):
    texts, change, counts = seeds(tmp_path)[form], mutated(), Counter()
    for seed in range(120):
        counts[outcome(tmp_path, texts, change, random.Random(seed))] += 1
    assert counts["refused"] > 24
    assert counts["read"] > 2


@pytest.mark.parametrize("form", ["dna", "dynaml", "sinex"])
def test_some_mutated_files_are_refused_or_read(tmp_path, form):
    texts, change = seeds(tmp_path)[form], mutated()
    found = {outcome(tmp_path, texts, change, random.Random(seed)) for seed in range(5000, 5020)}
    assert "refused" in found
