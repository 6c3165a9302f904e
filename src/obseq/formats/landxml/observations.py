"""Observations of LandXML surveys, by set-ups of the instrument."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple, Protocol

from obseq.formats.fieldbooks.book import Book, named
from obseq.formats.landxml.units import Units
from obseq.reading.angles import FULL_TURN, HALF_TURN
from obseq.reading.xml import Element
from obseq.survey.kinds.directions import AZIM, HZ, ZEN
from obseq.survey.kinds.kind import ObservationKind
from obseq.survey.kinds.lengths import DH, DIST, DIST_HZ

REFUSED = {
    "GPSVector": "it has no covariance; give GNSS vectors in a DNA or DynaML file",
    "GPSPosition": "it has no covariance; give GNSS positions in a DNA or DynaML file",
    "LaserSetup": "scans are not observations of a network",
}
KNOWN = (
    *("setupID", "targetSetupID", "setID", "purpose", "targetHeight", "horizAngle", "slopeDistance"),
    *("zenithAngle", "horizDistance", "vertDistance", "azimuth", "unused", "directFace", "timeStamp"),
    *("coordGeomRefs", "oID", "desc", "date", "time", "equipmentUsed", "MSLDistance", "spherDistance"),
)
KNOWN_OF_REDUCED = (
    *(*KNOWN, "name", "distanceType", "azimuthType", "azimuthAccuracy", "distanceAccuracy", "angleAccuracy"),
    *("targetSetup2ID", "adoptedAzimuthSurvey", "adoptedDistanceSurvey", "azimuthAdoptionFactor"),
    *("distanceAdoptionFactor", "azimuthAccClass", "distanceAccClass", "distanceClass", "azimuthClass"),
)
RAW, REDUCED = "RawObservation", "ReducedObservation"
LEFT_OUT = {
    REDUCED: "<ReducedObservation>, reduced already, from raw ones or not (--ignore reductions takes them as "
    "measured),",
    "Backsight": "<Backsight>, which say how a set-up was oriented,",
}
NOT_MEASURED = ("computed", "derived", "calculated")
"""Types of distances and azimuths that come from other observations: they have no influence."""
LENGTHS: tuple[tuple[str, ObservationKind], ...] = (
    ("slopeDistance", DIST),
    ("horizDistance", DIST_HZ),
    ("vertDistance", DH),
)
UNREAD = ("MSLDistance", "spherDistance")


class Places(Protocol):
    """What takes coordinates that stand beside observations."""

    def take(self, element: Element, name: str) -> None:
        """Takes the coordinates in the text of an element."""


class _SetUp(NamedTuple):
    """A set-up: name of its point, height of the instrument above it (m), name of the instrument."""

    point: str
    height: float
    instrument: str


class SurveyReader:
    """Reads surveys into a book."""

    def __init__(self, book: Book, units: Units, places: Places, *, takes_reduced: bool) -> None:
        self._book, self._units, self._places = book, units, places
        self._taken = (RAW, REDUCED) if takes_reduced else (RAW,)
        self._described: dict[str, str] = {}
        self._at = ""

    def read(self, survey: Element) -> None:
        """Takes one survey."""
        for element in survey.children:
            if element.name in REFUSED:
                reason = REFUSED[element.name]
                raise element.error(f"<{element.name}> is an observation which obseq cannot adjust: {reason}")
        instruments = {
            details.wanted("id"): " ".join(details.get(part) or "" for part in ("model", "serialNumber"))
            for equipment in survey.named("Equipment")
            for details in equipment.named("InstrumentDetails")
        }
        set_ups = {e.wanted("id"): self._set_up(e, instruments) for e in survey.named("InstrumentSetup")}
        targets = {e.wanted("id"): self._length(e, "targetHeight") for e in survey.named("TargetSetup")}
        for group in survey.named("ObservationGroup"):
            self._group(group, set_ups, targets)
        for set_up in survey.named("InstrumentSetup"):
            self._group(set_up, set_ups, targets, set_up.wanted("id"))

    def _set_up(self, element: Element, instruments: Mapping[str, str]) -> _SetUp:
        place = element.first("InstrumentPoint")
        name = self._name(place) if place is not None else None
        name = name or element.get("stationName")
        if name is None:
            raise element.error("<InstrumentSetup> names no point: give a stationName or a pntRef")
        if place is not None:
            self._places.take(place, name)
        instrument = instruments.get(element.get("instrumentDetailsID") or "", "")
        return _SetUp(name, self._length(element, "instrumentHeight") or 0.0, instrument)

    @staticmethod
    def _name(place: Element) -> str | None:
        return place.get("pntRef") or place.get("name")

    def _length(self, element: Element, name: str) -> float | None:
        value = element.number(name)
        return None if value is None else value * self._units.metres

    def _group(
        self,
        group: Element,
        set_ups: Mapping[str, _SetUp],
        targets: Mapping[str, float | None],
        own: str | None = None,
    ) -> None:
        for element in group.children:
            if element.name in self._taken:
                number = element.get("setupID") or group.get("setupID") or own
                if number is None or number not in set_ups:
                    raise element.error(
                        f"its set-up {number or '(none)'} is no InstrumentSetup of the survey"
                    )
                set_up, target = set_ups[number], self._target(element, group, set_ups)
                if target == set_up.point:
                    raise element.error(f"{target} is observed from itself; correct one of the names")
                lift = self._length(element, "targetHeight")
                if lift is None:
                    lift = targets.get(element.get("targetSetupID") or group.get("targetSetupID") or "")
                self._stand(element.line - 1, number, set_up)
                self._book.target_height = lift or 0.0
                self._observation(element, named(target))
            elif element.name in LEFT_OUT:
                self._book.leave_out(element.line - 1, LEFT_OUT[element.name])

    def _stand(self, index: int, number: str, set_up: _SetUp) -> None:
        """The sights that follow are of a set-up."""
        if number != self._at:
            self._at = number
            self._book.use(set_up.instrument)
            self._book.set_up(index, named(set_up.point), set_up.height, number)

    def _target(self, element: Element, group: Element, set_ups: Mapping[str, _SetUp]) -> str:
        """The name of the target: its point, or that of the set-up on it, or what describes its place."""
        place = element.first("TargetPoint")
        seen = set_ups.get(element.get("targetSetupID") or group.get("targetSetupID") or "")
        target = self._name(place) if place is not None else seen.point if seen is not None else None
        described = place.get("desc") if place is not None and target is None else None
        if place is not None and described is not None:
            at = " ".join(place.text.split())
            if self._described.setdefault(described, at) != at:
                raise place.error(f"places that differ are described as {described!r}: give them names")
        target = target or described
        if target is None:
            raise element.error(
                f"<{element.name}> has no TargetPoint with a pntRef or a name, nor a set-up as target"
            )
        if place is not None:
            self._places.take(place, target)
        return target

    def _observation(self, element: Element, target: str) -> None:
        known = KNOWN_OF_REDUCED if element.name == REDUCED else KNOWN
        element.allow(known, ("TargetPoint", "OffsetVals", "Feature", "FieldNote"))
        self._refuse_others(element)
        is_used = element.get("unused") != "true" and element.get("purpose") != "check"
        for kind, value in self._values(element):
            own = element.get("azimuthType" if kind is AZIM else "distanceType")
            is_active = is_used and own not in NOT_MEASURED
            self._book.observe(element.line - 1, target, kind, value, is_active=is_active)

    @staticmethod
    def _refuse_others(element: Element) -> None:
        given = [name for name in UNREAD if element.get(name) is not None]
        if given or element.first("OffsetVals") is not None:
            what = given[0] if given else "OffsetVals"
            raise element.error(
                f"{what} is an observation which obseq cannot adjust: reduce it to the points"
            )

    def _values(self, element: Element) -> Iterator[tuple[ObservationKind, float]]:
        """Kind and value of what one element holds.

        A reading of the second face is left as it is where its zenith angle says so, which is how other field
        books have it; else its direction is turned.
        """
        zenith = self._units.angle(element, "zenithAngle", self._units.angular)
        turns = element.get("directFace") == "false" and not (zenith or 0.0) % FULL_TURN > HALF_TURN
        horizontal = self._units.angle(element, "horizAngle", self._units.angular)
        if horizontal is not None:
            yield HZ, (horizontal + math.pi * turns) % FULL_TURN
        azimuth = self._units.angle(element, "azimuth", self._units.direction)
        if azimuth is not None:
            yield AZIM, azimuth % FULL_TURN
        if zenith is not None:
            yield ZEN, zenith % FULL_TURN
        for name, kind in LENGTHS:
            length = self._length(element, name)
            if length is not None:
                if kind is not DH and length <= 0.0:
                    raise element.error(f"{name} is {length:g}; a distance is above zero")
                yield kind, length
