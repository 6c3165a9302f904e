"""Unknowns of instruments and days, asked for by the user: one of each for every file of observations."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.survey.kinds.directions import ZEN
from obseq.survey.kinds.instruments import DIST_CONSTANT, DIST_CONSTANT_SCALE, DIST_SCALE, ZEN_REFRACTION
from obseq.survey.kinds.lengths import DIST
from obseq.survey.model import Group, Orientation

if TYPE_CHECKING:
    from collections.abc import Collection

    from obseq.arrays import BoolArray
    from obseq.survey.kinds.kind import ObservationKind
    from obseq.survey.model import FieldBook

UNKNOWNS = ("constant", "scale", "refraction")
"""What can be estimated: additive constant (m) and scale of distances, refraction coefficient."""
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
            "refraction" (coefficient of the zenith angles of plumb instruments).

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
    distances = OF_DISTANCES.get(wanted - {"refraction"})
    if distances is not None:
        book = _grouped(book, alone & (rows.types == DIST.code), distances)
    if "refraction" in wanted:
        plumb = np.append(book.stations.orientations != Orientation.BASC, np.False_)[rows.stations]
        book = _grouped(book, alone & plumb & (rows.types == ZEN.code), ZEN_REFRACTION)
    return book


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
