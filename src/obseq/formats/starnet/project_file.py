"""Project files of STAR*NET (`.snproj`, `.prj`): what they say beside the data files that they list.

Text in sections: `[Adjustment]` with dimension, units, orders, refraction and grid; `[Instrument]` with the
standard errors of all instruments, `[InstrumentLibrary]` with those of named ones; `[DataFileList]` with a
number and a name a line, of which bit 1 says whether the file takes part. Lengths are metres whatever the
unit of the data, angles arc seconds (milligon where angles are in gon), levelling metres per root of a metre.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from obseq.dataclass import dataclass
from obseq.formats.starnet.values import FEET, Options
from obseq.formats.stochastic import Sigmas, StochasticModel
from obseq.reading.angles import GON, SECOND
from obseq.reading.text import TextFile, read_text

LIBRARY, FILES = "instrumentlibrary", "datafilelist"
KILOMETRE = 1000.0
UNITS = {"meters": 1.0, **FEET}
_CODES = (3154, 3155, 3156, 3157, 2955, 2956, 2957, 3158, 3159, 3160, 2958, 2959, 2960, 2961, 2962, 3761)
CSRS = dict(enumerate(_CODES, start=7))
"""EPSG codes of UTM zones of NAD83(CSRS)."""
_FILE = re.compile(r'(\d+)\s+"([^"]+)"')
_GRID = re.compile(r"UTM(83|83/CSRS|84)-(\d{1,2})N?", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class ProjectFile:
    """What a project says.

    Attributes:
        files: Names of the data files that take part.
        others: Names of those that do not.
        options: In force at the first line of data.
        model: What observations are worth.
        points_crs: Definition of the grid; None for a local project, or a grid that is not known here.
        grid: What the project calls it; empty for a local project.
    """

    files: tuple[str, ...]
    others: tuple[str, ...]
    options: Options
    model: StochasticModel
    points_crs: str | None
    grid: str


def read_project_file(path: Path, encoding: str) -> ProjectFile:
    """Reads a project file.

    Raises:
        InputError: It lists no data file that takes part, or a value is not what it must be, with its line.
    """
    file = read_text(path, encoding)
    found = _Settings(file)
    files = tuple(name for name, takes_part in found.files if takes_part)
    others = tuple(name for name, takes_part in found.files if not takes_part)
    if not files:
        raise file.error(0, "the project lists no data file that takes part; switch one on in STAR*NET")
    has_gons = found.word("angle_output_units", "dms").startswith("gon")
    options = Options(
        metres=found.unit("linear_units"),
        has_gons=has_gons,
        is_plane=found.word("adjustment_type", "3d") == "2d",
        east_first=found.word("coordinate_order", "ne") == "en",
        from_first=found.word("angle_station_order", "at-from-to").startswith("from"),
        delta=found.word("3d_input_mode", "slope").startswith("horiz"),
        refraction=2.0 * found.number("index_of_refraction", 0.07),
    )
    angle = GON * 1e-3 if has_gons else SECOND
    instruments = {name: _sigmas(given, angle) for name, given in found.library.items()}
    model = StochasticModel(_sigmas(found.numbers, angle), instruments)
    is_grid = found.word("local_or_grid_adjustment", "0") == "1"
    grid = found.text("coordinate_system_name", "grid") if is_grid else ""
    return ProjectFile(files, others, options, model, _system(grid), grid)


def _sigmas(given: dict[str, float], angle: float) -> Sigmas:
    """Standard deviations by our names; one of 0 is none."""
    units = {
        "distance": ("distance_std_err", 1.0),
        "distance-ppm": ("edm_ppm", 1e-6),
        "angle": ("angle_std_err", angle),
        "direction": ("direction_std_err", angle),
        "azimuth": ("azimuth_std_err", angle),
        "zenith": ("zenith_std_err", angle),
        "height": ("delta_elev_std_err", 1.0),
        "height-per-km": ("level_std_err", KILOMETRE**0.5),
        "instrument-centring": ("instrument_centering_error", 1.0),
        "target-centring": ("target_centering_error", 1.0),
        "vertical-centring": ("vertical_centering_error", 1.0),
    }
    found = {ours: given[theirs] * unit for ours, (theirs, unit) in units.items() if theirs in given}
    return {name: value for name, value in found.items() if value > 0.0}


def _system(grid: str) -> str | None:
    """The definition of a grid by its name in STAR*NET."""
    found = _GRID.fullmatch(grid)
    if found is None:
        return None
    zone = int(found[2])
    codes = {"83": 26900 + zone, "84": 32600 + zone, "83/CSRS": CSRS.get(zone)}
    code = codes[found[1].upper()]
    return f"EPSG:{code}" if code and 1 <= zone <= 60 else None


class _Settings:
    """The lines of a project file."""

    def __init__(self, file: TextFile) -> None:
        self._file = file
        self._texts: dict[str, tuple[int, str]] = {}
        self.numbers: dict[str, float] = {}
        self.library: dict[str, dict[str, float]] = {}
        self.files: list[tuple[str, bool]] = []
        section, instrument = "", ""
        for index, line in self._lines():
            if line.startswith("["):
                section = line.strip("[] ").lower()
                continue
            listed = _FILE.match(line)
            if section == FILES and listed:
                self.files.append((listed[2], bool(int(listed[1]) & 1)))
                continue
            name, _, value = line.replace("=", " ", 1).partition(" ")
            name, value = name.lower(), value.strip()
            if section == LIBRARY and name == "instrument_name":
                instrument = value
                self.library[instrument] = {}
            elif section == LIBRARY and instrument:
                self._keep(self.library[instrument], index, name, value)
            elif section in ("adjustment", "instrument"):
                self._texts.setdefault(name, (index, value))
                self._keep(self.numbers, index, name, value)

    def _lines(self) -> Iterator[tuple[int, str]]:
        for index, text in enumerate(self._file.lines):
            line = " ".join(text.split())
            if line and not line.startswith(("#", "*")):
                yield index, line

    def _keep(self, held: dict[str, float], index: int, name: str, value: str) -> None:
        """Keeps a standard error or a factor as a number."""
        if name.endswith(("_std_err", "_error", "_ppm", "_refraction")):
            held.setdefault(name, self._file.number(index, value, f"{name}: {{}}"))

    def text(self, name: str, default: str) -> str:
        """A value as written."""
        return self._texts.get(name, (0, ""))[1] or default

    def word(self, name: str, default: str) -> str:
        """A value in lower case."""
        return self.text(name, default).lower()

    def number(self, name: str, default: float) -> float:
        """A value that is a number."""
        return self.numbers.get(name, default)

    def unit(self, name: str) -> float:
        """Metres in the unit of lengths."""
        index, value = self._texts.get(name, (0, "Meters"))
        if value.lower() not in UNITS:
            raise self._file.error(index, f"{name}: the unit is none of {', '.join(UNITS)}")
        return UNITS[value.lower()]
