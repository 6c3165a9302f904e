"""What was planted, what a result accuses, and the verdict of one on the other."""

from __future__ import annotations

from dataclasses import dataclass

Line = tuple[str, int]

SMALL = 3
"""Places that a set may hold: more of them help nobody."""
RIGHT = "exact", "in a set"
ACCUSING = "false alarm", "and more", "wrong"
"""Verdicts in which something innocent was accused."""


@dataclass(frozen=True)
class Place:
    """Something that a result accuses, as the record names it.

    Attributes:
        code: of the hypothesis.
        lines: file and line of its observations.
        points: known points and their coordinates, as "P1 x"; "P1" where the record does not say which.
        images: names of images.
        causes: codes of the slips that explain it.
    """

    code: str = ""
    lines: frozenset[Line] = frozenset()
    points: frozenset[str] = frozenset()
    images: frozenset[str] = frozenset()
    causes: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Found:
    """What a result says.

    Attributes:
        status: of the diagnosis: "accepted", "explained", "unexplained", "undecided".
        accused: sets of places; the first of each is told first, one of each is wrong.
    """

    status: str
    accused: tuple[tuple[Place, ...], ...] = ()


@dataclass(frozen=True)
class Fault:
    """One mistake that was planted.

    Attributes:
        lines: file and line of the observations that it spoils.
        points: a known coordinate that it spoils, as "P1 x".
        images: images that it concerns.
        codes: codes of hypotheses, where it has neither lines nor points nor images.
        alike: lines of what is the same mistake told in another way.
        causes: codes of slips, or of hypotheses, any of which says why.
    """

    lines: frozenset[Line] = frozenset()
    points: frozenset[str] = frozenset()
    images: frozenset[str] = frozenset()
    codes: frozenset[str] = frozenset()
    alike: tuple[frozenset[Line], ...] = ()
    causes: frozenset[str] = frozenset()

    def is_named_by(self, place: Place) -> bool:
        """Whether a place is where this mistake is."""
        if self.lines:
            return place.lines in (self.lines, *self.alike)
        if self.points:
            return bool(place.points) and all(_is_of(point, self.points) for point in place.points)
        return place.images == self.images if self.images else place.code in self.codes

    def concerns(self, place: Place) -> bool:
        """Whether a place accuses nothing but what this mistake spoils, if only a part of it."""
        if self.is_named_by(place):
            return True
        spoiled = self.lines.union(*self.alike)
        return (bool(place.lines) and place.lines <= spoiled) or (
            bool(place.images) and place.images < self.images
        )


def _is_of(point: str, faulty: frozenset[str]) -> bool:
    """Whether a coordinate, or a point without one, is among those that are faulty."""
    return point in faulty or point in {name.rpartition(" ")[0] for name in faulty}


def verdict_of(found: Found, faults: tuple[Fault, ...]) -> str:
    """How right what a result accuses is, in one word of the table."""
    accused = found.accused
    if not faults:
        return "false alarm" if accused else "quiet"
    if not accused:
        return "undecided" if found.status in ("undecided", "unexplained") else "missed"
    held = [any(fault.is_named_by(place) for one in accused for place in one) for fault in faults]
    if any(not any(fault.concerns(place) for fault in faults for place in one) for one in accused):
        return "and more" if all(held) else "wrong"
    if not all(held) or len(accused) != len(faults):
        return "some"
    if all(any(fault.is_named_by(one[0]) for one in accused) for fault in faults):
        return "exact"
    return "in a set" if max(len(one) for one in accused) <= SMALL else "in a large set"


def has_cause(found: Found, faults: tuple[Fault, ...]) -> bool:
    """Whether each mistake is named first in its set, with its cause."""
    told = [one[0] for one in found.accused]
    return all(
        any(fault.is_named_by(place) and fault.causes & {place.code, *place.causes} for place in told)
        for fault in faults
    )
