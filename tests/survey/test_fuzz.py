"""Whatever the files hold, the readers and the initial values give a result or an `InputError`."""

import random

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.survey import PointFileOptions, initial_values, join, read_cor, read_obs, read_points

OBS = """* a network
#FIX
5 A B 100 0.001
#VERT
7 A B 0 0.001
6 A P 98.5 0.001
3 A P 55.2 0.002
5 A P -40.62 0.001
5 A Q -61 0.001
7 P A 12 0.001
5 P B 77 0.001
5 P C 230 0.001
6 P C 101 0.001
4 A Q 0.25 0.001
3 Q A 20 0.01 * remark
3 Q B 90 0.01
#BASC
14 R A 10 0.01
15 R A 20 0.01
16 R A 1 0.01
14 R B 110 0.01
15 R B 20 0.01
16 R B -1 0.01
14 R C 50 0.01
15 R C 110 0.01
16 R C 2 0.01
#NEW
5 P Q 3 -0.001
"""
COR = """* points
1 A 0 0 10 0.001 0.001 0.001
1 B 100 0 12 0.001
1 C 40 90 15 0 0 -1 remark
0 D 5 5 5
"""
WORDS = [
    "#VERT",
    "#BASC",
    "#FIX",
    "5",
    "7",
    "3",
    "14",
    "A",
    "B",
    "P",
    "-1",
    "0",
    "1e9",
    "-400",
    "nan",
    "1e-320",
]
WORDS += [
    "\u00e9",
    "*",
    "#",
    ",",
    "1_0",
    "100",
    "200",
    "0.0",
    "\x0b",
    "9" * 400,
    "\u0663",
    "inf",
    "0x10",
    "\ufeff",
]


def flat(points):
    return np.tile(np.eye(3), (len(points), 1, 1))


def mutated(text: str, chance: random.Random) -> bytes:
    """The text with a few words, lines or bytes exchanged, repeated, dropped or invented."""
    lines = text.split("\n")
    for _ in range(chance.randint(1, 6)):
        row = chance.randrange(len(lines))
        words = lines[row].split(" ")
        action = chance.randrange(6)
        if action == 0:
            words[chance.randrange(len(words))] = chance.choice(WORDS)
        elif action == 1:
            words.insert(chance.randrange(len(words) + 1), chance.choice(WORDS))
        elif action == 2:
            words.pop(chance.randrange(len(words)))
        elif action == 3:
            lines.insert(chance.randrange(len(lines)), lines[row])
        elif action == 4:
            lines[row], words = "", [""]
        else:
            other = lines[chance.randrange(len(lines))].split(" ")
            words[-1] = other[-1]
        lines[row] = " ".join(words)
    data = bytearray("\n".join(lines).encode())
    if chance.random() < 0.2:
        data[chance.randrange(len(data))] = chance.randrange(256)
    return bytes(data)


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


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_mutated_networks(tmp_path, seed):
    chance = random.Random(seed)
    obs, cor = tmp_path / "n.obs", tmp_path / "n.cor"
    outcomes = []
    for _ in range(120):
        obs.write_bytes(mutated(OBS, chance) if chance.random() < 0.8 else OBS.encode())
        cor.write_bytes(mutated(COR, chance) if chance.random() < 0.4 else COR.encode())
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
