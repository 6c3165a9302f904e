"""Mistakes as people make them, planted in the files of a network: one function for each kind."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import make_network as simulated
import numpy as np

from obseq.survey import Network

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from obseq.records.diagnosis import AccusedRecord

FRAME, PLANE = simulated.FRAME, simulated.PLANE
Random = np.random.Generator


@dataclass
class Site:
    """The texts of the files of a network: lines of words, to be spoilt.

    Attributes:
        obs: lines of the OBS file.
        cor: lines of the COR file.
        new: names of the unknown points.
    """

    obs: list[list[str]]
    cor: list[list[str]]
    new: list[str]

    def write(self, folder: Path) -> tuple[Path, Path]:
        """Writes the two files."""
        paths = folder / "site.obs", folder / "site.cor"
        for path, lines in zip(paths, (self.obs, self.cor), strict=True):
            path.write_text("\n".join(" ".join(words) for words in lines) + "\n", encoding="utf-8")
        return paths

    def read(self, folder: Path) -> Network:
        """The network of the files."""
        return Network.read(*self.write(folder), frame=FRAME, points_crs=PLANE)


@dataclass(frozen=True)
class Planted:
    """What was done: codes of causes and slips that name it, lines of the OBS file and points it concerns."""

    causes: frozenset[str]
    lines: frozenset[int] = frozenset()
    points: frozenset[str] = frozenset()

    def is_named_by(self, error: AccusedRecord) -> bool:
        """Whether a finding names this error and its cause."""
        lines, points = {row.line for row in error.observations}, {point.name for point in error.points}
        codes = {error.code, *(slip.code for slip in error.slips)}
        return bool(self.causes & codes) and bool(self.lines & lines or self.points & points)


def _angles(site: Site, codes: tuple[str, ...] = ("5", "6", "7")) -> list[int]:
    return [k for k, words in enumerate(site.obs) if words[0] in codes]


def _scaled(site: Site, rows: list[int], change: Callable[[float], float]) -> frozenset[int]:
    """Changes values as somebody who writes them does; the lines of the file, from 1."""
    for k in rows:
        decimals = len(site.obs[k][3].partition(".")[2])
        site.obs[k][3] = f"{change(float(site.obs[k][3])):.{max(decimals, 3)}f}"
    return frozenset(k + 1 for k in rows)


def _some(rows: list[int], random: Random) -> list[int]:
    return [rows[int(random.integers(len(rows)))]]


def all_in_degrees(site: Site, random: Random) -> Planted:
    """All angles in degrees."""
    return Planted(
        frozenset({"W100", "W101", "W106", "W107", "W126", "S151", "S161"}),
        _scaled(site, _angles(site), lambda v: v * 0.9),
    )


def station_in_degrees(site: Site, random: Random) -> Planted:
    """All angles of one station in degrees."""
    name = site.obs[_some(_angles(site), random)[0]][1]
    rows = [k for k in _angles(site) if site.obs[k][1] == name]
    return Planted(
        frozenset({"W100", "W101", "W106", "W107", "W126", "S151", "S161"}),
        _scaled(site, rows, lambda v: v * 0.9),
    )


def station_anticlockwise(site: Site, random: Random) -> Planted:
    """All directions of one station counted anticlockwise."""
    name = site.obs[_some(_angles(site), random)[0]][1]
    rows = [k for k in _angles(site, ("5", "7")) if site.obs[k][1] == name]
    return Planted(frozenset({"W102", "W131", "W105", "W104"}), _scaled(site, rows, lambda v: 400.0 - v))


def all_elevations(site: Site, random: Random) -> Planted:
    """Elevations instead of zenith angles."""
    return Planted(frozenset({"W103", "W132"}), _scaled(site, _angles(site, ("6",)), lambda v: 100.0 - v))


def all_elevations_in_degrees(site: Site, random: Random) -> Planted:
    """All angles in degrees, and elevations instead of zenith angles."""
    lines = _scaled(site, _angles(site, ("6",)), lambda v: 100.0 - v)
    lines |= _scaled(site, _angles(site), lambda v: v * 0.9)
    return Planted(frozenset({"W103", "W132", "W100", "W101", "W106", "W107", "W126", "S151", "S161"}), lines)


def all_in_millimetres(site: Site, random: Random) -> Planted:
    """All distances in millimetres."""
    return Planted(
        frozenset({"W100", "W101", "W106", "W107", "W126", "S151", "S161"}),
        _scaled(site, _angles(site, ("3",)), lambda v: v * 1000.0),
    )


def all_in_feet(site: Site, random: Random) -> Planted:
    """All distances in feet."""
    return Planted(
        frozenset({"W100", "W101", "W106", "W107", "W126", "S151", "S161"}),
        _scaled(site, _angles(site, ("3",)), lambda v: v / 0.3048),
    )


def one_in_degrees(site: Site, random: Random) -> Planted:
    """One angle in degrees."""
    lines = _scaled(site, _some(_angles(site), random), lambda v: v * 0.9)
    return Planted(frozenset({"W100", "W101", "W106", "W107", "W126", "S151", "S161"}), lines)


def one_elevation(site: Site, random: Random) -> Planted:
    """One elevation instead of a zenith angle."""
    rows = _some(_angles(site, ("6",)), random)
    return Planted(frozenset({"W103", "W132"}), _scaled(site, rows, lambda v: 100.0 - v))


def one_in_millimetres(site: Site, random: Random) -> Planted:
    """One distance in millimetres."""
    rows = _some(_angles(site, ("3",)), random)
    return Planted(
        frozenset({"W100", "W101", "W106", "W107", "W126", "S151", "S161"}),
        _scaled(site, rows, lambda v: v * 1000.0),
    )


def one_digit(site: Site, random: Random) -> Planted:
    """One digit of one value wrong, far above the noise."""
    k = _some(_angles(site, ("3", "5", "6", "7")), random)[0]
    text = site.obs[k][3]
    limit = 0.02 if site.obs[k][0] in ("5", "6", "7") else 0.05
    point = text.index(".")
    places = [i for i, c in enumerate(text) if c.isdigit() and 10.0 ** _power(i, point) >= limit]
    while True:
        i = places[int(random.integers(len(places)))]
        changed = text[:i] + str(int(random.integers(10))) + text[i + 1 :]
        if changed != text and (site.obs[k][0] == "3" or abs(float(changed)) <= 400.0):
            break
    site.obs[k][3] = changed
    return Planted(
        frozenset({"W109", "W110", "W129", "W130", "W102", "W131", "W105", "W104"}), frozenset({k + 1})
    )


def _power(i: int, point: int) -> int:
    return point - i - 1 if i < point else point - i


def exchanged_digits(site: Site, random: Random) -> Planted:
    """Two neighbouring digits of a distance exchanged."""
    while True:
        k = _some(_angles(site, ("3",)), random)[0]
        text = site.obs[k][3]
        i = int(random.integers(0, text.index(".") - 1))
        if text[i] != text[i + 1]:
            break
    site.obs[k][3] = text[:i] + text[i + 1] + text[i] + text[i + 2 :]
    return Planted(frozenset({"W109", "W110", "W129", "W130"}), frozenset({k + 1}))


def wrong_target(site: Site, random: Random) -> Planted:
    """All measures of one sight under the name of another point."""
    k = _some(_angles(site, ("6",)), random)[0]
    origin, target = site.obs[k][1:3]
    sights = [words for words in site.obs if len(words) > 2]
    others = [w[2] for w in sights if w[1] != origin and w[2] not in (origin, target)]
    name = others[int(random.integers(len(others)))]
    rows = [i for i, words in enumerate(site.obs) if words[1:3] == [origin, target]]
    for i in rows:
        site.obs[i][2] = name
    causes = frozenset({"W118", "W113", "W133"})
    return Planted(causes, frozenset(i + 1 for i in rows))


def exchanged_targets(site: Site, random: Random) -> Planted:
    """Two targets of one station under each other's names."""
    k = _some(_angles(site, ("6",)), random)[0]
    origin, a = site.obs[k][1:3]
    others = sorted({words[2] for words in site.obs if words[1:2] == [origin]} - {a})
    b = others[int(random.integers(len(others)))]
    lines = []
    for i, words in enumerate(site.obs):
        if words[1:2] == [origin] and words[2] in (a, b):
            words[2] = b if words[2] == a else a
            lines.append(i + 1)
    return Planted(frozenset({"W118", "W113", "W133"}), frozenset(lines))


def swapped_coordinates(site: Site, random: Random) -> Planted:
    """Easting and northing of one known point exchanged."""
    words = site.cor[int(random.integers(len(site.cor)))]
    words[2], words[3] = words[3], words[2]
    return Planted(frozenset({"W123"}), points=frozenset({words[1]}))


def all_coordinates_swapped(site: Site, random: Random) -> Planted:
    """Easting and northing of all known points exchanged."""
    for words in site.cor:
        words[2], words[3] = words[3], words[2]
    names = frozenset(words[1] for words in site.cor)
    return Planted(frozenset({"W123"}), points=names)


def exchanged_known_points(site: Site, random: Random) -> Planted:
    """The names of two known points exchanged."""
    a, b = random.choice(len(site.cor), 2, replace=False)
    site.cor[a][1], site.cor[b][1] = site.cor[b][1], site.cor[a][1]
    names = frozenset({site.cor[a][1], site.cor[b][1]})
    return Planted(frozenset({"W118", "W113", "W133"}), points=names)


def mistyped_coordinate(site: Site, random: Random) -> Planted:
    """One digit of a coordinate of a known point wrong, by a metre or more."""
    words = site.cor[int(random.integers(len(site.cor)))]
    k = 2 + int(random.integers(3))
    text = words[k]
    places = [i for i in range(text.index(".")) if text[i].isdigit()][-3:]
    i = places[int(random.integers(len(places)))]
    words[k] = text[:i] + str((int(text[i]) + 1 + int(random.integers(9))) % 10) + text[i + 1 :]
    return Planted(frozenset({"W109", "W110", "W129", "W130"}), points=frozenset({words[1]}))


MISTAKES: tuple[Callable[[Site, Random], Planted], ...] = (
    all_in_degrees,
    station_in_degrees,
    station_anticlockwise,
    all_elevations,
    all_elevations_in_degrees,
    all_in_millimetres,
    all_in_feet,
    one_in_degrees,
    one_elevation,
    one_in_millimetres,
    one_digit,
    exchanged_digits,
    wrong_target,
    exchanged_targets,
    swapped_coordinates,
    all_coordinates_swapped,
    exchanged_known_points,
    mistyped_coordinate,
)
