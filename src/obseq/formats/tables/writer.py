"""Observations as a table with named columns (.csv), which `table_reader` reads."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from obseq.errors import InputError
from obseq.formats.tables.reader import BARYCENTRES, TYPES
from obseq.reading.text import check_writable
from obseq.spreadsheets import csv_text
from obseq.survey.kinds.registry import BY_CODE
from obseq.survey.model import FieldBook, GroupKind, Orientation

HEADER = (
    *("type", "from", "to", "backsight", "value", "sigma", "unit", "set", "orientation", "instrument"),
    *("relative_sigma", "from_height", "to_height", "weights", "cluster", "covariances", "active"),
)


def table_text(book: FieldBook) -> str:
    """Observations as a table with a header, in metres and radians: numbers come back as they are.

    Raises:
        InputError: A table has no row for an observation.
    """
    codes = [kind.code for kind in TYPES.values()]
    without = np.flatnonzero(~np.isin(book.observations.types, codes))
    if without.size:
        words = BY_CODE[int(book.observations.types[without[0]])].words
        raise InputError(
            f"{book.label(int(without[0]))}: a table of observations has no row for this ({words})"
        )
    return csv_text([HEADER, *_rows(book)])


def _rows(book: FieldBook) -> Iterator[tuple[str, ...]]:
    """The cells of each observation."""
    rows, named, clustered = book.observations, book.in_groups(GroupKind.INSTRUMENT), _clustered(book)
    for row, code in enumerate(rows.types.tolist()):
        kind, station = BY_CODE[code], int(rows.stations[row])
        names = [book.point_names[end] for end in (rows.from_points[row], rows.to_points[row])]
        third, weights = rows.backsights[row], ""
        if kind in BARYCENTRES:
            names[1], weights = _members(book, row), _numbers(book.groups[rows.groups[row]].weights)
        orientation = Orientation(book.stations.orientations[station]).name if station >= 0 else ""
        cluster, sigma, covariances = clustered.get(row, ("", float(rows.sigmas[row]), ""))
        numbers = (rows.relative_sigmas[row], rows.from_heights[row], rows.to_heights[row])
        yield (
            kind.name,
            *names,
            book.point_names[third] if third >= 0 else "",
            repr(float(rows.values[row])),
            repr(sigma),
            kind.unit,
            str(station) if station >= 0 else "",
            orientation,
            book.groups[rows.groups[row]].name if named[row] else "",
            *(repr(float(number)) if number else "" for number in numbers),
            weights,
            cluster,
            covariances,
            "" if rows.active[row] else "0",
        )


def _members(book: FieldBook, row: int) -> str:
    """The names of the members of a barycentre, with blanks between them."""
    names = [book.point_names[k] for k in book.groups[book.observations.groups[row]].members]
    for name in names:
        check_writable(name)
    return " ".join(names)


def _clustered(book: FieldBook) -> dict[int, tuple[str, float, str]]:
    """The cells of correlated observations: their cluster, sigma, covariances with those before."""
    return {
        row: (str(number), float(np.sqrt(cluster.covariance[k, k])), _numbers(cluster.covariance[k, :k]))
        for number, cluster in enumerate(book.clusters, 1)
        for k, row in enumerate(cluster.rows.tolist())
    }


def _numbers(values: Iterable[float]) -> str:
    """Numbers with blanks between them."""
    return " ".join(repr(float(value)) for value in values)
