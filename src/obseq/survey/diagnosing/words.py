"""What a diagnosis says in words: the only place of prose."""

from __future__ import annotations

from typing import TYPE_CHECKING

from obseq.printable import listed
from obseq.records.diagnosis import AccusedRecord, KnownRecord, PlaceRecord, SlipRecord, SuspectRecord
from obseq.survey.causes.catalogue import KNOWN, KNOWN_PLAN
from obseq.survey.equations.known_coordinates import COMPONENTS
from obseq.survey.kinds.registry import BY_CODE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.diagnosis.verdict import Accusation
    from obseq.report.tables.units import Units
    from obseq.survey.causes.catalogue import Catalogue, Named
    from obseq.survey.causes.cause import Rewritten
    from obseq.survey.causes.notes import Notes

_MOST = 3
"""Alternatives that one sentence names."""
_SMALL = {"rad": 0.0016, "m": 0.1}
"""Errors below it (a tenth of a gon, a decimetre) are told in the small unit."""


def accused(one: Accusation, catalogue: Catalogue, units: Units) -> AccusedRecord:
    """One error as the result holds it.

    Args:
        one: The accusation.
        catalogue: What may be wrong.
        units: In which sizes are told.
    """
    named = catalogue.named(one.change.index)
    suspect = suspected(named, catalogue)
    others = tuple(suspected(catalogue.named(other.change.index), catalogue) for other in one.others)
    unit = unit_of(named, catalogue)
    sizes = tuple(map(float, one.change.size))
    slips = tuple(SlipRecord(slip.code, slip.text) for slip in one.slips)
    text = "wrong" if unit is None else f"wrong by {told(units, unit, sizes, parts_of(named))}"
    text += f": {slips[0].text}" if slips else ""
    if others:
        names = listed([other.what for other in others], _MOST)
        text += f"; or {names}: nothing tells {'these' if len(others) > 1 else 'them'} apart"
    return AccusedRecord(
        suspect.code,
        suspect.what,
        suspect.observations,
        suspect.points,
        text=text,
        size=sizes,
        sigma=tuple(map(float, one.change.sigma)),
        unit=unit or "",
        test=one.test,
        limit=one.limit,
        others=others,
        slips=slips,
    )


def rewriting_record(one: Rewritten, others: Sequence[Rewritten], notes: Notes) -> AccusedRecord:
    """A mistake of many values as the result holds it, with those that explain as much."""
    slips = (SlipRecord(one.slip, one.text),) if one.slip else ()
    same = tuple(_of_rewriting(other, notes) for other in others)
    names = listed([f"{other.what}: {other.text}" for other in others], _MOST)
    text = f"{one.text}; or {names}: nothing tells them apart" if others else one.text
    own = _of_rewriting(one, notes)
    return AccusedRecord(
        own.code, own.what, own.observations, own.points, text=text, others=same, slips=slips
    )


def _of_rewriting(one: Rewritten, notes: Notes) -> SuspectRecord:
    known = tuple(KnownRecord(notes.points.names[p], c) for p in one.known.tolist() for c in COMPONENTS)
    return SuspectRecord(one.code, one.what, _places(notes, one.rows.tolist()), known)


def _places(notes: Notes, rows: Sequence[int]) -> tuple[PlaceRecord, ...]:
    """Observations by file and line."""
    book, of = notes.book, notes.book.observations
    return tuple(PlaceRecord(book.files[of.file_indices[row]], int(of.lines[row]), row) for row in rows)


def suspected(named: Named, catalogue: Catalogue) -> SuspectRecord:
    """What a hypothesis is, as the result holds it."""
    notes = catalogue.notes
    places = _places(notes, named.rows.tolist())
    points = tuple(KnownRecord(notes.points.names[point], COMPONENTS[part]) for point, part in named.known)
    return SuspectRecord(named.code, what(named, catalogue), places, points)


def what(named: Named, catalogue: Catalogue) -> str:
    """What a hypothesis is called."""
    notes = catalogue.notes
    if named.of_known is not None:
        return f"{named.of_known.name}, {len({point for point, _ in named.known})} points"
    if named.known:
        point = named.known[0][0]
        which = COMPONENTS[named.known[0][1]] if named.code == KNOWN else "plan"
        return f"known {which} of {notes.points.names[point]} ({notes.points.place(point)})"
    if named.cause is None or named.groups is None:
        return notes.book.label(int(named.rows[0]))
    label = int(named.groups.labels[named.number])
    where = named.groups.scope.words(notes, label, named.rows)
    return f"{named.cause.name}, {where}, {len(named.rows)} observations"


def unit_of(named: Named, catalogue: Catalogue) -> str | None:
    """Unit of its sizes; None where they are not told."""
    if named.of_known is not None:
        return named.of_known.unit
    if named.known:
        return "m"
    if named.cause is None:
        return BY_CODE[int(catalogue.notes.book.observations.types[named.rows[0]])].unit
    return None if named.cause.effect is None else named.cause.unit


def parts_of(named: Named) -> tuple[str, ...]:
    """What its sizes are called; empty for a single one."""
    if named.code == KNOWN_PLAN:
        return ("in x", "in y")
    cause = named.of_known or named.cause
    return cause.parts if cause is not None else ()


def told(units: Units, unit: str, sizes: Sequence[float], parts: Sequence[str] = ()) -> str:
    """How large an error is, in words."""
    if parts:
        each = (f"{_one(units, unit, size)} {part}" for size, part in zip(sizes, parts, strict=True))
        return ", ".join(each)
    return _one(units, unit, sizes[0])


def _one(units: Units, unit: str, size: float) -> str:
    if not unit:
        return f"{1e6 * size:.1f} ppm"
    return units.small(unit, size) if abs(size) < _SMALL[unit] else units.observed(unit, size)
