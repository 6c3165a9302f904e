"""A site of five by five points to measure and plan, larger ones of the same kind, and a block of images."""

import importlib.util
import math
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np

from obseq.images.output.page import shown as shown_block
from obseq.images.output.record import record_of
from obseq.report import compared, planned
from obseq.report.head import Page
from obseq.report.page import adjustment_page
from obseq.survey import Datum, Network, Quality, compare, plan, simulate

REACH = 100.0
"""Metres from an instrument to what it sees."""


def grid(folder: Path, side: int) -> Network:
    """Side by side points, the corners known, an instrument on each fourth one; exact observations."""
    places = [
        (40.0 * (k % side) + 3 * math.sin(k), 40.0 * (k // side), 2.0 * (k % 3)) for k in range(side**2)
    ]
    known = {0, side - 1, side * (side - 1), side**2 - 1}
    points = [
        f"{int(k in known)} P{k} {x} {y} {z} {0.002 if k in known else ''}"
        for k, (x, y, z) in enumerate(places)
    ]
    (folder / "site.cor").write_text("\n".join(points) + "\n", encoding="utf-8")
    lines = []
    for k in range(0, side**2, 4):
        seen = [j for j in range(side**2) if j != k and math.dist(places[k], places[j]) < REACH]
        for code, j in zip([7] + [5] * len(seen), seen, strict=False):
            lines += [f"{code} P{k} P{j} 0 0.0006", f"6 P{k} P{j} 100 0.001", f"3 P{k} P{j} 1 0.002"]
    (folder / "site.obs").write_text("\n".join(lines) + "\n", encoding="utf-8")
    read = Network.read(folder / "site.obs", folder / "site.cor", frame="Local")
    return simulate(read, noise=False)


def spoilt(network: Network, seed: int = 1) -> Network:
    """The network with errors of chance, and two that are none: a direction, and a distance."""
    drawn = simulate(network, seed)
    values = drawn.book.observations.values.copy()
    values[np.array([15, 44])] += [0.2 * math.pi / 200.0, 0.05]  # a direction, a distance
    return replace(
        drawn, book=replace(drawn.book, observations=replace(drawn.book.observations, values=values))
    )


def flight() -> Page:
    """The page of a block with positions, a rolling shutter and check points."""
    return shown_block(
        record_of(module_of("images/flights.py").flight(n_points=200, noise=0.4).block.solve())
    )


def module_of(name: str) -> ModuleType:
    """Another module of the tests."""
    path = Path(__file__).parents[1] / name
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


def levelled(folder: Path) -> Network:
    """A levelling of points whose plan nobody knows: it is drawn as a scheme."""
    heights, chance = {"A": 0.0, "B": 1.2, "C": 3.1, "D": 2.4, "E": -0.7}, np.random.default_rng(1)
    pairs = ["AB", "BC", "CD", "DE", "EA", "AC", "BD"]
    values = [heights[b] - heights[a] + 0.001 * chance.standard_normal() for a, b in pairs]
    lines = [f"4 {a} {b} {value:.4f} 0.001" for (a, b), value in zip(pairs, values, strict=True)]
    points = ["5 A 0 0 0 0.001", *(f"4 {name} 0 0 0" for name in "BCDE")]
    (folder / "level.obs").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (folder / "level.cor").write_text("\n".join(points) + "\n", encoding="utf-8")
    return Network.read(folder / "level.obs", folder / "level.cor")


def page_of(kind: str, folder: Path) -> Page:
    """The page of a kind of result."""
    if kind == "block":
        return flight()
    if kind == "whole":
        figure = module_of("joint/test_record.py")._figure(folder, images=True)
        return adjustment_page(figure.solve().record("Survey and images"))
    if kind == "levelling":
        return adjustment_page(levelled(folder).adjust().record("Levelling"))
    site = grid(folder, 32 if kind == "thousand" else 5)
    if kind == "plan":
        return planned.shown(plan(site).record())
    if kind == "comparison":
        moved = site.points.coordinates.copy()
        moved[12] += [0.02, -0.01, 0.0]
        later = replace(site, points=replace(site.points, coordinates=moved))
        epochs = [
            simulate(one, seed).adjust() for one, seed in ((site, 1), (simulate(later, noise=False), 2))
        ]
        return compared.shown(compare(*epochs).record())
    if kind == "free":
        return adjustment_page(simulate(site, 1).adjust(datum=Datum("inner")).record("Free"))
    quality = Quality(ellipses=0.95)
    return adjustment_page(spoilt(site).adjust(quality=quality).record("Site network"))
