"""Units of LandXML files."""

from __future__ import annotations

import math

from obseq.dataclass import dataclass
from obseq.reading.angles import dms
from obseq.reading.text import quoted
from obseq.reading.xml import Element
from obseq.records.shown_units import ShownUnits, length_named

LENGTHS = {
    "meter": 1.0,
    "metre": 1.0,
    "millimeter": 1e-3,
    "centimeter": 1e-2,
    "kilometer": 1e3,
    "foot": 0.3048,
    "USSurveyFoot": 1200.0 / 3937.0,
    "inch": 0.0254,
}
RADIANS = {"radians": 1.0, "grads": math.pi / 200.0, "decimal degrees": math.pi / 180.0}
PACKED = "decimal dd.mm.ss"


@dataclass(frozen=True)
class Units:
    """Units of a file.

    Attributes:
        metres: In one unit of length.
        angular: Name of the unit of angles on an instrument.
        direction: Name of the unit of azimuths.
    """

    metres: float
    angular: str
    direction: str

    @property
    def shown(self) -> ShownUnits:
        """Units of reports: those of the file; radians are shown in gon."""
        angle = {"decimal degrees": "degree", PACKED: "dms"}.get(self.angular, "gon")
        return ShownUnits(length_named(self.metres), angle)

    def angle(self, element: Element, name: str, unit: str) -> float | None:
        """An attribute that is an angle, in radians, if it is there."""
        value, text = element.number(name), element.get(name)
        if value is None or text is None:
            return None
        return value * RADIANS[unit] if unit in RADIANS else _packed(element, name, text)


def _packed(element: Element, name: str, text: str) -> float:
    """Degrees, minutes and seconds written as one decimal number."""
    try:
        return dms(text)
    except ValueError as error:
        raise element.error(f"<{element.name}> {name} {quoted(text)} is not ddd.mmss: {error}") from error


def units_of(root: Element) -> Units:
    """The units that a file declares.

    Raises:
        InputError: It declares none, or some that are not known.
    """
    outer = root.first("Units")
    inner = next(outer.named("Metric", "Imperial"), None) if outer else None
    if inner is None:
        raise root.error("the file has no <Units> with <Metric> or <Imperial>: its numbers mean nothing")
    linear = inner.wanted("linearUnit")
    if linear not in LENGTHS:
        raise inner.error(f"linearUnit {quoted(linear)} is none of {', '.join(LENGTHS)}")
    angular = inner.get("angularUnit") or "radians"
    direction = inner.get("directionUnit") or "radians"
    for unit in (angular, direction):
        if unit not in (*RADIANS, PACKED):
            raise inner.error(f"the unit of angles {quoted(unit)} is none of {', '.join((*RADIANS, PACKED))}")
    return Units(LENGTHS[linear], angular, direction)
