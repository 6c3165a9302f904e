"""`obseq adjust --memory` and its kin: the results of one machine, and what is told."""

import json
from importlib.resources import files

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.leastsquares import Blocks
from obseq.survey import Network

TOLD = ("run", "phases")


@pytest.fixture
def site(tmp_path, monkeypatch):
    """A folder with a network of distances, which is the current folder."""
    rng = np.random.default_rng(4)
    grid = np.stack(np.meshgrid(np.arange(10), np.arange(10)), axis=-1).reshape(-1, 2) * 50.0
    true = np.column_stack([grid, rng.uniform(0.0, 80.0, len(grid))])
    known = {0, 9, 90, 99}
    points = [
        f"{int(k in known)} P{k} {x:.4f} {y:.4f} {z:.4f}{' 0.001' if k in known else ''}"
        for k, (x, y, z) in enumerate(true.tolist())
    ]
    lengths = np.linalg.norm(true[:, None] - true, axis=2)
    near = [(a, b) for a in range(100) for b in range(a) if lengths[a, b] < 140.0]
    sights = [f"3 P{a} P{b} {lengths[a, b] + rng.normal(0.0, 0.002):.5f} 0.002" for a, b in near]
    (tmp_path / "site.cor").write_text("\n".join(points) + "\n", encoding="utf-8")
    (tmp_path / "site.obs").write_text("\n".join(sights) + "\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def results(name):
    """Numbers of a result file, and everything else."""
    record = json.loads((name).read_text("utf-8"))
    return list(leaves({key: value for key, value in record.items() if key not in TOLD}))


def leaves(thing):
    """All values, in order."""
    if isinstance(thing, dict | list):
        for value in thing.values() if isinstance(thing, dict) else thing:
            yield from leaves(value)
    else:
        yield thing


def test_the_results_are_those_of_one_machine(site, capsys):
    assert main(["adjust", "site.obs", "site.cor", "--json", "whole.json"]) == 0
    summary = capsys.readouterr()
    options = ["--memory", "4GB", "--work", "work"]
    assert main(["adjust", "site.obs", "site.cor", "--json", "parts.json", *options]) == 0
    told = capsys.readouterr()
    assert told.out.replace("parts.json", "whole.json").splitlines()[:6] == summary.out.splitlines()[:6]
    assert "blocks: 300 unknowns are solved whole, which memory suffices for" in told.err
    assert not list((site / "work").iterdir())
    for one, other in zip(results(site / "whole.json"), results(site / "parts.json"), strict=True):
        assert one == (pytest.approx(other, rel=1e-9, abs=1e-9) if isinstance(other, float) else other)


def test_the_diagnosis_of_parts_is_that_of_one_machine(site):
    lines = (site / "site.obs").read_text().splitlines()
    code, origin, target, length, sigma = lines[60].split()
    lines[60] = " ".join([code, origin, target, f"{float(length) + 0.4:.5f}", sigma])
    (site / "site.obs").write_text("\n".join(lines) + "\n", encoding="utf-8")
    network = Network.read(site / "site.obs", site / "site.cor")
    with Blocks(parts=4) as blocks:
        found = network.adjust(blocks=blocks).diagnosis
    whole = network.adjust().diagnosis
    assert [one.what for one in found.accused] == [one.what for one in whole.accused]
    assert found.accused[0].size == pytest.approx(whole.accused[0].size, rel=1e-9)
    assert "site.obs:61" in found.accused[0].what


def test_few_unknowns_are_solved_whole_and_that_is_told_once(capsys):
    demo = files("obseq.survey") / "data"
    main(["adjust", str(demo / "demo.obs"), str(demo / "demo.cor"), "--memory", "1MB"])
    told = capsys.readouterr().err
    assert told.count("blocks: ") == 1 and "unknowns are solved whole, as up to 250 are" in told


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--resume"], "--resume goes with --memory, --workers or --scheduler"),
        (["--memory", "much"], "is no size of memory"),
        (["--memory", "1MB"], "give more memory"),
        (["--memory", "1GB", "--resume"], "name the folder of the run that was stopped"),
    ],
)
def test_options_that_cannot_be_followed(site, capsys, options, told):
    assert main(["adjust", "site.obs", "site.cor", *options]) == 2
    assert told in capsys.readouterr().err


@pytest.mark.parametrize(("taken", "more"), [(3_000_000_000, False), (5_000_000_000, True)])
def test_what_a_run_took_is_told(taken, more, site, capsys, monkeypatch):
    monkeypatch.setattr("obseq.leastsquares.blocks.memory.most_in_use", lambda: taken)
    assert main(["adjust", "site.obs", "site.cor", "--memory", "4GB"]) == 0
    (line,) = (one for one in capsys.readouterr().err.splitlines() if one.startswith("memory: "))
    assert line.startswith(f"memory: {taken / 1e9:.2f} GB at most")
    assert ("more than was asked for" in line) == more
