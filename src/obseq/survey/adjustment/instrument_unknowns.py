"""Unknowns of instruments and days, asked for by the user: one of each for every instrument that is named.

Observations of no named instrument are those of one instrument in each of their files.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

import numpy as np

from obseq.arrays import BoolArray
from obseq.errors import InputError
from obseq.survey.kinds.kind import ObservationKind
from obseq.survey.kinds.registry import UNKNOWNS, WITH_UNKNOWNS, codes_with
from obseq.survey.model import FieldBook, Group, GroupKind, Orientation

SCALED = codes_with("frame-scale")
"""Of components in the axes of a station, by code, the code of those with a scale."""
SCALED_IN_FRAMES = codes_with("scale")
"""The same of distances, which are polar coordinates in a frame."""


def estimating(book: FieldBook, what: Collection[str]) -> FieldBook:
    """The observations, with unknowns of each of their instruments, those that files name; else of each file.

    Args:
        book: The observations.
        what: Some of "constant", "scale" (of distances: true = read (1 + scale) + constant),
            "refraction" (coefficient of the zenith angles of plumb instruments), "frame-scale" (of each
            set-up or sub-frame with components dx, dy, dz or polar coordinates: true = read (1 + scale)).

    Raises:
        InputError: A name is unknown, or there is no observation to estimate it from.
    """
    unknown = [name for name in what if name not in UNKNOWNS]
    if unknown:
        raise InputError(f"--estimate {unknown[0]}: unknown; there are {', '.join(UNKNOWNS)}")
    rows, wanted = book.observations, frozenset(what)
    alone = ~book.in_groups(GroupKind.UNKNOWNS)
    for cluster in book.clusters:
        alone[cluster.rows] = False
    scaled = _with_scales(book, alone) if "frame-scale" in wanted else book
    alone &= scaled.observations.types == rows.types
    free = np.isin(book.stations.orientations, (Orientation.BASC.value, Orientation.CAM.value))
    plumb = np.append(~free, np.False_)[rows.stations]
    for kinds in _of_instruments(wanted - {"frame-scale"}).values():
        chosen = alone & np.isin(rows.types, list(kinds))
        is_read = any(kind.needs_station for kind in kinds.values())
        scaled = _grouped(scaled, chosen & plumb if is_read else chosen, kinds)
    return scaled


def _of_instruments(wanted: frozenset[str]) -> dict[frozenset[str], dict[int, ObservationKind]]:
    """What observations are, by their code, with the wanted unknowns that they can have; by these.

    Slope and horizontal distances of one instrument share them.
    """
    offered: dict[int, frozenset[str]] = {}
    for code, unknowns in WITH_UNKNOWNS:
        offered[code] = offered.get(code, frozenset()) | unknowns
    found: dict[frozenset[str], dict[int, ObservationKind]] = {}
    for code, unknowns in offered.items():
        if asked := unknowns & wanted:
            found.setdefault(asked, {})[code] = WITH_UNKNOWNS[code, asked]
    return found


def _with_scales(book: FieldBook, alone: BoolArray) -> FieldBook:
    """The components in the axes of stations, and the distances of polar frames, with a scale of each."""
    rows, names = book.observations, book.point_names
    grid = np.append(book.stations.orientations == Orientation.GRID.value, np.True_)[rows.stations]
    chosen = alone & ~grid & np.isin(rows.types, list(SCALED))
    polar = alone & book.in_groups(GroupKind.FRAME) & np.isin(rows.types, list(SCALED_IN_FRAMES))
    if not ((chosen | polar) & rows.active).any():
        raise InputError(
            "--estimate frame-scale: there is no active observation dx, dy or dz, nor a distance, of a frame"
        )
    stations, frames = np.unique(rows.stations[chosen]), np.unique(rows.groups[polar])
    origins = book.stations.origins[stations].tolist()
    groups = [Group(f"frame {k + 1} at {names[row]}") for k, row in enumerate(origins)]
    types, numbers = rows.types.copy(), rows.groups.copy()
    types[chosen] = [SCALED[code] for code in rows.types[chosen].tolist()]
    types[polar] = [SCALED_IN_FRAMES[code] for code in rows.types[polar].tolist()]
    numbers[chosen] = len(book.groups) + np.searchsorted(stations, rows.stations[chosen])
    numbers[polar] = len(book.groups) + len(groups) + np.searchsorted(frames, rows.groups[polar])
    groups += [Group(book.groups[number].name) for number in frames.tolist()]
    return replace(
        book, observations=replace(rows, types=types, groups=numbers), groups=(*book.groups, *groups)
    )


def _grouped(book: FieldBook, chosen: BoolArray, kinds: dict[int, ObservationKind]) -> FieldBook:
    """Some observations as other kinds, by their codes; those of each instrument in a group."""
    rows, before = book.observations, len(book.groups)
    if not (chosen & rows.active).any():
        words = " or ".join(kind.words for kind in kinds.values())
        raise InputError(f"--estimate: there is no active observation for a {words}")
    named = book.in_groups(GroupKind.INSTRUMENT)
    keys = np.where(named, rows.groups, before + rows.file_indices)
    wanted = np.flatnonzero(np.bincount(keys[chosen]))
    files = [book.files[key - before] for key in wanted.tolist() if key >= before]
    short = [Path(file).name for file in files]
    groups = [Group(book.groups[key].name) for key in wanted.tolist() if key < before]
    groups += [Group(name) for name in (files if len(set(short)) < len(short) else short)]
    types, numbers = rows.types.copy(), rows.groups.copy()
    for code, kind in kinds.items():
        types[chosen & (rows.types == code)] = kind.code
    numbers[chosen] = before + np.searchsorted(wanted, keys[chosen])
    return replace(
        book, observations=replace(rows, types=types, groups=numbers), groups=(*book.groups, *groups)
    )
