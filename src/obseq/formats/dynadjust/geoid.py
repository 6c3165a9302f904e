"""Geoid heights and deflections of the vertical: grids (.gsb) and station lists (.geo) of DynAdjust."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.reading.angles import SECOND
from obseq.reading.text import read_bytes, read_text

_RECORD = 16
_OVERVIEW, _SUB_GRID = 11, 11


class Geoid(Protocol):
    """What gives geoid heights and deflections."""

    def at(self, names: Sequence[str], longitudes: FloatArray, latitudes: FloatArray) -> FloatArray:
        """(n, 3) geoid height (m), east and north deflection (rad) of points (rad); NaN where unknown."""


@dataclass(frozen=True, eq=False)
class Grid:
    """A grid of geoid heights and deflections.

    Attributes:
        south: Latitude of the first row of nodes, rad.
        west: Longitude of the first column, rad.
        steps: (2,) of latitude and longitude, rad.
        nodes: (rows, columns, 3) geoid height, east and north deflection; from the south and the west.
    """

    south: float
    west: float
    steps: tuple[float, float]
    nodes: FloatArray

    def at(self, longitudes: FloatArray, latitudes: FloatArray) -> FloatArray:
        """(n, 3) bilinear values; NaN outside."""
        rows = (latitudes - self.south) / self.steps[0]
        columns = (np.remainder(longitudes - self.west + 1e-12, 2.0 * math.pi) - 1e-12) / self.steps[1]
        height, width, _ = self.nodes.shape
        inside = (rows >= -1e-9) & (rows <= height - 1 + 1e-9) & (columns <= width - 1 + 1e-9)
        result = np.full((len(rows), 3), np.nan)
        r, c = np.clip(rows[inside], 0, height - 1), np.clip(columns[inside], 0, width - 1)
        i, j = np.minimum(r.astype(int), height - 2), np.minimum(c.astype(int), width - 2)
        u, v = (r - i)[:, None], (c - j)[:, None]
        lower = self.nodes[i, j] * (1.0 - v) + self.nodes[i, j + 1] * v
        upper = self.nodes[i + 1, j] * (1.0 - v) + self.nodes[i + 1, j + 1] * v
        result[inside] = lower * (1.0 - u) + upper * u
        return result


@dataclass(frozen=True, eq=False)
class Grids:
    """Several grids, the finest of which counts."""

    grids: tuple[Grid, ...]

    def at(self, names: Sequence[str], longitudes: FloatArray, latitudes: FloatArray) -> FloatArray:
        """(n, 3) geoid height, east and north deflection; NaN outside all grids."""
        result = np.full((len(names), 3), np.nan)
        for grid in sorted(self.grids, key=lambda grid: -grid.steps[0]):
            found = grid.at(longitudes, latitudes)
            known = np.isfinite(found).all(axis=1)
            result[known] = found[known]
        return result


@dataclass(frozen=True, eq=False)
class StationList:
    """Geoid heights and deflections by the name of the station."""

    values: dict[str, tuple[float, float, float]]

    def at(self, names: Sequence[str], longitudes: FloatArray, latitudes: FloatArray) -> FloatArray:
        """(n, 3) geoid height, east and north deflection; NaN for other stations."""
        nothing = (math.nan, math.nan, math.nan)
        return np.array([self.values.get(name, nothing) for name in names]).reshape(-1, 3)


def read_geoid(path: str | Path, encoding: str = "utf-8") -> Geoid:
    """Reads a file of geoid heights: a grid (.gsb) or a list of stations (.geo).

    Raises:
        InputError: it is neither, or something in it is wrong.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".gsb":
        return _read_grids(Path(path))
    if suffix == ".geo":
        return _read_list(Path(path), encoding)
    raise InputError(f"{path}: geoid files end in .gsb (a grid) or .geo (a list of stations)")


def _read_list(path: Path, encoding: str) -> StationList:
    file = read_text(path, encoding)
    values = {}
    for index, line in enumerate(file.lines):
        if not line.strip() or line.startswith(("*", "!#=DNA")):
            continue
        name = line[:40].strip()
        file.check_name(index, name)
        fields = (line[a:b].strip() for a, b in ((40, 50), (50, 69), (69, 999)))
        said = "{} (columns 1-40: name, 41-50: N, 51-69 and 70 on: deflections north and east, in seconds)"
        height, north, east = (file.number(index, field, said) for field in fields)
        values[name] = (height, east * SECOND, north * SECOND)
    return StationList(values)


def _read_grids(path: Path) -> Grids:
    data = read_bytes(path)
    overview = _entries(path, data, 0, _OVERVIEW)
    count = overview.get("NUM_FILE", b"")
    if "NUM_OREC" not in overview or struct.unpack("<i", count[:4])[0] < 1:
        raise InputError(
            f"{path}: this is not a little-endian grid in the NTv2 layout (NUM_OREC 11, NUM_FILE)"
        )
    grids, position = [], _OVERVIEW * _RECORD
    for _ in range(struct.unpack("<i", count[:4])[0]):
        grid, position = _read_grid(path, data, position)
        grids.append(grid)
    return Grids(tuple(grids))


def _entries(path: Path, data: bytes, position: int, count: int) -> dict[str, bytes]:
    """Records of a header: the label of each, and eight bytes."""
    if len(data) < position + count * _RECORD:
        raise InputError(f"{path}: the grid ends at byte {len(data)}, in the middle of a header")
    starts = range(position, position + count * _RECORD, _RECORD)
    return {data[at : at + 8].decode("latin-1").strip(): data[at + 8 : at + _RECORD] for at in starts}


def _read_grid(path: Path, data: bytes, position: int) -> tuple[Grid, int]:
    """A sub-grid, and where the next one begins; longitudes are positive to the west there."""
    header = _entries(path, data, position, _SUB_GRID)
    keys = ("S_LAT", "N_LAT", "E_LONG", "W_LONG", "LAT_INC", "LONG_INC")
    missing = [key for key in (*keys, "GS_COUNT") if key not in header]
    if missing:
        raise InputError(f"{path}: the header of a sub-grid has no {missing[0]}")
    south, north, east, west, step_north, step_east = (struct.unpack("<d", header[key])[0] for key in keys)
    if not (step_north > 0.0 and step_east > 0.0 and north > south and west > east):
        raise InputError(f"{path}: a sub-grid has no extent")
    height, width = round((north - south) / step_north) + 1, round((west - east) / step_east) + 1
    count, start = struct.unpack("<i", header["GS_COUNT"][:4])[0], position + _SUB_GRID * _RECORD
    if count != height * width or len(data) < start + count * _RECORD:
        raise InputError(f"{path}: a sub-grid of {height} x {width} nodes has {count} records, or ends early")
    nodes = np.frombuffer(data, "<f4", 4 * count, start).reshape(height, width, 4)[:, ::-1].astype(float)
    values = np.dstack([nodes[..., 0], nodes[..., 2] * SECOND, nodes[..., 1] * SECOND])
    steps = (step_north * SECOND, step_east * SECOND)
    return Grid(south * SECOND, -west * SECOND, steps, values), start + count * _RECORD
