"""Raw observations of LandXML surveys, by set-ups of the instrument."""

from __future__ import annotations

import math
from dataclasses import field
from typing import TYPE_CHECKING, Protocol

from obseq.dataclass import dataclass
from obseq.formats.columns import Columns, Measure
from obseq.formats.default_sigmas import lacking
from obseq.survey.kinds.directions import AZIM, HZ, ZEN
from obseq.survey.kinds.lengths import DH, DIST, DIST_HZ
from obseq.survey.kinds.registry import codes

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from obseq.formats.landxml.units import Units
    from obseq.reading.xml import Element
    from obseq.survey.kinds.kind import ObservationKind

FULL_TURN = 2.0 * math.pi
HEIGHTS = codes(DIST, ZEN, DH)
"""Kinds that need heights."""
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
REDUCED = "ReducedObservation"
NOT_MEASURED = ("computed", "derived", "calculated")
"""Types of distances and azimuths that come from other observations: they have no influence."""
LENGTHS: tuple[tuple[str, ObservationKind, str], ...] = (
    ("slopeDistance", DIST, "distance"),
    ("horizDistance", DIST_HZ, "distance"),
    ("vertDistance", DH, "height"),
)
UNREAD = ("MSLDistance", "spherDistance")


class Places(Protocol):
    """What takes coordinates that stand beside observations."""

    def take(self, element: Element, name: str) -> None:
        """Takes the coordinates in the text of an element."""


@dataclass
class _SetUp:
    """A set-up of the instrument.

    Attributes:
        point: Name of its point.
        height: Of the instrument (m).
        stations: Its station, once something needs it.
    """

    point: str
    height: float
    stations: dict[int, int] = field(default_factory=dict)


class SurveyReader:
    """Reads surveys into columns."""

    def __init__(
        self,
        columns: Columns,
        file: int,
        units: Units,
        sigmas: Mapping[str, float],
        places: Places,
        *,
        takes_reduced: bool,
    ) -> None:
        self._columns, self._file, self._units = columns, file, units
        self._sigmas, self._places = sigmas, places
        self._taken = ("RawObservation", REDUCED) if takes_reduced else ("RawObservation",)
        self._left_out: dict[str, list[int]] = {}

    def read(self, survey: Element) -> None:
        """Takes one survey."""
        for element in survey.children:
            if element.name in REFUSED:
                reason = REFUSED[element.name]
                raise element.error(f"<{element.name}> is an observation which obseq cannot adjust: {reason}")
        set_ups = {e.wanted("id"): self._set_up(e) for e in survey.named("InstrumentSetup")}
        targets = {e.wanted("id"): self._length(e, "targetHeight") for e in survey.named("TargetSetup")}
        for group in survey.named("ObservationGroup"):
            self._group(group, set_ups, targets)
        for set_up in survey.named("InstrumentSetup"):
            self._group(set_up, set_ups, targets, set_up.wanted("id"))

    def _set_up(self, element: Element) -> _SetUp:
        place = element.first("InstrumentPoint")
        name = self._name(place) if place is not None else None
        name = name or element.get("stationName")
        if name is None:
            raise element.error("<InstrumentSetup> names no point: give a stationName or a pntRef")
        if place is not None:
            self._places.take(place, name)
        return _SetUp(name, self._length(element, "instrumentHeight") or 0.0)

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
                target = self._target(element, group, set_ups)
                self._observation(element, group, (set_ups[number], target), targets)
            elif element.name in (REDUCED, "Backsight"):
                self._left_out.setdefault(element.name, []).append(element.line)

    def _target(self, element: Element, group: Element, set_ups: Mapping[str, _SetUp]) -> str:
        """The name of the target: its point, or that of the set-up on it."""
        place = element.first("TargetPoint")
        seen = set_ups.get(element.get("targetSetupID") or group.get("targetSetupID") or "")
        target = self._name(place) if place is not None else seen.point if seen is not None else None
        if target is None:
            raise element.error(
                f"<{element.name}> has no TargetPoint with a pntRef or a name, nor a set-up as target"
            )
        if place is not None:
            self._places.take(place, target)
        return target

    def _observation(
        self, element: Element, group: Element, ends: tuple[_SetUp, str], targets: Mapping[str, float | None]
    ) -> None:
        known = KNOWN_OF_REDUCED if element.name == REDUCED else KNOWN
        element.allow(known, ("TargetPoint", "OffsetVals", "Feature", "FieldNote"))
        self._refuse_others(element)
        set_up, target = ends
        if target == set_up.point:
            raise element.error(f"{target} is observed from itself; correct one of the names")
        lift = self._length(element, "targetHeight")
        if lift is None:
            lift = targets.get(element.get("targetSetupID") or group.get("targetSetupID") or "")
        rows = [self._columns.point(element.file, element.line - 1, name) for name in (set_up.point, target)]
        is_active = element.get("unused") != "true" and element.get("purpose") != "check"
        heights = (set_up.height, lift or 0.0)
        for kind, value, name in self._values(element):
            own = element.get("azimuthType" if kind is AZIM else "distanceType")
            counts = is_active and own not in NOT_MEASURED
            self._add(element, set_up, rows, (kind, value, name), heights, counts)

    @staticmethod
    def _refuse_others(element: Element) -> None:
        given = [name for name in UNREAD if element.get(name) is not None]
        if given or element.first("OffsetVals") is not None:
            what = given[0] if given else "OffsetVals"
            raise element.error(
                f"{what} is an observation which obseq cannot adjust: reduce it to the points"
            )

    def _values(self, element: Element) -> Iterator[tuple[ObservationKind, float, str]]:
        """Kind, value and name of the standard deviation of what one element holds."""
        is_second_face = element.get("directFace") == "false"
        horizontal = self._units.angle(element, "horizAngle", self._units.angular)
        if horizontal is not None:
            yield HZ, (horizontal + (math.pi if is_second_face else 0.0)) % FULL_TURN, "direction"
        azimuth = self._units.angle(element, "azimuth", self._units.direction)
        if azimuth is not None:
            yield AZIM, azimuth % FULL_TURN, "azimuth"
        zenith = self._units.angle(element, "zenithAngle", self._units.angular)
        if zenith is not None:
            turned = zenith % FULL_TURN
            yield ZEN, min(turned, FULL_TURN - turned), "zenith"
        for name, kind, sigma in LENGTHS:
            length = self._length(element, name)
            if length is not None:
                if kind is not DH and length <= 0.0:
                    raise element.error(f"{name} is {length:g}; a distance is above zero")
                yield kind, length, sigma

    def _add(
        self,
        element: Element,
        set_up: _SetUp,
        rows: list[int],
        value: tuple[ObservationKind, float, str],
        heights: tuple[float, float],
        is_active: bool,
    ) -> None:
        kind, number, name = value
        problem = lacking(name, self._sigmas)
        if problem:
            raise element.error(f"{kind.words}: {problem}")
        relative = self._sigmas.get("distance-ppm", 0.0) if name == "distance" else 0.0
        lifts = heights if kind in (DIST, ZEN, DH) else (0.0, 0.0)
        measure = Measure(kind, rows[0], rows[1], number, self._sigmas[name], is_active, relative, *lifts)
        measure = measure._replace(station=self._columns.station_of(kind, rows[0], set_up.stations))
        self._columns.append(measure, self._file, element.line - 1)

    def warnings(self, file: str) -> Iterator[str]:
        """One sentence for each sort of elements that have no part."""
        reasons = {
            REDUCED: "are reduced already, from raw ones or not (--ignore reductions takes them as measured)",
            "Backsight": "say how a set-up was oriented, which the adjustment finds",
        }
        for name, lines in self._left_out.items():
            shown = ", ".join(str(line) for line in lines[:8]) + ("..." if len(lines) > 8 else "")
            yield f"{file}: {len(lines)} <{name}> {reasons[name]}: they have no part (lines {shown})"
