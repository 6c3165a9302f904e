"""SINEX files of adjusted points: geocentric coordinates with their full covariance."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import UTC, datetime

import numpy as np

from obseq.arrays import FloatArray
from obseq.crs import geodetic_from_geocentric
from obseq.errors import InputError

AGENCY = "OBQ"
LONGEST = 4
"""Letters of the code of a station."""
_DIGITS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ"


def codes_of(names: Sequence[str]) -> list[str]:
    """A code of four letters for each name: the name itself where it fits, else one that no other has."""
    codes = [name if len(name) <= LONGEST and name.isascii() and name.isalnum() else "" for name in names]
    taken, number = set(codes), 0
    for k, code in enumerate(codes):
        while not code:
            found = "".join(_DIGITS[number // 36**place % 36] for place in (2, 1, 0))
            number += 1
            if number > 36**3:
                raise InputError(f"SINEX: more than {36**3} stations need a code of their own")
            code = "" if f"Z{found}" in taken else f"Z{found}"
        codes[k] = code
    return codes


def held_exactly(name: str) -> InputError:
    """The error of a point that has no covariance."""
    return InputError(
        f"SINEX: point {name} is held exactly and has no covariance; give it a sigma, or take inner "
        "constraints (--datum inner)"
    )


def sinex_text(
    names: Sequence[str],
    geocentric: FloatArray,
    covariance: FloatArray,
    statistics: dict[str, float],
    epoch: datetime | None = None,
    normals: FloatArray | None = None,
) -> str:
    """A SINEX 2.02 file.

    Args:
        names: Of the stations.
        geocentric: (n, 3) m.
        covariance: (3 n, 3 n) m^2.
        statistics: Numbers by their name in SOLUTION/STATISTICS.
        epoch: Of the coordinates; now when None.
        normals: (3 n, 3 n) normal equations of a free network, to which its covariance is the pseudo-inverse;
            divided by the variance factor.

    Raises:
        InputError: A coordinate is held exactly, or there are too many stations.
    """
    if (np.diag(covariance) <= 0.0).any():
        row = int(np.flatnonzero(np.diag(covariance) <= 0.0)[0])
        raise held_exactly(names[row // 3])
    stamp = epoch or datetime.now(UTC)
    codes, time = codes_of(names), _time(stamp)
    lines = [
        f"%=SNX 2.02 {AGENCY} {_time(datetime.now(UTC))} {AGENCY} {time} {time} P {3 * len(names):05d} 2 S"
    ]
    lines += ["+FILE/COMMENT", " coordinates and covariance adjusted by obseq"]
    lines += [f" {code} {name}"[:80] for code, name in zip(codes, names, strict=True) if code != name]
    lines += ["-FILE/COMMENT", "+SITE/ID"]
    lines += map(_site, codes, names, geodetic_from_geocentric(geocentric, names))
    lines += ["-SITE/ID", "+SOLUTION/STATISTICS"]
    lines += [f" {name:<30} {value:22.15E}" for name, value in statistics.items()]
    lines += ["-SOLUTION/STATISTICS", "+SOLUTION/ESTIMATE"]
    values, sigmas = geocentric.ravel().tolist(), np.sqrt(np.diag(covariance)).tolist()
    lines += [*_parameters(codes, time, values, sigmas), "-SOLUTION/ESTIMATE"]
    lines += ["+SOLUTION/MATRIX_ESTIMATE L COVA", *_matrix(covariance), "-SOLUTION/MATRIX_ESTIMATE L COVA"]
    if normals is not None:
        lines += ["+SOLUTION/APRIORI", *_parameters(codes, time, values, [0.0] * len(values))]
        lines += ["-SOLUTION/APRIORI", "+SOLUTION/NORMAL_EQUATION_VECTOR"]
        lines += [*_parameters(codes, time, [0.0] * len(values)), "-SOLUTION/NORMAL_EQUATION_VECTOR"]
        scaled = normals * statistics.get("VARIANCE FACTOR", 1.0)
        lines += ["+SOLUTION/NORMAL_EQUATION_MATRIX L", *_matrix(scaled)]
        lines += ["-SOLUTION/NORMAL_EQUATION_MATRIX L"]
    return "\n".join([*lines, "%ENDSNX"]) + "\n"


def _site(code: str, name: str, place: FloatArray) -> str:
    """The line of a station: longitude (0 to 360), latitude and height are approximate."""
    longitude, latitude = np.rad2deg(place[:2]).tolist()
    east, north = _sexagesimal(longitude % 360.0), _sexagesimal(latitude)
    return f" {code:<4}  A 00000M000 P {name[:22]:<22} {east} {north} {place[2]:7.1f}"


def _sexagesimal(degrees: float) -> str:
    """Degrees, minutes and seconds to a tenth."""
    minutes, tenths = divmod(round(abs(degrees) * 36000.0), 600)
    whole = f"{'-' if degrees < 0.0 else ''}{minutes // 60}"
    return f"{whole:>3} {minutes % 60:2d} {tenths / 10.0:4.1f}"


def _parameters(
    codes: Sequence[str], time: str, values: Sequence[float], sigmas: Sequence[float] | None = None
) -> Iterator[str]:
    """The lines of parameters, with a column of sigmas or without."""
    for k, value in enumerate(values):
        head = f" {k + 1:5d} STA{'XYZ'[k % 3]}   {codes[k // 3]:<4}  A    1 {time} m    2 {value:21.14E}"
        yield head if sigmas is None else f"{head} {sigmas[k]:11.5E}"


def _matrix(covariance: FloatArray) -> Iterator[str]:
    for row, numbers in enumerate(covariance.tolist()):
        for column in range(0, row + 1, 3):
            part = " ".join(f"{value:21.14E}" for value in numbers[column : min(column + 3, row + 1)])
            yield f" {row + 1:5d} {column + 1:5d} {part}"


def _time(stamp: datetime) -> str:
    seconds = stamp.hour * 3600 + stamp.minute * 60 + stamp.second
    return f"{stamp.year % 100:02d}:{stamp.timetuple().tm_yday:03d}:{seconds:05d}"
