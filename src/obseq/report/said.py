"""Sentences whose numbers are shown in the units of the reader.

A number stands in a sentence as `{{kind|value|digits}}`, in metres or radians. `plain` writes it out.
"""

from __future__ import annotations

import re
from dataclasses import replace

from obseq.printable import printable_line
from obseq.report.tables.units import Units

_PLACE = re.compile(r"\{\{(\w+)\|([^|{}]+)\|(\d*)\}\}")


def length(value: float, digits: int | None = None) -> str:
    """A coordinate or a distance (m)."""
    return _number("length", value, digits)


def small(value: float, unit: str = "m", digits: int | None = None) -> str:
    """A residual or a precision (m or rad)."""
    return _number("small_angle" if unit == "rad" else "small_length", value, digits)


def observed(value: float, unit: str = "m") -> str:
    """An observed value (m or rad)."""
    return _number("angle" if unit == "rad" else "length", value, None)


def bearing(value: float) -> str:
    """A direction (rad), roughly."""
    return _number("angle", value, 1)


def name(text: str) -> str:
    """A name from a file, that cannot be read as a number."""
    return printable_line(text).replace("{{", "{ {")


def plain(text: str, units: Units) -> str:
    """The sentence with its numbers written out."""
    scales = {
        "length": units.length,
        "small_length": units.small_length,
        "angle": units.angle,
        "small_angle": units.small_angle,
    }

    def shown(found: re.Match[str]) -> str:
        scale = scales[found[1]]
        scale = replace(scale, decimals=int(found[3])) if found[3] else scale
        return scale.text(float(found[2]))

    return _PLACE.sub(shown, text)


def _number(kind: str, value: float, digits: int | None) -> str:
    return f"{{{{{kind}|{value:.10g}|{'' if digits is None else digits}}}}}"
