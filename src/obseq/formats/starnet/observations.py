"""Observations of STAR*NET files: single lines, lines of several, direction sets, traverses, side shots."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property

from obseq.dataclass import dataclass
from obseq.formats.columns import Columns, Measure
from obseq.formats.default_sigmas import lacking
from obseq.formats.starnet.values import NOT_MEASURED, Line, Sigma, split_rest
from obseq.formats.stochastic import LIBRARY, NAME_OF, Sigmas, StochasticModel, read_stochastic
from obseq.survey.kinds.directions import ANGLE, AZIM, HZ, ZEN
from obseq.survey.kinds.kind import ObservationKind
from obseq.survey.kinds.lengths import DH, DIST, DIST_HZ
from obseq.survey.model import Orientation

FULL_TURN = 2.0 * math.pi
KILOMETRE = 1000.0
SHORT = 10.0
"""Length (m) of a line of levels below which it is likely in kilometres, or a number of turns."""
CODES = ("a", "d", "v", "dv", "b", "bm", "m", "db", "dn", "dm", "de", "tb", "t", "te", "ss", "l")
SIDE_SHOT = "ss"
USUAL = "total-station-5sec"
"""What side shots without standard errors are worth: only the precisions of their own points show it."""
Heights = tuple[float, float]


@dataclass
class _Leg:
    """A line of a traverse, whose foresight is the next one's point."""

    line: Line
    back: str | float


class ObservationLines:
    """Takes lines of observations into columns.

    Attributes:
        warnings: What has been left out, one sentence each.
        centred: Rows of observations in whose standard deviations centring is to be.
    """

    def __init__(self, columns: Columns, files: Mapping[str, int], model: StochasticModel) -> None:
        self._columns, self._files, self._model = columns, files, model
        self._of: dict[str, Sigmas] = {}
        self.centred: list[int] = []
        self._set: tuple[str, int] | None = None
        self._plumb: dict[int, int] = {}
        self._leg: _Leg | None = None
        self._back: str | float | None = None
        self._last: Line | None = None
        self._shots: list[tuple[Line, str]] = []
        self._ways: list[tuple[float, Line]] = []
        self._bare: list[Line] = []
        self.warnings: list[str] = []

    def read(self, line: Line) -> None:
        """Takes one line."""
        self._last = line
        code = line.fields[0].lower()
        if len(line.fields) < 2 and code != "de":
            raise line.error(f"{line.fields[0]} is followed by names of points")
        getattr(self, f"_read_{code}")(line)

    def finish(self) -> None:
        """Looks at what must not be open at the end; side shots become observations of their points."""
        if self._last is not None and (self._set or self._leg or self._back is not None):
            open_one = "direction set (DB without DE)" if self._set else "traverse (TB without TE)"
            raise self._last.error(f"the file ends in an open {open_one}")
        self._look_at_ways()
        named = set(self._columns.names)
        count: dict[str, int] = {}
        for _, target in self._shots:
            count[target] = count.get(target, 0) + 1
        for line, target in self._shots:
            if target in named or count[target] > 1:
                self.warnings.append(
                    f"{line.file.name}:{line.index + 1}: side shot to {target}, which other lines "
                    "determine: it has no part in the adjustment"
                )
            else:
                self._angle_and_more(line)
        if self._bare:
            many, first = len({id(line) for line in self._bare}), self._bare[0]
            self.warnings.append(
                f"{first.file.name}:{first.index + 1}: {many} side shots have no standard errors (this is "
                "the first). No other point depends on them; the precisions of theirs are those that "
                f"{USUAL} of the library gives, unless --sigmas, or the lines, say better"
            )

    def _look_at_ways(self) -> None:
        """Warns of lines of levels that are too short for their sigma to come from their length."""
        short = [(way, line) for way, line in self._ways if 0.0 < way < SHORT]
        if short:
            way, line = short[0]
            more = f", and {len(short) - 1} more are as short" if len(short) > 1 else ""
            self.warnings.append(
                f"{line.file.name}:{line.index + 1}: a line of levels of {way:g} m{more}: its length is in "
                "the unit of the other lengths (.UNITS), neither in kilometres or miles nor a number of "
                "turns; where it is one of these, write the standard errors in the lines"
            )

    # Single lines

    def _read_a(self, line: Line) -> None:
        at, back, to = line.three(line.fields[1])
        value = line.angle(self._value(line, 2))
        (sigma,), _ = split_rest(line, line.fields[3:], (True,))
        self._add(line, ANGLE, at, to, value % FULL_TURN, sigma, backsight=back)

    def _read_d(self, line: Line) -> None:
        start, to = line.names(line.fields[1], 2)
        value = line.length(self._value(line, 2))
        (sigma,), heights = split_rest(line, line.fields[3:], (False,))
        self._add_distance(line, start, to, value, sigma, heights)

    def _read_v(self, line: Line) -> None:
        self._require_space(line)
        start, to = line.names(line.fields[1], 2)
        text = self._value(line, 2)
        (sigma,), heights = split_rest(line, line.fields[3:], (not line.options.delta,))
        self._add_vertical(line, start, to, text, sigma, heights)

    def _read_dv(self, line: Line) -> None:
        self._require_space(line)
        start, to = line.names(line.fields[1], 2)
        distance, vertical = self._value(line, 2), self._value(line, 3)
        (first, second), heights = split_rest(line, line.fields[4:], (False, not line.options.delta))
        self._add_distance(line, start, to, line.length(distance), first, heights)
        self._add_vertical(line, start, to, vertical, second, heights)

    def _read_b(self, line: Line) -> None:
        start, to = line.names(line.fields[1], 2)
        value = line.bearing(self._value(line, 2))
        (sigma,), _ = split_rest(line, line.fields[3:], (True,))
        self._add(line, AZIM, start, to, value % FULL_TURN, sigma)

    def _read_l(self, line: Line) -> None:
        self._require_space(line)
        start, to = line.names(line.fields[1], 2)
        rise = line.length(self._value(line, 2))
        way, rest = 0.0, line.fields[3:]
        if rest and rest[0] not in ("!", "*", "&"):
            way, rest = line.length(rest[0]), rest[1:]
        (sigma,), heights = split_rest(line, rest, (False,))
        if sigma.value is None and sigma.is_active:
            if way > 0.0 and "height-per-turn" in self._given(line):  # what stands there counts turns
                turns = way / line.options.metres
                sigma = Sigma(self._default(line, "height-per-turn") * math.sqrt(turns))
            else:
                self._ways.append((way, line))
                read = f" ({self._value(line, 3)} is read as the length of the line)" if way > 0.0 else ""
                per_root = self._default(line, "height-per-km", read) if way > 0.0 else 0.0
                sigma = Sigma(per_root * math.sqrt(way / KILOMETRE) or None)
        self._add(line, DH, start, to, rise, sigma, heights)

    # Lines of several

    def _read_bm(self, line: Line) -> None:
        start, to = line.names(line.fields[1], 2)
        texts, sigmas, heights = self._values(line, 2)
        if texts[0] != NOT_MEASURED:
            self._add(line, AZIM, start, to, line.bearing(texts[0]) % FULL_TURN, sigmas[0])
        self._add_polar(line, start, to, texts, sigmas, heights)

    def _read_m(self, line: Line) -> None:
        self._angle_and_more(line)

    def _angle_and_more(self, line: Line) -> None:
        at, back, to = line.three(line.fields[1])
        self._add_angle_and_more(line, at, back, to)

    def _add_angle_and_more(self, line: Line, at: str, back: str | float, to: str) -> None:
        texts, sigmas, heights = self._values(line, 2)
        if texts[0] == NOT_MEASURED:
            pass
        elif isinstance(back, float):
            self._add(line, AZIM, at, to, (back + line.angle(texts[0])) % FULL_TURN, sigmas[0])
        else:
            self._add(line, ANGLE, at, to, line.angle(texts[0]) % FULL_TURN, sigmas[0], backsight=back)
        self._add_polar(line, at, to, texts, sigmas, heights)

    def _read_ss(self, line: Line) -> None:
        self._shots.append((line, line.three(line.fields[1])[2]))

    # Direction sets

    def _read_db(self, line: Line) -> None:
        if self._set is not None:
            raise line.error("a direction set is open: it ends with DE")
        (at,) = line.names(line.fields[1], 1)
        self._set = at, self._columns.open_station(self._row(line, at), Orientation.VERT)

    def _read_dn(self, line: Line) -> None:
        at, station = self._open_set(line)
        (to,) = line.names(line.fields[1], 1)
        value = line.angle(self._value(line, 2))
        (sigma,), _ = split_rest(line, line.fields[3:], (True,))
        self._add(line, HZ, at, to, value % FULL_TURN, sigma, station=station)

    def _read_dm(self, line: Line) -> None:
        at, station = self._open_set(line)
        (to,) = line.names(line.fields[1], 1)
        texts, sigmas, heights = self._values(line, 2)
        if texts[0] != NOT_MEASURED:
            self._add(line, HZ, at, to, line.angle(texts[0]) % FULL_TURN, sigmas[0], station=station)
        self._add_polar(line, at, to, texts, sigmas, heights)

    def _read_de(self, line: Line) -> None:
        self._open_set(line)
        self._set = None

    def _open_set(self, line: Line) -> tuple[str, int]:
        if self._set is None:
            raise line.error(f"{line.fields[0]} stands in a direction set, which begins with DB")
        return self._set

    # Traverses

    def _read_tb(self, line: Line) -> None:
        if self._leg or self._back is not None:
            raise line.error("a traverse is open: it ends with TE")
        if len(line.fields) != 2:
            raise line.error("TB is followed by the backsight: its name, or a bearing")
        self._back = self._backsight(line, line.fields[1])

    @staticmethod
    def _backsight(line: Line, text: str) -> str | float:
        """The name of a backsight, or its azimuth."""
        azimuth = line.fixed_bearing(text)
        return line.names(text, 1)[0] if azimuth is None else azimuth

    def _read_t(self, line: Line) -> None:
        (at,) = line.names(line.fields[1], 1)
        self._continue(line, at)
        if self._back is None:
            raise line.error("T stands in a traverse, which begins with TB")
        self._leg = _Leg(line, self._back)
        self._back = at

    def _read_te(self, line: Line) -> None:
        if self._leg is None:
            raise line.error("TE ends a traverse, which begins with TB and T")
        (at,) = line.names(line.fields[1], 1)
        self._continue(line, at)
        if len(line.fields) > 2:
            if len(line.fields) < 4:
                raise line.error("TE is: TE name, or TE name angle target [standard error]")
            assert isinstance(self._back, str)
            self._close(line, at, self._back)
        self._leg = self._back = None

    def _close(self, line: Line, at: str, back: str) -> None:
        """The last angle of a traverse: to a point, or to a fixed bearing."""
        (sigma,), _ = split_rest(line, line.fields[4:], (True,))
        value, to = line.angle(line.fields[2]), self._backsight(line, line.fields[3])
        if isinstance(to, float):
            self._add(line, AZIM, at, back, (to - value) % FULL_TURN, sigma)
        else:
            self._add(line, ANGLE, at, to, value % FULL_TURN, sigma, backsight=back)

    def _continue(self, line: Line, target: str) -> None:
        """The line before, now that its foresight is known."""
        if self._leg is not None:
            leg = self._leg
            at = leg.line.fields[1]
            if len({at, leg.back, target}) < 3:
                raise line.error("a leg of the traverse names a point twice; correct one of the names")
            self._add_angle_and_more(leg.line, at, leg.back, target)

    # What they become

    @staticmethod
    def _value(line: Line, place: int) -> str:
        if len(line.fields) <= place:
            raise line.error(f"{len(line.fields)} fields, and a value is expected after them")
        return line.fields[place]

    def _values(self, line: Line, place: int) -> tuple[tuple[str, ...], list[Sigma], Heights]:
        """Angle, distance and, in space, what is vertical; their sigmas; heights of instrument and target."""
        count = 2 if line.options.is_plane else 3
        texts = line.fields[place : place + count]
        if len(texts) < count or "/" in "".join(texts):
            wanted = "angle, distance" + ("" if count == 2 else " and zenith angle (or height difference)")
            raise line.error(f"the line holds {wanted}; `?` stands for what was not measured")
        angles = (True, False) if count == 2 else (True, False, not line.options.delta)
        sigmas, heights = split_rest(line, line.fields[place + count :], angles)
        return texts, sigmas, heights

    def _add_polar(
        self, line: Line, start: str, to: str, texts: tuple[str, ...], sigmas: list[Sigma], heights: Heights
    ) -> None:
        if texts[1] != NOT_MEASURED:
            self._add_distance(line, start, to, line.length(texts[1]), sigmas[1], heights)
        if len(texts) > 2 and texts[2] != NOT_MEASURED:
            self._add_vertical(line, start, to, texts[2], sigmas[2], heights)

    def _add_distance(
        self, line: Line, start: str, to: str, value: float, sigma: Sigma, heights: Heights
    ) -> None:
        if value <= 0.0:
            raise line.error(f"the distance {value:g} is not positive")
        is_flat = bool(line.options.is_plane) or line.options.delta
        kind, lifts = (DIST_HZ, (0.0, 0.0)) if is_flat else (DIST, heights)
        self._add(line, kind, start, to, value, sigma, lifts)

    def _add_vertical(
        self, line: Line, start: str, to: str, text: str, sigma: Sigma, heights: Heights
    ) -> None:
        if line.options.delta:
            self._add(line, DH, start, to, line.length(text), sigma, heights)
            return
        self._add(line, ZEN, start, to, line.angle(text) % FULL_TURN, sigma, heights)

    def _add(
        self,
        line: Line,
        kind: ObservationKind,
        start: str,
        to: str,
        value: float,
        sigma: Sigma,
        heights: Heights = (0.0, 0.0),
        *,
        station: int = -1,
        backsight: str = "",
    ) -> None:
        origin, target = self._row(line, start), self._row(line, to)
        if origin == target:
            raise line.error(f"{start} is observed from itself; correct one of the names")
        if station < 0:
            station = self._columns.station_of(kind, origin, self._plumb)
        deviation, relative = self._sigma_parts(line, kind, sigma)
        third = self._row(line, backsight) if backsight else -1
        group = self._columns.instrument(line.options.instrument)
        if sigma.is_active and (sigma.value is None or (line.options.adds_centring and not sigma.is_fixed)):
            self.centred.append(len(self._columns))
        measure = Measure(
            kind, origin, target, value, deviation, sigma.is_active, relative, *heights, station, group, third
        )
        self._columns.append(measure, self._files[line.file.name], line.index)

    def _sigma_parts(self, line: Line, kind: ObservationKind, sigma: Sigma) -> tuple[float, float]:
        """Standard deviation and its part of the distance."""
        if sigma.value is not None:
            return sigma.value, 0.0
        if not sigma.is_active:
            return 1.0, 0.0
        name = NAME_OF[kind]
        if name not in self._given(line) and line.fields[0].lower() == SIDE_SHOT:
            self._bare.append(line)
            if name in self._usual:
                return self._usual[name], self._usual["distance-ppm"] if name == "distance" else 0.0
        relative = self._given(line).get("distance-ppm", 0.0) if name == "distance" else 0.0
        return self._default(line, name), relative

    @cached_property
    def _usual(self) -> Sigmas:
        """What side shots are worth where nothing says it."""
        usual = read_stochastic(LIBRARY).instruments[USUAL]
        return {**usual, "azimuth": usual["direction"]}

    def _given(self, line: Line) -> Sigmas:
        """Standard deviations of the instrument of a line."""
        name = line.options.instrument
        found = self._of.get(name)
        if found is None:
            found = self._of[name] = self._model.of(name)
        return found

    def _default(self, line: Line, name: str, more: str = "") -> float:
        given = self._given(line)
        problem = lacking(name, given)
        if problem:
            raise line.error(problem + more)
        return given[name]

    def _row(self, line: Line, name: str) -> int:
        return self._columns.point(line.file, line.index, name)

    @staticmethod
    def _require_space(line: Line) -> None:
        if line.options.is_plane:
            raise line.error(
                f"{line.fields[0]} measures heights, and the network is 2D; write .3D before its points"
            )
