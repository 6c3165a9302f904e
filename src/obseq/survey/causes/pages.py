"""What a person can read of all causes of networks: a page for each code."""

from __future__ import annotations

from itertools import chain

from obseq.diagnosis.page import Page, price
from obseq.survey.causes.catalogue import KNOWN, KNOWN_PLAN, RARITY, ROW
from obseq.survey.causes.cause import Cause, KnownCause
from obseq.survey.causes.registry import CAUSES, OF_KNOWN
from obseq.survey.causes.rewriting import REWRITINGS, SCOPES

_UNITS = {"m": "metres", "rad": "radians", "": "as a ratio"}
_REDONE = "The values are put right, and the network is computed anew: most contradictions must go."

ALONE = (
    Page(
        ROW,
        "one observation",
        "One value is wrong.",
        ("Each observation but components of vectors, one size each.",),
        "A digit was mistyped, or another target was read.",
        "Correct the value, or switch the line off.",
    ),
    Page(
        KNOWN,
        "known coordinate",
        "One known coordinate of a point is wrong.",
        ("Each known coordinate, one size each.", *price(RARITY[KNOWN])),
        "A digit was mistyped in a list of coordinates, or a bench mark has settled.",
        "Correct the coordinate, or leave the point free.",
    ),
    Page(
        KNOWN_PLAN,
        "known plan",
        "A known point is elsewhere in plan than its coordinates say.",
        ("Both known coordinates in plan of each point, two sizes.", *price(RARITY[KNOWN_PLAN])),
        "Easting and northing were exchanged, or these are the coordinates of another point.",
        "Correct the coordinates or the name of the point, or leave it free.",
    ),
)
"""Single observations and known coordinates."""

_WRITTEN = {
    "S200": ("Angles are in another unit than the file says.", "Angles in degrees in a file of gon."),
    "S201": (
        "Vertical angles are counted from elsewhere than from the zenith.",
        "An instrument that was set to elevations, or readings in the second face.",
    ),
    "S202": ("Directions or angles are counted in the other sense.", "Directions counted anticlockwise."),
    "S203": ("Distances are in another unit than the file says.", "Distances in millimetres or feet."),
    "S204": (
        "Height differences are in another unit than the file says.",
        "Levelling in millimetres in a file of metres.",
    ),
}
"""What mistakes mean that many values share, and an example."""

OF_POINTS = (
    Page(
        "S112",
        "known point",
        "Nothing fits the coordinates of a known point.",
        ("Each known point as an unknown one, where others are left.", _REDONE),
        "The coordinates are of another system, or the mark was moved.",
        "Look up the coordinates, or give the point without them.",
    ),
    Page(
        "S113",
        "exchanged points",
        "Two known points have each other's coordinates.",
        ("Each pair of known points, where these are few.", _REDONE),
        "Two names were exchanged in a list of coordinates.",
        "Exchange the names.",
    ),
    Page(
        "S205",
        "kind of distances",
        "Horizontal distances were written as slope distances.",
        ("All slope distances together.", _REDONE),
        "The instrument was set to reduced distances.",
        "Give the code of horizontal distances, or the slope distances.",
    ),
    Page(
        "S210",
        "order of coordinates",
        "Easting and northing of all points are exchanged.",
        ("All points with coordinates together.", _REDONE),
        "A list in the order northing, easting.",
        "Say the order of the columns, or exchange them.",
    ),
    Page(
        "S211",
        "unit of heights",
        "Heights of all points are in another unit than their plan.",
        ("All points with coordinates together.", _REDONE),
        "Heights in feet with a plan in metres.",
        "Convert the heights.",
    ),
    Page(
        "S212",
        "unit of coordinates",
        "Coordinates of all known points, or all in plan, are in another unit than observations.",
        ("All points with coordinates together.", _REDONE),
        "A list of coordinates in feet, or of eastings and northings in feet, and distances in metres.",
        "Convert the coordinates.",
    ),
    Page(
        "S213",
        "zone or system",
        "Known points are those of another zone or system.",
        ("All but one or two known points as unknown ones: they must be found turned, or larger.", _REDONE),
        "Coordinates of zone 31 in a project of zone 32.",
        "Correct --points-crs, or --frame.",
    ),
)
"""Mistakes of coordinates, and of the kind of distances."""


def pages() -> tuple[Page, ...]:
    """All causes of networks, by code."""
    of_known = (Page.of(one, *_of_all(one), *price(one.rarity)) for one in OF_KNOWN)
    found = chain(ALONE, map(_of_cause, CAUSES), of_known, map(_of_writing, _WRITTEN), OF_POINTS)
    return tuple(sorted(found, key=lambda page: page.code))


def _of_all(cause: KnownCause) -> tuple[str, ...]:
    sizes = f"sizes: {', '.join(cause.parts)}" if cause.parts else "one size for all of them"
    return (f"All known coordinates together, of {cause.least} points at least; {sizes}.",)


def _of_cause(cause: Cause) -> Page:
    where = ", ".join(scope.about for scope in cause.scopes)
    tested = [f"Where it may be: {where}; {cause.least} observations at least."]
    if cause.effect is not None:
        sizes = f"Sizes {', '.join(cause.parts)}" if cause.parts else "One size"
        tested.append(f"{sizes} for all of them ({_UNITS[cause.unit]}).")
    else:
        tested.append("A size for each of them.")
    if cause.needs_slip:
        tested.append("It is told only with a slip that explains it.")
    return Page.of(cause, *tested, *price(cause.rarity))


def _of_writing(code: str) -> Page:
    about, example = _WRITTEN[code]
    own = [one for one in REWRITINGS if one.code == code]
    where = ", ".join(scope.about for scope in SCOPES)
    ways = "; ".join(dict.fromkeys(one.text for one in own))
    tested = (f"Where it may be: {where}.", f"Ways: {ways}.", _REDONE)
    names = ", ".join(dict.fromkeys(one.name for one in own))
    return Page(code, names, about, tested, example, "Correct the values, or what the file says of them.")
