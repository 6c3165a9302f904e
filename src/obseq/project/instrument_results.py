"""Instrument blocks of a project, as they are after an adjustment."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING

import numpy as np

from obseq.project.instrument_joining import ENTRIES
from obseq.project.rigid_blocks import pose_tree
from obseq.project.tree import data_text

if TYPE_CHECKING:
    from collections.abc import Iterable

    from obseq.images import BundleSolution
    from obseq.images.rigid import Sigmas
    from obseq.project.instrument_blocks import InstrumentBlock
    from obseq.project.tree import Tree

Sums = dict[tuple[str, str], tuple[int, float, float]]
"""By pair of cameras: exposures, and sums of what translations and matrices are off."""


def adjusted_text(
    found: InstrumentBlock,
    solution: BundleSolution,
    save: bool,
    tilts: bool = False,
    *,
    as_json: bool = False,
) -> str:
    """The file of a block after its adjustment; what it holds besides stays as it was.

    Args:
        found: as it was before.
        solution: of the adjustment.
        save: whether the sigmas of pairs and cameras are those that were observed.
        tilts: whether its clinometers took part.
        as_json: True for JSON instead of XML.
    """
    data = copy.deepcopy(found.data)
    places = solution.rigid_places(found.name)
    for row in _rows(_field(data, "Cams"), "Set_Cams"):
        row["Pose"] = pose_tree(places[str(row["NameCalib"])])
    if tilts:
        _set_clinometers(data, solution)
    if save:
        _set_sigmas(data, list(found.pairs), _sums(solution, found.name))
    return data_text(data, as_json=as_json)


def _field(tree: dict[str, Tree], name: str) -> dict[str, Tree]:
    found = tree.get(name)
    return found if isinstance(found, dict) else {}


def _rows(tree: dict[str, Tree], name: str) -> list[dict[str, Tree]]:
    found = tree.get(name)
    return [row for row in found if isinstance(row, dict)] if isinstance(found, list) else []


def _set_clinometers(data: dict[str, Tree], solution: BundleSolution) -> None:
    for row in _rows(_field(data, "Clinos"), "Set_Clinos"):
        adjusted = solution.clinometer(str(row["Name"]))
        row["PtNorm"] = tuple(adjusted.axis.tolist())
        row["PolCorr"] = [(value,) for value in adjusted.correction]


def _set_sigmas(data: dict[str, Tree], pairs: list[tuple[str, str]], sums: Sums) -> None:
    """The sigmas of pairs, in the order of the file, and those of cameras: the means over their pairs."""
    for pair, row in zip(pairs, _rows(data, "SigmasPairs"), strict=True):
        if pair in sums:
            _set_average(_field(row, "V"), [sums[pair]])
    for row in _rows(data, "DescrIndiv"):
        own = [value for pair, value in sums.items() if row["K"] in pair]
        if own:
            _set_average(_field(_field(row, "V"), "Sigma"), own)


def _set_average(sigmas: dict[str, Tree], sums: Iterable[tuple[int, float, float]]) -> None:
    n, *parts = (sum(values) for values in zip(*sums, strict=True))
    for name, total in zip(("Tr", "Rot"), parts, strict=True):
        sigmas[name] = {"SumW": (n,), "SumVW": (total,), "Nb": (n,)}


def _sums(solution: BundleSolution, name: str) -> Sums:
    """By pair, the lengths of what translations and matrices are off, summed up."""
    found = solution.rigid_residuals(name)
    shifts = np.linalg.norm(found.translations, axis=1)
    turns = 2.0 * ENTRIES * np.sin(np.linalg.norm(found.rotations, axis=1) / 2.0)
    rows = {pair: [k for k, other in enumerate(found.cameras) if other == pair] for pair in found.cameras}
    return {pair: (len(own), *_totals(shifts[own], turns[own])) for pair, own in rows.items()}


def _totals(shifts: np.ndarray, turns: np.ndarray) -> Sigmas:
    return float(shifts.sum()), float(turns.sum())
