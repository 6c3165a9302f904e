"""The record of an adjustment: what the result file holds (format "obseq-adjustment", version 1).

Metres and radians. A number that is not defined (a precision when sigma0 cannot be computed, for instance) is
None here and null in the file.
"""

import json
import math
from collections.abc import Mapping
from typing import Any, NotRequired, TypedDict

ENCODER = json.JSONEncoder(ensure_ascii=False, allow_nan=False)


class IterationRecord(TypedDict):
    """One iteration: sigma0 of the residuals at its start, and its largest step (m or rad)."""

    sigma0: float | None
    max_step: float | None


class PointRecord(TypedDict):
    """One point: x, y, z and their precisions in the computation frame, crs_* in the input system."""

    name: str
    x: float
    y: float
    z: float
    sx: float | None
    sy: float | None
    sz: float | None
    crs_x: float | None
    crs_y: float | None
    crs_z: float | None
    covariance: NotRequired[list[float] | None]
    """xx, xy, xz, yy, yz, zz in the computation frame (m^2)."""
    crs_sx: NotRequired[float | None]
    crs_sy: NotRequired[float | None]
    crs_sz: NotRequired[float | None]
    """Precisions (m): along the axes of that system when it is in metres, else east, north and up."""


class StationRecord(TypedDict):
    """One station: its point, how it is oriented, and the azimuth of the zero of its circle (rad)."""

    origin: str
    orientation: str
    g0: float | None


ObservationRecord = TypedDict(
    "ObservationRecord",
    {
        "type": str,
        "from": str,
        "to": str,
        "value": float,
        "sigma": float,
        "residual": float | None,
        "normalised_residual": float | None,
        "file": str,
        "line": int,
        "active": bool,
    },
)
"""One observation, where it was read, and how it fits (a function call, because `from` is a keyword)."""


class LeftOutRecord(TypedDict):
    """A point or a station that nothing determines, and that was left out with its observations."""

    what: str
    name: str
    reason: str
    observations: list[str]


class PhaseRecord(TypedDict):
    """How long a part of the work took."""

    name: str
    seconds: float


class AdjustmentRecord(TypedDict):
    """The whole adjustment."""

    format: str
    version: int
    n_observations: int
    n_constraints: int
    n_unknowns: int
    redundancy: int
    iterations: list[IterationRecord]
    sigma0: float | None
    variance_factor: NotRequired[float | None]
    """Sum of all weighted squared residuals, those of known points included, over the redundancy."""
    converged: bool
    precision: NotRequired[str]
    """"a posteriori": precisions are multiplied by the estimated sigma0; "a priori": they are not."""
    frame: str
    points_crs: str
    points_crs_unit: NotRequired[str]
    """Unit of crs_x and crs_y: "m" (also when absent) or "degree"; crs_z is always in metres."""
    points: list[PointRecord]
    stations: list[StationRecord]
    observations: list[ObservationRecord]
    warnings: NotRequired[list[str]]
    left_out: NotRequired[list[LeftOutRecord]]
    phases: NotRequired[list[PhaseRecord]]


def to_json(record: Mapping[str, Any]) -> str:
    """The text of the result file: valid JSON, one point, station or observation per line, floats exact."""
    parts = [f"{_encoded(key)}: {_lines(value)}" for key, value in record.items()]
    return "{\n" + ",\n".join(parts) + "\n}\n"


def _lines(value: Any) -> str:
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return "[\n  " + ",\n  ".join(_encoded(item) for item in value) + "\n]"
    return _encoded(value)


def _encoded(value: Any) -> str:
    try:
        return ENCODER.encode(value)
    except ValueError:  # something is not finite: rare, and looking for it first would cost more than writing
        return ENCODER.encode(finite(value))


def finite(value: Any) -> Any:
    """The value with None for what JSON cannot write: infinities and not-a-numbers."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return value
