"""Targets of an image: candidates at all levels, codes read, and each confirmed by the fit of its drawing."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from obseq.arrays import Array, BoolArray, FloatArray, FloatRows
from obseq.dataclass import dataclass
from obseq.targets.drawing.drawings import bits_drawn
from obseq.targets.finding.candidates import SURE, find_discs, find_spots
from obseq.targets.finding.chequers import EITHER, ODD, RoughBits, bit_ink, chequered_discs, read_bits
from obseq.targets.finding.covering import Covering, covered_by
from obseq.targets.finding.distortion import with_one_distortion
from obseq.targets.finding.fits import Fit, Placed, as_in_squares
from obseq.targets.finding.levels import Level, levels_of
from obseq.targets.finding.measuring import FORGIVEN, Drawings, fit_drawing
from obseq.targets.finding.rings import Reading, Unread, read_rings
from obseq.targets.finding.zones import worst_quadrant
from obseq.targets.specification import Specification, extent

LIKE = 0.85
"""Share of the grey variance, but for noise, that the drawing of a target explains at least."""
FIGURE_LIKE = 0.75
"""And that the drawing of its central figure explains, before its code is read."""
NOTICED = 2
"""Bits that can be read and in which any other target differs: one that is wrong is noticed then."""
CHANCE = 0.1
"""Share of all patterns of these bits that are targets: what is none seldom has a name."""
SPOT_LIKE = 0.97
"""And the edge of a spot without code: of a square spot the drawing of a disc explains 0.96 at most."""
FLAT = 1e7
"""Focal length for spots, pixels: one says nothing of its perspective, what is measured is its ellipse."""
STEP = 2.0
"""Grey levels of the steps in which a JPEG of quality 50 keeps means of squares of 8 pixels: its table
has 16 for eight of them. Squares of flat paper differ so: four in chequers look like a target without ink."""
FAINTEST = SURE * STEP / math.sqrt(3.0)
"""Grey levels between sheet and ink at least: a bit is then `SURE` sigmas of such steps from its middle."""
INSIDE = 0.6
"""Share of a sheet within which nothing else is looked for: of what overlaps, the best is kept at last."""
SPOT = np.array([-1.0, 1.0, -1.0, 1.0])
"""Edges around a spot without code, units, within which no other is looked for."""


@dataclass(frozen=True, eq=False)
class Target:
    """A target that was found.

    Attributes:
        name: of the specification; empty for a spot without code.
        spec: its set.
        fit: of its drawing: place, covariance, light.
        margins: (bits,) distance of each bit from the middle, in half contrasts; none without code.
        corrected: bits that were read otherwise.
        oddest: largest difference of a part of it from the drawing, in contrasts.
    """

    name: str
    spec: Specification
    fit: Fit
    margins: FloatArray
    corrected: int
    oddest: float

    @property
    def family(self) -> str:
        """Of its set."""
        return self.spec.family

    @property
    def size(self) -> float:
        """Pixels across its code, as seen from the front; the height of a sheet with rows."""
        return extent(self.spec) * self.fit.placed.largest

    @property
    def centre(self) -> FloatArray:
        """(2,) image of the centre, pixels."""
        return self.fit.placed.centre

    @property
    def ellipse(self) -> FloatArray:
        """(2,) centre of the ellipse that the central figure's edge is in the image, pixels."""
        return self.fit.placed.ellipse[0]

    @property
    def covariance(self) -> FloatRows:
        """(2, 2) pixels squared."""
        return self.fit.covariance

    @property
    def tilt(self) -> float:
        """Angle between the target's normal and the ray, radians, from how its figure is shortened."""
        return math.acos(min(1.0, self.fit.placed.smallest / self.fit.placed.largest))


@dataclass(frozen=True, eq=False)
class Refusal:
    """Something that looked like a target and was refused.

    Attributes:
        x: pixels.
        y: pixels.
        stage: what was looked at.
        value: what was found.
        limit: what it had to reach.
    """

    x: float
    y: float
    stage: str
    value: float
    limit: float


@dataclass(frozen=True, eq=False)
class Found:
    """The targets of an image.

    Attributes:
        targets: with their names, by name.
        uncoded: spots without code.
        refused: what looked like a target.
    """

    targets: list[Target]
    uncoded: list[Target]
    refused: list[Refusal]


class Finder:
    """Looks for the targets of some sets.

    Args:
        specs: the sets; their names differ.
        focal: focal length of the camera, pixels; by default the longer side of an image.
        uncoded: whether spots without code are measured too.
    """

    def __init__(
        self, specs: Sequence[Specification], *, focal: float | None = None, uncoded: bool = False
    ) -> None:
        self.focal, self.uncoded = focal, uncoded
        self._sets = [_Set(spec) for spec in specs]

    def find(self, image: Array) -> Found:
        """The targets of an image (height, width) of grey levels."""
        levels = levels_of(image)
        search = _Search(image, self.focal or float(max(image.shape)), self.uncoded, levels[0].noise)
        for level in reversed(levels):
            for sign in (1.0, -1.0):
                rings = [one for one in self._sets if one.sign == sign and not one.is_chequered]
                chequers = [one for one in self._sets if one.sign == sign and one.is_chequered]
                if rings:
                    search.rings(level, rings, sign)
                if chequers:
                    search.chequers(level, chequers, sign)
        return search.found()


class _Set:
    """A specification, with what is made of it once."""

    def __init__(self, spec: Specification) -> None:
        self.spec = spec
        self.drawings, self.bits = Drawings(spec), RoughBits(spec)
        self.is_chequered = spec.geometry.is_chequered
        self.sign = 1.0 if spec.geometry.is_white == self.is_chequered else -1.0
        """1 where a white sheet has black quadrants, or a black one white spots."""


class _Search:
    """The search of one image."""

    def __init__(self, image: Array, focal: float, uncoded: bool, noise: float) -> None:
        self.noise = noise
        self.image, self.focal, self.uncoded = image, focal, uncoded
        self.targets: list[Target] = []
        self.plain: list[Target] = []
        self.refused: list[Refusal] = []
        self._taken = Covering()

    def rings(self, level: Level, sets: Sequence[_Set], sign: float) -> None:
        """Looks for ring targets."""
        spots = find_spots(level, sign)
        specs = [one.spec for one in sets]
        for k in self._free(spots[:, :2]):
            ellipse, readings = read_rings(self.image, specs, spots[k], sign, level.number > 0)
            if any(
                self._confirmed(one, [reading])
                for one, reading in zip(sets, readings, strict=True)
                if isinstance(reading, Reading)
            ):
                continue
            last = readings[-1]
            if isinstance(last, Unread):
                self._refuse(ellipse, last)
            if self.uncoded:
                self._measure_spot(sets[0], ellipse)

    def chequers(self, level: Level, sets: Sequence[_Set], sign: float) -> None:
        """Looks for chequered targets."""
        found = find_discs(level, sign, min(one.spec.geometry.inside for one in sets))
        for one in sets:
            discs = chequered_discs(level, one.bits, found, sign)
            for k in self._free(np.array([disc.centre for disc, _ in discs]).reshape(-1, 2)):
                disc, unread = discs[k]
                if unread is None:
                    self._chequered(one, disc)
                else:
                    self._refuse(disc, unread)

    def _chequered(self, one: _Set, disc: Placed) -> bool:
        fit = fit_drawing(self.image, one.drawings, -1, disc, focal=self.focal, whole=False, most_steps=3)
        if fit is None or fit.gain * one.sign > 0.0:
            return False
        if fit.likeness_with(self.noise) < FIGURE_LIKE:
            self._refuse(fit.placed, Unread("figure: likeness to the drawing", fit.likeness, FIGURE_LIKE))
            return False
        if self._is_taken(fit.placed.centre):
            return True
        readings = read_bits(self.image, one.spec, fit)
        if isinstance(readings, Unread):
            self._refuse(fit.placed, readings)
            return False
        return self._confirmed(one, readings)

    def _confirmed(self, one: _Set, readings: Sequence[Reading]) -> bool:
        """Whether the drawing of one of the targets that were read fits the image; the best is kept then."""
        best: tuple[Reading, Fit] | None = None
        for reading in readings:
            fit = fit_drawing(self.image, one.drawings, reading.code, reading.placed, focal=self.focal)
            if fit is not None and (best is None or fit.likeness > best[1].likeness):
                best = reading, fit
        if best is None:
            self._refuse(readings[0].placed, Unread("drawing: fits inside the image", 0.0, 1.0))
            return False
        reading, fit = best
        if self._is_taken(fit.placed.centre):
            return True
        likeness, oddest = fit.likeness_with(self.noise), worst_quadrant(one.spec, fit)
        ink = bit_ink(self.image, one.spec, fit.placed, fit)
        if ink is None:
            self._refuse(fit.placed, Unread("inside the image", 0.0, 1.0))
            return False
        reading = replace(reading, margins=2.0 * (ink.bits - EITHER))
        off = np.abs(ink.bits - bits_drawn(one.spec, reading.code))
        is_doubtful = (off > ODD) & (off < 1.0 - ODD) & (ink.foreign < FORGIVEN)
        oddest = max(oddest, float(off[~is_doubtful].max(initial=0.0)))
        if abs(fit.gain) < FAINTEST:
            self._refuse(fit.placed, Unread(f"{reading.name}: grey levels of ink", abs(fit.gain), FAINTEST))
        elif likeness < LIKE:
            self._refuse(fit.placed, Unread(f"{reading.name}: likeness", likeness, LIKE))
        elif oddest > ODD:
            self._refuse(fit.placed, Unread(f"{reading.name}: a part differs", oddest, ODD))
        elif is_doubtful.any() and not _is_certain(one.spec, reading.name, ~is_doubtful):
            self._refuse(
                fit.placed, Unread(f"{reading.name}: bits that cannot be read", is_doubtful.sum(), 0)
            )
        else:
            self.targets.append(_target(one, reading, fit, oddest))
            self._taken.add(fit.placed, INSIDE * np.array(one.spec.geometry.sheet))
            return True
        return False

    def _measure_spot(self, one: _Set, ellipse: Placed) -> None:
        fit = fit_drawing(self.image, one.drawings, -1, ellipse, focal=FLAT, whole=False)
        if fit is None or fit.likeness_with(self.noise) < SPOT_LIKE or self._is_taken(fit.placed.centre):
            return
        reading = Reading(ellipse, "", -1, np.empty(0))
        self.plain.append(_target(one, reading, fit, 0.0))
        self._taken.add(fit.placed, SPOT)

    def _free(self, places: FloatRows) -> Iterator[int]:
        """Numbers of the places (n, 2), pixels, that no target covers when it is their turn."""
        known = len(self._taken)
        for k in np.flatnonzero(~self._taken.covers(places)).tolist():
            if not self._taken.covers(places[k : k + 1], known)[0]:
                yield k

    def _is_taken(self, place: FloatArray) -> bool:
        return bool(self._taken.covers(place[None])[0])

    def _refuse(self, placed: Placed, why: Unread) -> None:
        x, y = placed.centre.tolist()
        self.refused.append(Refusal(x, y, why.stage, why.value, why.limit))

    def found(self) -> Found:
        """What was found; of two targets of one name, that whose drawing fits better."""
        best: dict[str, Target] = {}
        for target in sorted(self.targets, key=lambda target: -target.fit.likeness):
            same = best.get(target.name) or next(
                (other for other in best.values() if _overlap(target, other)), None
            )
            if same is None:
                best[target.name] = target
                continue
            stage = f"{target.name}: likeness, less than that of {same.name} " + (
                "elsewhere" if same.name == target.name else "at the same place"
            )
            self._refuse(target.fit.placed, Unread(stage, target.fit.likeness, same.fit.likeness))
        fits = with_one_distortion([one.fit for one in self.targets], self.image.shape, self.focal)
        fits = as_in_squares(fits)
        better = {id(one): replace(one, fit=fit) for one, fit in zip(self.targets, fits, strict=True)}
        best = {name: better[id(one)] for name, one in best.items()}
        refused = [one for one in self.refused if not self._is_taken(np.array([one.x, one.y]))]
        return Found([best[name] for name in sorted(best)], self.plain, refused)


def _is_certain(spec: Specification, name: str, is_readable: BoolArray) -> bool:
    """Whether the bits that can be read, (bits,), are those of one target, not by chance or by one error."""
    return spec.apart(name, is_readable) >= NOTICED and spec.chance(is_readable) < CHANCE


def _target(one: _Set, reading: Reading, fit: Fit, oddest: float) -> Target:
    return Target(reading.name, one.spec, fit, reading.margins, reading.corrected, oddest)


def _overlap(one: Target, other: Target) -> bool:
    """Whether the centre of one target lies on the sheet of another."""
    return any(
        covered_by(a.fit.placed, np.array(a.spec.geometry.sheet), b.centre[None])[0]
        for a, b in ((one, other), (other, one))
    )
