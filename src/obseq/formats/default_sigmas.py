"""Standard deviations that a user gives for observations whose file has none."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping

from obseq.errors import InputError
from obseq.reading.angles import GON, SECOND
from obseq.reading.text import parse_number
from obseq.records.shown_units import METRES

LENGTHS = {"mm": 1e-3, "cm": 1e-2} | METRES
"""Units of lengths; `us-ft` is the foot of the United States' surveys."""
ANGLES = {
    "sec": SECOND,
    "arcsec": SECOND,
    "cc": GON * 1e-4,
    "mgon": GON * 1e-3,
    "gon": GON,
    "deg": math.pi / 180.0,
    "rad": 1.0,
}
"""Units of angles, as options and tables name them."""
PARTS = {"ppm": 1e-6}
NAMES = {
    "distance": LENGTHS,
    "distance-ppm": PARTS,
    "direction": ANGLES,
    "angle": ANGLES,
    "azimuth": ANGLES,
    "zenith": ANGLES,
    "height": LENGTHS,
    "height-per-km": LENGTHS,
    "height-per-turn": LENGTHS,
    "instrument-centring": LENGTHS,
    "target-centring": LENGTHS,
    "vertical-centring": LENGTHS,
    "index-setting": ANGLES,
}
"""What a standard deviation is of, and its units; of heights per root of the kilometre, or of turns."""
CENTRING = ("instrument-centring", "target-centring", "vertical-centring")
"""Those that depend on the places of points (`stochastic`)."""
INDEX = "index-setting"
"""Of the index of the vertical circle, which all sights of a set-up have in common."""
EXAMPLES = {
    "distance": "distance=2mm",
    "distance-ppm": "distance-ppm=2ppm",
    "direction": "direction=3sec",
    "angle": "angle=3sec",
    "azimuth": "azimuth=10sec",
    "zenith": "zenith=5sec",
    "height": "height=1mm",
    "height-per-km": "height-per-km=1mm",
    "height-per-turn": "height-per-turn=0.2mm",
    "instrument-centring": "instrument-centring=1mm",
    "target-centring": "target-centring=1mm",
    "vertical-centring": "vertical-centring=1mm",
    "index-setting": "index-setting=1sec",
}
_VALUE = re.compile(r"([0-9.eE+-]+)([a-z]+(?:-[a-z]+)?)", re.ASCII)


def parse_sigmas(texts: Iterable[str]) -> dict[str, float]:
    """Standard deviations by name, in metres, radians or parts.

    Args:
        texts: Such as `distance=2mm`.

    Raises:
        InputError: A name or a unit is not known, or a value is not above zero.
    """
    found = {}
    for text in texts:
        name, _, value = text.partition("=")
        if name not in NAMES:
            raise InputError(
                f"--sigmas {text}: {name!r} is none of {', '.join(NAMES)} (files go before --sigmas)"
            )
        found[name] = quantity(f"--sigmas {text}", name, value)
    return found


def quantity(where: str, name: str, value: str) -> float:
    """A standard deviation of a name, in metres, radians or parts.

    Args:
        where: What begins the message of an error.
        name: One of `NAMES`.
        value: A number with its unit.

    Raises:
        InputError: The name or the unit is not known, or the value is not above zero.
    """
    units = NAMES.get(name, {})
    parts = _VALUE.fullmatch(value)
    if parts is None or parts[2] not in units:
        known = ", ".join(units) or "none"
        example = EXAMPLES.get(name, EXAMPLES["distance"])
        raise InputError(f"{where}: a number with its unit ({known}) is needed, such as {example}")
    try:
        number = parse_number(parts[1]) * units[parts[2]]
    except ValueError as error:
        raise InputError(f"{where}: {error}") from error
    if number <= 0.0:
        raise InputError(f"{where}: a standard deviation is above zero")
    return number


def lacking(name: str, given: Mapping[str, float]) -> str | None:
    """What to do when there is no standard deviation of a name; None when there is one."""
    if name in given:
        return None
    return (
        "it has no standard deviation: write one after the value where the file has room for it, or give one "
        f"for all of its kind with --sigmas {EXAMPLES[name]} (sigmas=['{EXAMPLES[name]}'] in Python)"
    )
