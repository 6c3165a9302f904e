"""Snooping and single tests find as much as theory says: the bench, with a seed and fewer draws."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from obseq.report.quality import snooping_lines
from obseq.survey import Quality

BENCH = Path(__file__).resolve().parents[2] / "tools" / "benchmarks" / "bench_snooping.py"
DRAWS = 500
NAMES = ("height differences", "directions, zenith angles and distances", "GNSS vectors")


@pytest.fixture(scope="module")
def bench() -> ModuleType:
    sys.path.insert(0, str(BENCH.parent))  # benches import one another
    spec = importlib.util.spec_from_file_location("bench_snooping", BENCH)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def of_chance(share: float, draws: int = DRAWS, times: float = 3.5) -> float:
    """What a share of so many draws may be off by chance."""
    return times * float(np.sqrt(share * (1.0 - share) / draws))


@pytest.mark.parametrize(
    "name", ["height differences", "directions, zenith angles and distances", "GNSS vectors"]
)
def test_single_tests_reject_as_often_as_announced(bench, name) -> None:
    network = bench.Levelling(4) if name == "height differences" else bench.NETWORKS[name]()
    rates = bench.rates(network, DRAWS, seed=7)
    # Tests of one adjustment depend on each other: as many draws count as they have
    assert rates.alarms == pytest.approx(
        bench.LEVEL, abs=of_chance(bench.LEVEL, DRAWS * len(network.design) // 3)
    )
    assert rates.overall == pytest.approx(bench.OVERALL, abs=of_chance(bench.OVERALL))
    assert np.all(np.abs(rates.found - rates.expected) < [of_chance(share) for share in rates.expected])
    chance = [of_chance(share) for share in rates.first_expected]
    assert np.all(np.abs(rates.first - rates.first_expected) < chance)
    drawn = [of_chance(share, bench.THEORY_DRAWS) for share in rates.expected]
    assert np.all(rates.first_expected <= rates.expected + drawn)


@pytest.mark.parametrize("name", NAMES[1:])
def test_a_planted_blunder_is_named_first_and_explained(bench, name) -> None:
    network = bench.NETWORKS[name]()
    own, _ = bench.controls(network)
    biases = bench.BIAS * np.sqrt(np.diag(network.covariance))
    for row in np.flatnonzero(own > 4.0)[::6].tolist():
        errors = np.where(np.arange(len(own)) == row, biases, 0.0)
        record = network.adjusted(errors, Quality(snooping="w")).record()
        (first, *_) = record.snooping.rejections
        assert first.row == row
        assert first.blunder == pytest.approx(biases[row], rel=1e-3)
        (line,) = [text for text in snooping_lines(record) if first.observation in text]
        assert "off by about" in line


@pytest.mark.slow
@pytest.mark.parametrize(("name", "draws"), [("height differences", DRAWS), ("GNSS vectors", 60)])
def test_runs_of_snooping_leave_out_the_planted_blunder(bench, name, draws) -> None:
    network = bench.Levelling(4) if name == "height differences" else bench.NETWORKS[name]()
    alarms, first = bench.snooped(network, draws, seed=7)
    expected = float(bench.named_first(network, bench.sidak_critical(len(network.design)), seed=8).mean())
    assert alarms == pytest.approx(bench.OVERALL, abs=of_chance(bench.OVERALL, draws))
    assert first == pytest.approx(expected, abs=of_chance(expected, draws))
