"""The part of a large network that its page has: the worst and the weakest of each list."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from msgspec import structs

from obseq.records.rows import Rows
from obseq.report.findings import POOR, spreads

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import TypeVar

    from obseq.arrays import FloatArray, IntArray
    from obseq.records.adjustment import AdjustmentRecord, ObservationRecord, PointRecord
    from obseq.records.record import Record
    from obseq.report.drawings.map import Similarity
    from obseq.report.tables.units import Plain

    Kind = TypeVar("Kind", bound=Record)

MOST = 20_000
"""Rows that a list of a page has: a page of full lists is 8 MB, and opens in two seconds."""
CELLS = 120
"""Cells of the density plan along its longer side: seven pixels of a screen each."""
NOUNS = {
    "observations": "observations",
    "points": "points",
    "constraints": "known coordinates",
    "stations": "stations",
    "relative": "pairs",
    "setups": "stations",
    "joint": "vectors",
}
"""What is in the lists of a record."""
TABLES = {"known": "constraints", "by-station": "setups", "vectors": "joint"}
"""Lists of the tables that are not called like them."""


def part_of(record: AdjustmentRecord) -> tuple[AdjustmentRecord, dict[int, int]]:
    """What a page shows, as records; and the places there of the observations that it has."""
    places = _worst_observations(record)
    observations = _held(record.observations, places)
    known, setups, joint = record.constraints, record.setups or (), record.joint
    part = structs.replace(
        record,
        observations=observations,
        points=_held(record.points, _worst_points(record, observations)),
        constraints=_held(known, _worst(np.abs(known.numbers("normalised_residual")))),
        stations=_held(record.stations, np.arange(len(record.stations))[:MOST]),
        relative=record.relative
        and _held(record.relative, _worst(record.relative.numbers("ellipse.semi_major"))),
        setups=record.setups and tuple(setups[k] for k in _worst(_sizes([row.largest for row in setups]))),
        joint=tuple(joint[k] for k in _worst(_sizes([row.statistic / row.critical for row in joint]))),
    )
    return part, {row: k for k, row in enumerate(places.tolist())}


def _held(rows: Rows[Kind], places: IntArray) -> Rows[Kind]:
    """Some rows as records: tables ask them again and again."""
    found = Rows(rows.kind, rows.take(places.tolist()))
    found.whole = rows.whole
    return found


def _worst(sizes: FloatArray) -> IntArray:
    """The rows with the largest of some sizes, in their own order."""
    order = np.argsort(-np.nan_to_num(sizes), kind="stable")[:MOST]
    return np.sort(order)


def _sizes(values: Sequence[float | None]) -> FloatArray:
    return np.array(values, np.float64)


def _worst_observations(record: AdjustmentRecord) -> IntArray:
    """The accused, the worst, and those that the others hardly control."""
    found = record.observations
    w = found.numbers("standardised_residual")
    sizes = np.nan_to_num(np.abs(np.where(np.isnan(w), found.numbers("normalised_residual"), w)))
    sizes[~found.truths("active")] = 0.0
    sizes[[place.row for item in record.gross_errors for place in item.observations]] = np.inf
    if len(found) <= MOST:
        return np.arange(len(found))
    poor = np.flatnonzero(found.numbers("redundancy") < POOR)[: MOST // 2]
    order = np.argsort(-sizes, kind="stable")[: MOST - len(poor)]
    return np.unique(np.concatenate([poor, order]))


def _worst_points(record: AdjustmentRecord, observations: Rows[ObservationRecord]) -> IntArray:
    """The points known worst, and the ends of the observations that are shown."""
    if len(record.points) <= MOST:
        return np.arange(len(record.points))
    order = np.argsort(-np.nan_to_num(np.array(spreads(record.points))), kind="stable")
    ends = observations.distinct("from") | observations.distinct("to")
    ends |= dict.fromkeys((point.name for item in record.gross_errors for point in item.points), 1)
    named = np.array([name in ends for name in record.points.values("name")])
    kept = dict.fromkeys([*order[: MOST // 2].tolist(), *np.flatnonzero(named).tolist(), *order.tolist()])
    return np.sort(np.array(list(kept)[:MOST]))


def not_shown(record: AdjustmentRecord, part: AdjustmentRecord) -> dict[str, tuple[int, int]]:
    """How many rows of how many the part has, by the name of the list, where it has not all."""
    counts = {name: (len(getattr(part, name) or ()), len(getattr(record, name) or ())) for name in NOUNS}
    return {name: pair for name, pair in counts.items() if pair[0] < pair[1]}


def told(table: Plain, counts: Mapping[str, tuple[int, int]]) -> Plain:
    """The table, which says how many rows of how many it has."""
    name = TABLES.get(str(table["id"]), str(table["id"]))
    if name not in counts:
        return table
    shown, whole = counts[name]
    some = f"The worst and the weakest {shown} of {whole} {NOUNS[name]}; the result file has all. "
    return table | {"about": some + table.get("about", "")}


def density(points: Rows[PointRecord], to_map: Similarity) -> Plain | None:
    """How many points there are in each cell of a grid over the plan: column, row and count of each."""
    axes = ("crs_x", "crs_y") if to_map.is_map else ("x", "y")
    xy = np.column_stack([points.numbers(axis) for axis in axes])
    xy = xy[np.isfinite(xy).all(axis=1)]
    if not len(xy):
        return None
    corner = xy.min(axis=0)
    step = float((xy.max(axis=0) - corner).max()) / CELLS or 1.0
    cells, counts = np.unique(((xy - corner) / step).astype(np.int64), axis=0, return_counts=True)
    return {"corner": corner.tolist(), "step": step, "cells": np.column_stack([cells, counts]).tolist()}
