"""What observations may share: the scopes of causes."""

from __future__ import annotations

import numpy as np

from obseq.arrays import IntArray
from obseq.survey.causes.cause import Scope
from obseq.survey.causes.notes import Notes


def _setup(notes: Notes, label: int, rows: IntArray) -> str:
    origin = notes.book.point_names[notes.book.stations.origins[label]]
    return f"set-up {origin} ({notes.book.place(int(rows[0]))})"


def _sight(notes: Notes, _label: int, rows: IntArray) -> str:
    observations = notes.book.observations
    ends = observations.from_points[rows[0]], observations.to_points[rows[0]]
    origin, target = (notes.book.point_names[end] for end in ends)
    return f"{origin} -> {target} ({notes.book.place(int(rows[0]))})"


def _point(notes: Notes, label: int, _rows: IntArray) -> str:
    return notes.book.point_names[label]


def _origin(notes: Notes, rows: IntArray) -> int:
    return int(notes.book.observations.from_points[rows[0]])


def _target(notes: Notes, rows: IntArray) -> int:
    return int(notes.book.observations.to_points[rows[0]])


def _file(notes: Notes, rows: IntArray) -> str:
    return str(notes.book.files[notes.book.observations.file_indices[rows[0]]])


SETUP = Scope("setup", lambda notes: notes.setups, _setup, "a set-up")
SIGHT = Scope("sight", lambda notes: notes.sights, _sight, "a sight")
READING = Scope("reading", lambda notes: notes.readings, _sight, "a sight of one round")
VECTOR = Scope("vector", lambda notes: notes.vectors, _sight, "a vector")
FILE = Scope(
    "file",
    lambda notes: notes.book.observations.file_indices.astype(np.int64),
    lambda notes, label, _rows: notes.book.files[label],
    "a file",
)
INSTRUMENT = Scope(
    "instrument",
    lambda notes: notes.instruments,
    lambda notes, label, _rows: f"instrument {notes.book.groups[label].name}",
    "an instrument",
)
FROM = Scope(
    "from",
    lambda notes: notes.book.observations.from_points.astype(np.int64),
    lambda notes, label, rows: f"from {_point(notes, label, rows)}",
    "all from a point",
)
TO = Scope(
    "to",
    lambda notes: notes.book.observations.to_points.astype(np.int64),
    lambda notes, label, rows: f"to {_point(notes, label, rows)}",
    "all to a point",
)
FROM_IN_FILE = Scope(
    "from-in-file",
    lambda notes: notes.in_file(notes.book.observations.from_points.astype(np.int64)),
    lambda notes, _, rows: f"from {_point(notes, _origin(notes, rows), rows)} in {_file(notes, rows)}",
    "all from a point in a file",
)
TO_IN_FILE = Scope(
    "to-in-file",
    lambda notes: notes.in_file(notes.book.observations.to_points.astype(np.int64)),
    lambda notes, _, rows: f"to {_point(notes, _target(notes, rows), rows)} in {_file(notes, rows)}",
    "all to a point in a file",
)
ALL = Scope(
    "all",
    lambda notes: np.zeros(len(notes.book.observations), np.int64),
    lambda *_: "all",
    "the whole network",
)
