"""Whatever the files hold, the readers and the initial values give a result or an `InputError`."""

import importlib.util
import random
from collections import Counter
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.survey import PointFileOptions, initial_values, join, read_cor, read_obs, read_points


def bench() -> ModuleType:
    """The bench, whose mutations these are."""
    path = Path(__file__).parents[2] / "tools" / "benchmarks" / "fuzz_readers.py"
    spec = importlib.util.spec_from_file_location("fuzz_readers", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


BENCH = bench()
OBS, COR, mutated, rewrite = BENCH.OBS, BENCH.COR, BENCH.mutated, BENCH.rewrite


def flat(points):
    return np.tile(np.eye(3), (len(points), 1, 1))


def compute(obs_path, cor_path) -> bool:
    """True when initial values were computed, false when the input was refused."""
    try:
        points, book = join(read_cor(cor_path, default_sigma=0.01), read_obs(obs_path))
        for recompute_free in (True, False):
            values = initial_values(points, book, flat, recompute_free=recompute_free)
            placed = np.array([step is not None for step in values.point_steps])
            assert np.isfinite(values.coordinates[placed]).all()
        values.require_complete()
    except InputError as error:
        str(error).encode("utf-8")
        return False
    return True


def test_mutated_files_are_refused_or_read(tmp_path):
    """A few of those of the bench, which does as many as one likes."""
    counts = Counter()
    seeds = range(1_000_000, 1_000_300)
    assert [found for seed in seeds if (found := BENCH.failure(tmp_path, seed, 0.0, counts))] == []
    assert counts["refused"] > 120
    assert counts["read"] > 14


def test_mutated_networks_are_refused_or_adjusted_to_what_can_be_trusted(tmp_path):
    counts = Counter()
    seeds = range(2_004_911, 2_004_920)
    assert [found for seed in seeds if (found := BENCH.failure(tmp_path, seed, 1.0, counts))] == []
    assert counts["adjusted"] > 0


@pytest.mark.parametrize("seed", range(2))
def test_mutated_networks(tmp_path, seed):
    chance = random.Random(seed)
    obs, cor = tmp_path / "n.obs", tmp_path / "n.cor"
    outcomes = []
    for _ in range(50):
        rewrite(obs, mutated(OBS, chance) if chance.random() < 0.8 else OBS.encode())
        rewrite(cor, mutated(COR, chance) if chance.random() < 0.4 else COR.encode())
        outcomes.append(compute(obs, cor))
    assert 0 < sum(outcomes) < len(outcomes)


def test_the_network_without_mutation_is_read(tmp_path):
    obs, cor = tmp_path / "n.obs", tmp_path / "n.cor"
    obs.write_text(OBS)
    cor.write_text(COR)
    points, book = join(read_cor(cor), read_obs(obs))
    values = initial_values(points, book, flat)
    assert values.unplaced == ()


@pytest.mark.parametrize("seed", range(4))
def test_random_observations_of_few_points(tmp_path, seed):
    # any combination of types between five points with random values: contradictory, but never a crash
    chance = random.Random(seed)
    obs, cor = tmp_path / "n.obs", tmp_path / "n.cor"
    cor.write_text(COR)
    for _ in range(40):
        lines = []
        for _ in range(chance.randint(1, 25)):
            lines.append(chance.choice(["", "", "", "#FIX", "#VERT", "#BASC", "#NEW"]))
            a, b = chance.sample("ABCDPQR", 2)
            code = chance.choice([3, 4, 5, 6, 7, 14, 15, 16])
            value = chance.choice([0.0, 100.0, 200.0, 1e-9, chance.uniform(1, 390), chance.uniform(1, 390)])
            lines.append(f"{code} {a} {b} {max(value, 1e-9) if code == 3 else value} 0.01")
        obs.write_text("\n".join(lines))
        compute(obs, cor)


@pytest.mark.parametrize("seed", range(4))
def test_mutated_point_files(tmp_path, seed):
    chance = random.Random(seed)
    path = tmp_path / "points.txt"
    for _ in range(60):
        path.write_bytes(mutated(COR, chance))
        try:
            read_points(
                path,
                chance.choice(["ANXYZBla", "ANXYZ", "A N X Y Z Sx Sy Sz"]),
                PointFileOptions(comment="*"),
            )
        except InputError as error:
            str(error).encode("utf-8")
