"""Unknowns of instruments and days, asked for by the user: one of each for every file of observations."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.survey.kinds.components import DX, DX_SCALE, DY, DY_SCALE, DZ, DZ_SCALE
from obseq.survey.kinds.directions import ZEN
from obseq.survey.kinds.instruments import DIST_CONSTANT, DIST_CONSTANT_SCALE, DIST_SCALE, ZEN_REFRACTION
from obseq.survey.kinds.lengths import DIST
from obseq.survey.model import Group, Orientation

if TYPE_CHECKING:
    from collections.abc import Collection

    from obseq.arrays import BoolArray
    from obseq.survey.kinds.kind import ObservationKind
    from obseq.survey.model import FieldBook

UNKNOWNS = ("constant", "scale", "refraction", "frame-scale")
"""What can be estimated: additive constant (m) and scale of distances, refraction, scale of frames."""
SCALED = {DX.code: DX_SCALE.code, DY.code: DY_SCALE.code, DZ.code: DZ_SCALE.code}
"""Of components in the axes of a station, the code of those with a scale."""
OF_DISTANCES = {
    frozenset({"constant"}): DIST_CONSTANT,
    frozenset({"scale"}): DIST_SCALE,
    frozenset({"constant", "scale"}): DIST_CONSTANT_SCALE,
}


def estimating(book: FieldBook, what: Collection[str]) -> FieldBook:
    """The observations, with unknowns of each of their files.

    Args:
        book: The observations.
        what: Some of "constant", "scale" (of slope distances: true = read (1 + scale) + constant),
            "refraction" (coefficient of the zenith angles of plumb instruments), "frame-scale" (of each
            set-up or sub-frame with components dx, dy, dz: true = read (1 + scale)).

    Raises:
        InputError: A name is unknown, or there is no observation to estimate it from.
    """
    unknown = [name for name in what if name not in UNKNOWNS]
    if unknown:
        raise InputError(f"--estimate {unknown[0]}: unknown; there are {', '.join(UNKNOWNS)}")
    rows, wanted = book.observations, frozenset(what)
    alone = rows.groups < 0
    for cluster in book.clusters:
        alone[cluster.rows] = False
    distances = OF_DISTANCES.get(wanted - {"refraction", "frame-scale"})
    if distances is not None:
        book = _grouped(book, alone & (rows.types == DIST.code), distances)
    if "refraction" in wanted:
        plumb = np.append(book.stations.orientations != Orientation.BASC, np.False_)[rows.stations]
        book = _grouped(book, alone & plumb & (rows.types == ZEN.code), ZEN_REFRACTION)
    return _with_scales(book, alone) if "frame-scale" in wanted else book


def _with_scales(book: FieldBook, alone: BoolArray) -> FieldBook:
    """The components in the axes of stations, with a scale of each station."""
    rows, names = book.observations, book.point_names
    grid = np.append(book.stations.orientations == Orientation.GRID, np.True_)[rows.stations]
    chosen = alone & ~grid & np.isin(rows.types, list(SCALED))
    if not (chosen & rows.active).any():
        raise InputError("--estimate frame-scale: there is no active observation dx, dy or dz of a frame")
    stations = np.unique(rows.stations[chosen])
    origins = book.stations.origins[stations].tolist()
    groups = tuple(Group(f"frame {k + 1} at {names[row]}") for k, row in enumerate(origins))
    types, numbers = rows.types.copy(), rows.groups.copy()
    types[chosen] = [SCALED[code] for code in rows.types[chosen].tolist()]
    numbers[chosen] = len(book.groups) + np.searchsorted(stations, rows.stations[chosen])
    return replace(
        book, observations=replace(rows, types=types, groups=numbers), groups=(*book.groups, *groups)
    )


def _grouped(book: FieldBook, chosen: BoolArray, kind: ObservationKind) -> FieldBook:
    """Some observations as another kind, those of each file in a group."""
    rows = book.observations
    if not (chosen & rows.active).any():
        raise InputError(f"--estimate: there is no active observation for a {kind.words}")
    files = np.unique(rows.file_indices[chosen])
    names = [Path(book.files[number]).name for number in files.tolist()]
    whole = len(set(names)) < len(names)
    groups = tuple(Group(book.files[number] if whole else Path(book.files[number]).name) for number in files)
    types, numbers = rows.types.copy(), rows.groups.copy()
    types[chosen] = kind.code
    numbers[chosen] = len(book.groups) + np.searchsorted(files, rows.file_indices[chosen])
    return replace(
        book, observations=replace(rows, types=types, groups=numbers), groups=(*book.groups, *groups)
    )
