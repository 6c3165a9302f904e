"""What a set of coded targets is: its geometry on paper, and the names of its codes.

Lengths are in units: the radius of the central figure, a disc or a chequered disc, is 1. x goes right, y
down, angles are atan2(y, x): they grow clockwise on the page.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from obseq.arrays import BoolArray, FloatArray
from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.errors import InputError, nearest
from obseq.targets.codes import check_bits, counted, least_distance, members, rotated

DRAWING = 1800
"""Pixels across a drawing before it is reduced."""
REDUCTION = 3
SHEETS = math.sqrt(2.0)
"""Height of an A4 sheet, in widths."""


@dataclass(frozen=True)
class Geometry:
    """Where ink is.

    Attributes:
        family: IGNIndoor, IGNDroneSym, IGNDroneTop or CERN.
        inside: from the central figure to the code, units.
        code: width of the ring of the code; 0 where bits stand in rows.
        outside: from the code to the legend.
        border: from the legend to the end of the sheet.
        angle: where the first quadrant of the chequered disc and the first bit begin, radians.
        is_chequered: the central figure is a chequered disc, else a plain one.
        is_white: the sheet is white and figures black, else the reverse.
        zero_is_sheet: bits of 0 have the colour of the sheet.
        grows: bits follow each other with growing angles.
        in_rows: bits stand in rows above and below the figure (drone sheets).
        at_top: the figure stands at the top of the sheet, and both rows below.
        mark: half diagonal of the diamond that shows the first direction; negative for none.
        mark_place: its centre, from the middle, in the directions `angle` + 45 degrees and across.
        rings: radius of the rings for surveyors in the middle; negative for none.
        is_lower_row_forwards: lower rows are read left to right, as drawn before August 2023.
    """

    family: str
    inside: float
    code: float
    outside: float
    border: float
    angle: float = 0.0
    is_chequered: bool = True
    is_white: bool = True
    zero_is_sheet: bool = True
    grows: bool = True
    in_rows: bool = False
    at_top: bool = False
    mark: float = -1.0
    mark_place: tuple[float, float] = (0.0, 0.0)
    rings: float = -1.0
    is_lower_row_forwards: bool = False

    def __post_init__(self) -> None:
        widths = {"inside": self.inside, "code": self.code, "outside": self.outside, "border": self.border}
        for name, width in widths.items():
            if not 0.0 <= width < 100.0:
                raise InputError(f"geometry of a target: {name} is {width}; 0 to 100 units are possible")
        if not math.isfinite(self.angle):
            raise InputError(f"geometry of a target: the angle {self.angle} is not finite")
        if not self.in_rows and self.code == 0.0:
            raise InputError("geometry of a target: the ring of the code has no width")

    @cached_property
    def radii(self) -> tuple[float, float, float, float]:
        """Where the code begins and ends, where the legend begins, and half the width of the sheet."""
        begin = 1.0 + self.inside
        end = begin + self.code
        legend = end + self.outside
        return begin, end, legend, legend + self.border

    @property
    def sheet(self) -> tuple[float, float, float, float]:
        """Left, right, upper and lower edge of the sheet."""
        half = self.radii[3]
        if self.at_top:
            return -half, half, -half, half * (2.0 * SHEETS - 1.0)
        height = half * SHEETS if self.in_rows else half
        return -half, half, -height, height


@dataclass(frozen=True)
class Raster:
    """A drawing of pixels.

    Attributes:
        width: pixels.
        height: pixels.
        middle: pixel of the centre of the figure.
        scale: pixels in a unit.
    """

    width: int
    height: int
    middle: tuple[float, float]
    scale: float


@dataclass(frozen=True)
class Specification:
    """A set of coded targets.

    Attributes:
        geometry: where ink is.
        bits: length of the codes.
        frequency: how many turns of a target look alike.
        codes: least code of the class of each name, in the order of names.
        numbers: number of each name.
        distance: least number of bits in which codes differ, as asked for when they were chosen.
        runs: longest runs of zeros and of ones, as asked for.
        parity: 1 odd numbers of ones, 2 even, 3 all.
        most: how many codes were asked for at most.
        base: of the numbers in the names.
        digits: of these numbers.
        before: what names begin with.
        uses_hamming: codes are the words of a Hamming code.
        prefix: what the names of its files begin with.

    Raises:
        InputError: two names have codes of one class, or a code has more bits.
    """

    geometry: Geometry
    bits: int
    frequency: int
    codes: Mapping[str, int]
    numbers: Mapping[str, int]
    distance: int = 1
    runs: tuple[int, int] = (1000, 1000)
    parity: int = 3
    most: int = 1000
    base: int = 10
    digits: int = 2
    before: str = ""
    uses_hamming: bool = False
    prefix: str = ""

    def __post_init__(self) -> None:
        check_bits(self.bits, self.frequency)
        if not self.codes:
            raise InputError(f"targets {self.prefix or self.family}: there is no code")
        seen: dict[int, str] = {}
        for name, code in self.codes.items():
            if not 0 <= code < 1 << self.bits:
                raise InputError(f"target {name}: the code {code} has more than {self.bits} bits")
            other = seen.setdefault(min(members(code, self.bits, self.frequency)), name)
            if other != name:
                raise InputError(f"targets {other} and {name}: their codes are the same when turned")

    @property
    def family(self) -> str:
        """IGNIndoor, IGNDroneSym, IGNDroneTop or CERN."""
        return self.geometry.family

    @cached_property
    def raster(self) -> Raster:
        """The drawing before it is reduced."""
        width = _even(DRAWING)
        height = _even(DRAWING * SHEETS) if self.geometry.in_rows else width
        middle = (width - REDUCTION) / 2, ((width if self.geometry.at_top else height) - REDUCTION) / 2
        return Raster(width, height, middle, width / (2.0 * self.geometry.radii[3]))

    @cached_property
    def turns(self) -> dict[int, list[tuple[str, int]]]:
        """Of each code that a target can show: its name, and by how many bits it is turned.

        A code that is its own rotation has several.
        """
        period = self.bits // self.frequency
        found: dict[int, list[tuple[str, int]]] = {}
        for name, code in self.codes.items():
            for k in range(self.frequency):
                found.setdefault(rotated(code, self.bits, period * k), []).append((name, period * k))
        return found

    @cached_property
    def class_distance(self) -> int:
        """Least number of bits in which two targets of the set differ."""
        return least_distance(self.codes.values(), self.bits, self.frequency)

    def apart(self, name: str, is_readable: BoolArray) -> int:
        """Number of the bits that can be read, (bits,), in which the nearest other target differs."""
        others = [code for code, seen in self.turns.items() if name not in dict(seen)]
        away = (np.array(others, dtype=np.int64) ^ self.codes[name]) & _mask(is_readable)
        return int(counted(away).min(initial=self.bits))

    def chance(self, is_readable: BoolArray) -> float:
        """Share of all patterns of the bits that can be read, (bits,), that targets of the set have."""
        mask = _mask(is_readable)
        return len({code & mask for code in self.turns}) / float(1 << int(is_readable.sum()))

    @cached_property
    def letters(self) -> int:
        """Number of the letters of its longest name."""
        return max(map(len, self.codes))

    def code_of(self, name: str) -> int:
        """The code of a name.

        Raises:
            InputError: the set has no such name.
        """
        if name not in self.codes:
            raise InputError(f"targets {self.prefix}: there is no {nearest(name, self.codes)}")
        return self.codes[name]

    def fit_matrix(self) -> FloatArray:
        """(2, 2) directions of the central figure's first two corners, as columns."""
        c, s = math.cos(self.geometry.angle), math.sin(self.geometry.angle)
        return np.array([[c, -s], [s, c]])


def extent(spec: Specification) -> float:
    """What is called the size of a target, in units: across its code; the height of sheets with rows."""
    _, _, top, bottom = spec.geometry.sheet
    return bottom - top if spec.geometry.in_rows else 2.0 * spec.geometry.radii[1]


def _even(pixels: float) -> int:
    """Rounded so that the reduced drawing has whole and even sizes."""
    step = 2 * REDUCTION
    return step * math.floor(pixels / step + 0.5)


def are_set(word: int, bits: int) -> BoolArray:
    """(bits,) which bits of a word are 1."""
    found: BoolArray = (word >> np.arange(bits)) & 1 == 1
    return found


def _mask(bits: BoolArray) -> int:
    """The word in which some bits, (bits,), are 1."""
    return sum(1 << k for k in np.flatnonzero(bits).tolist())
