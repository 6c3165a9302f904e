"""Mutated files of other programs and field books: refused in words, or a result that can be trusted."""

import importlib.util
import random
import sys
from collections import Counter
from pathlib import Path

import pytest

from obseq.errors import ObseqError
from obseq.formats.conversion import write_gama
from obseq.survey import Network

TOOLS = Path(__file__).parents[2] / "tools" / "benchmarks"
SPEC = importlib.util.spec_from_file_location("field_books", TOOLS / "field_books.py")
assert SPEC is not None and SPEC.loader is not None
simulated = importlib.util.module_from_spec(SPEC)
sys.modules["field_books"] = simulated
SPEC.loader.exec_module(simulated)
SAMPLES = {
    "n.gkf": "gama/gama.gkf",
    "n.dat": "starnet/starnet.dat",
    "n.xml": "landxml/landxml.xml",
    "n.gsi": "gsi/gsi.gsi",
}
"""Networks that the bench has as well, by the name that the mutated file gets."""

TEXTS = {name: (TOOLS / "samples" / path).read_text(encoding="utf-8") for name, path in SAMPLES.items()}
BOOKS = [name for name in simulated.FORMATS if name != "job.gsi"]
TEXTS |= {name: "\n".join(simulated.FORMATS[name](simulated.job()[:2])) for name in BOOKS}
ADJUSTED = {"n.gkf": 0.3, "n.dat": 0.1, "n.xml": 0.3, "n.gsi": 0.1}
"""Shares of the files that are adjusted: most mutations of XML are refused."""
SIGMAS = ["distance=3mm", "direction=5sec", "zenith=5sec", "azimuth=5sec", "height=2mm", "height-per-km=1mm"]


def outcome(bench, folder, name, seed, adjusts):
    """ "refused", "read" or "adjusted"; raises when the result cannot be trusted."""
    chance = random.Random(seed)
    path = folder / name
    bench.rewrite(path, bench.mutated(TEXTS[name], chance))
    try:
        network = Network.read_project(path, sigmas=[] if name == "n.gkf" else SIGMAS)
        if chance.random() >= adjusts:
            if network.frame.is_plane and chance.random() < 0.1:
                write_gama(folder / "again.gkf", network)
            return "read"
    except ObseqError as error:
        bench.check_message(str(error))
        return "refused"
    return bench.adjusted(network)


@pytest.mark.parametrize("name", TEXTS)
def test_the_files_without_mutation_are_adjusted(tmp_path, name):
    (tmp_path / name).write_text(TEXTS[name])
    adjusted = Network.read_project(tmp_path / name, sigmas=SIGMAS).adjust()
    assert adjusted.converged
    assert not adjusted.left_out


@pytest.mark.parametrize("name", TEXTS)
def test_mutated_files_are_refused_or_give_what_can_be_trusted(monkeypatch, tmp_path, name):
    monkeypatch.syspath_prepend(TOOLS)
    bench, counts = importlib.import_module("fuzz_readers"), Counter()
    share, seeds = (ADJUSTED[name], 80) if name in ADJUSTED else (0.01, 40)
    cases = ((seed, lambda seed=seed: outcome(bench, tmp_path, name, seed, share)) for seed in range(seeds))
    failures = [said for seed, work in cases if (said := bench.judged(f"seed {seed}", work, counts))]
    assert failures == []
    assert counts["refused"] > seeds // 10
    assert counts["read"] > seeds // 34
    assert counts["adjusted"] > (0 if name in ADJUSTED else -1)
