"""Which set-up, sight and round each observation is of."""

from types import SimpleNamespace

import numpy as np

from obseq.survey.causes.notes import Notes
from obseq.survey.kinds.registry import codes_where

CODES = {
    name: codes_where(lambda kind, name=name: kind.name == name)[0]
    for name in ("Hz", "Zen", "Dist", "DistHz", "DH")
}
NAMES = "ABCD"


def notes_of(*lines):
    """Lines of kind, station or -1, from, to, and file."""
    kinds, stations, origins, targets, files = zip(*lines, strict=True)
    stations = np.array(stations)
    rows = SimpleNamespace(
        types=np.array([CODES[kind] for kind in kinds]),
        stations=stations,
        from_points=np.array([NAMES.index(name) for name in origins]),
        to_points=np.array([NAMES.index(name) for name in targets]),
        file_indices=np.array(files),
    )

    class Rows(SimpleNamespace):
        def __len__(self):
            return len(lines)

    class Stations(SimpleNamespace):
        def __len__(self):
            return len(self.origins)

    first = [int(np.flatnonzero(stations == k)[0]) for k in range(stations.max(initial=-1) + 1)]
    book = SimpleNamespace(
        observations=Rows(**vars(rows)), stations=Stations(origins=rows.from_points[first]), point_names=NAMES
    )
    return Notes(SimpleNamespace(), book)


def test_lengths_among_directions_are_of_their_set_up_and_first_of_what_was_read_before():
    notes = notes_of(
        ("Dist", -1, "A", "B", 0),
        ("Hz", 0, "A", "B", 0),
        ("Zen", -1, "A", "B", 0),
        ("DistHz", -1, "A", "C", 0),
        ("Hz", 1, "A", "C", 0),
        ("DH", -1, "A", "D", 0),
        ("Dist", -1, "A", "D", 1),  # another file: of two set-ups nobody knows which
        ("Dist", -1, "B", "A", 0),  # nothing else is read there
        ("Hz", 2, "C", "A", 0),
        ("Dist", -1, "D", "A", 0),
        ("Dist", -1, "C", "B", 1),  # from a point of one set-up
    )
    assert notes.setups.tolist() == [0, 0, -1, 0, 1, 1, -1, -1, 2, -1, 2]


def test_without_set_ups_there_are_none():
    assert notes_of(("Dist", -1, "A", "B", 0), ("Dist", -1, "B", "A", 0)).setups.tolist() == [-1, -1]


def test_sights_are_of_a_set_up_to_a_target_and_rounds_count_what_is_read_again():
    notes = notes_of(
        ("Hz", 0, "A", "B", 0),
        ("Dist", -1, "A", "B", 0),
        ("Hz", 0, "A", "C", 0),
        ("Hz", 0, "A", "B", 0),
        ("Dist", -1, "A", "B", 0),
        ("Hz", 1, "C", "B", 0),
        ("Zen", -1, "D", "B", 0),
    )
    sights, readings = notes.sights, notes.readings
    assert sights[0] == sights[1] == sights[3] == sights[4] != sights[2]
    assert len({sights[0], sights[2], sights[5]}) == 3 and sights[6] == readings[6] == -1
    assert readings[0] == readings[1] and readings[3] == readings[4]
    assert len({readings[k] for k in (0, 2, 3, 5)}) == 4


def test_points_are_other_ones_in_each_file():
    notes = notes_of(*(("Dist", -1, a, b, file) for file in (0, 1) for a, b in ("AB", "BA", "AB")))
    own = notes.in_file(notes.book.observations.from_points)
    assert own[0] == own[2] != own[1] and len(set(own.tolist())) == 4 and own[3] == own[5] != own[0]


def test_kinds_are_what_they_are_of():
    notes = notes_of(*((kind, -1, "A", "B", 0) for kind in CODES))  # Hz, Zen, Dist, DistHz, DH
    for name, wanted in (
        ("is_direction", "Hz"),
        ("is_zenith", "Zen"),
        ("is_slope", "Dist"),
        ("is_length", "Dist DistHz"),
        ("is_rise", "DH"),
        ("is_levelled", "DH"),
        ("is_raised", "Zen Dist DH"),
        ("is_vector", ""),
        ("is_between", ""),
    ):
        assert [
            kind for kind, own in zip(CODES, getattr(notes, name), strict=True) if own
        ] == wanted.split(), name


def test_the_first_sight_of_all_is_one_and_kinds_of_sights_are_not_mixed_up():
    notes = notes_of(
        ("Hz", 0, "B", "A", 0),
        *((kind, -1, "B", target, 0) for target in "ACD" for kind in ("Dist", "DistHz", "DH")),
        ("Hz", 0, "B", "A", 0),
    )
    assert notes.sights[0] == 0
    assert len(set(notes.readings[:4].tolist())) == 1 and notes.readings[0] >= 0
    assert notes.readings[10] not in notes.readings[:10] and len(set(notes.readings.tolist())) == 4
