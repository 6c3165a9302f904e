"""The ground that rays are cut with: a constant height, or a terrain model on a regular grid."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import numpy as np
import numpy.typing as npt

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.images.aerial.heights import HeightType
from obseq.reading.text import check_file, read_bytes, start_of

_HEADER = ("ncols", "nrows", "xllcorner", "yllcorner", "xllcenter", "yllcenter", "cellsize", "nodata_value")


class Surface(Protocol):
    """A ground: one z for each point of the map."""

    @property
    def height_type(self) -> HeightType | None:
        """What z is counted from; None is the type of the shots."""

    def z(self, plan: FloatArray) -> FloatArray:
        """Heights (n,) under map points (n, 2); nan where there is none."""


@dataclass(frozen=True)
class ConstantHeight:
    """A ground of one z everywhere.

    Attributes:
        value: its z, metres.
        height_type: what it is counted from; None is the type of the shots.
    """

    value: float
    height_type: HeightType | None = None

    def z(self, plan: FloatArray) -> FloatArray:
        """The z (n,) under map points (n, 2)."""
        return np.full(len(plan), self.value)


@dataclass(frozen=True)
class Terrain:
    """A terrain model: z at the centres of the cells of a grid whose rows run along the map, north up.

    Between centres z is bilinear; in the outer half cell the border is continued; outside, and where a
    neighbour that counts holds no data, z is nan.

    Attributes:
        values: (rows, columns) z of cells, the northernmost row first; nan without data.
        west: map x of the western border.
        north: map y of the northern border.
        cell: (width, height) of a cell, metres, both positive.
        height_type: what z is counted from.
    """

    values: FloatArray
    west: float
    north: float
    cell: tuple[float, float]
    height_type: HeightType | None

    def z(self, plan: FloatArray) -> FloatArray:
        """Z (n,) under map points (n, 2); nan outside and in holes."""
        rows, columns = self.values.shape
        column = (plan[:, 0] - self.west) / self.cell[0] - 0.5
        row = (self.north - plan[:, 1]) / self.cell[1] - 0.5
        with np.errstate(invalid="ignore"):
            inside = (column >= -0.5) & (column <= columns - 0.5) & (row >= -0.5) & (row <= rows - 0.5)
        left, across = _cells(np.where(inside, column, 0.0), columns)
        top, down = _cells(np.where(inside, row, 0.0), rows)
        right, bottom = np.minimum(left + 1, columns - 1), np.minimum(top + 1, rows - 1)
        upper = _mixed(self.values[top, left], self.values[top, right], across)
        lower = _mixed(self.values[bottom, left], self.values[bottom, right], across)
        return np.where(inside, _mixed(upper, lower, down), np.nan)


def read_terrain(path: str | Path, height_type: HeightType | None) -> Terrain:
    """A terrain model from an ESRI ASCII grid, or through rasterio from any raster that GDAL reads.

    Raises:
        InputError: absent, not a grid, rotated, or another format while rasterio is not installed.
    """
    place = Path(path)
    if not place.is_file():
        raise InputError(f"{path}: there is no such terrain model; check the path")
    if _is_ascii_grid(place):
        return _ascii_terrain(place, height_type)
    return _raster_terrain(place, height_type)


def _cells(position: FloatArray, count: int) -> tuple[npt.NDArray[np.int64], FloatArray]:
    """Index of the cell before each position, and the share of the next one."""
    held = np.clip(position, 0.0, count - 1.0)
    before = np.minimum(np.floor(held).astype(np.int64), max(count - 2, 0))
    return before, held - before


def _mixed(first: FloatArray, second: FloatArray, share: FloatArray) -> FloatArray:
    """First (1 - share) + second share; a neighbour of share zero does not count."""
    mixed = first * (1.0 - share) + second * share
    return np.where(share == 0.0, first, np.where(share == 1.0, second, mixed))


def _is_ascii_grid(path: Path) -> bool:
    return start_of(path, 64).lstrip().lower().startswith(b"ncols")


def _ascii_terrain(path: Path, height_type: HeightType | None) -> Terrain:
    lines = read_bytes(path).decode("latin-1").splitlines()
    header, first = _ascii_header(path, lines)
    shape = (int(header["nrows"]), int(header["ncols"]))
    values = _ascii_values(path, lines[first:], shape)
    values[values == header.get("nodata_value", -9999.0)] = np.nan
    size = header["cellsize"]
    half = size / 2.0
    west = header["xllcorner"] if "xllcorner" in header else header["xllcenter"] - half
    south = header["yllcorner"] if "yllcorner" in header else header["yllcenter"] - half
    return Terrain(values, west, south + shape[0] * size, (size, size), height_type)


def _ascii_header(path: Path, lines: list[str]) -> tuple[dict[str, float], int]:
    """Keys and values of the header, and the index of the first line behind it."""
    header: dict[str, float] = {}
    for index, line in enumerate(lines):
        words = line.split()
        if not words or words[0].lower() not in _HEADER:
            break
        try:
            header[words[0].lower()] = float(words[1])
        except (IndexError, ValueError):
            raise InputError(
                f"{path}:{index + 1}: {line.strip()!r} needs a number behind {words[0]}"
            ) from None
    corner = ("xllcorner" in header or "xllcenter" in header) and (
        "yllcorner" in header or "yllcenter" in header
    )
    if not corner or not {"ncols", "nrows", "cellsize"} <= header.keys():
        raise InputError(
            f"{path}: header incomplete: ncols, nrows, xllcorner, yllcorner and cellsize are needed"
        )
    if min(header["ncols"], header["nrows"], header["cellsize"]) <= 0:
        raise InputError(f"{path}: ncols, nrows and cellsize must be positive")
    return header, len(header)


def _ascii_values(path: Path, lines: list[str], shape: tuple[int, int]) -> FloatArray:
    try:
        values = np.array(" ".join(lines).split(), dtype=np.float64)
    except ValueError as error:
        raise InputError(f"{path}: a value of the grid is not a number: {error}") from None
    if values.size != shape[0] * shape[1]:
        raise InputError(f"{path}: holds {values.size} values, its header says {shape[0]} x {shape[1]}")
    return values.reshape(shape)


def _raster_terrain(path: Path, height_type: HeightType | None) -> Terrain:
    try:
        import rasterio
    except ImportError:
        raise InputError(
            f"{path}: only ESRI ASCII grids are read without rasterio; install it (pip install rasterio)"
        ) from None
    try:
        check_file(path)
        with rasterio.open(path) as raster:
            place, values = raster.transform, raster.read(1, masked=True)
    except rasterio.errors.RasterioError as error:
        raise InputError(f"{path}: not a raster that can be read: {error}") from None
    if place.b or place.d or place.a <= 0 or place.e >= 0:
        raise InputError(f"{path}: the raster is rotated or not north up; resample it first")
    filled = np.ma.filled(values.astype(np.float64), np.nan)
    return Terrain(filled, place.c, place.f, (place.a, -place.e), height_type)
