"""Results in columns, written as CSV or GeoJSON, with what was left out."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from obseq.dataclass import dataclass
from obseq.spreadsheets import csv_text

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from obseq.images.aerial.mapping import MapSystem
    from obseq.images.aerial.rays import RayVerdict

DECIMALS = {"omega": 9, "phi": 9, "kappa": 9}
"""Of numbers in some columns: degrees to a hundred thousandth of a second; all others have `USUAL`."""
USUAL = 4
"""Tenths of a millimetre, and of a thousandth of a pixel."""


class LeftOut(NamedTuple):
    """Something that was given and is not in the result.

    Attributes:
        where: file and line, or a name.
        reason: why.
    """

    where: str
    reason: str


@dataclass(frozen=True)
class Table:
    """A result.

    Attributes:
        columns: values by name, all of one length; x, y, z are map coordinates.
        left_out: what is missing, and why.
        verdict: on the residuals; None where there are none.
    """

    columns: Mapping[str, Sequence[object]]
    left_out: tuple[LeftOut, ...] = ()
    verdict: RayVerdict | None = None

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), ()))

    def csv(self) -> str:
        """One line per row, after a line of names."""
        rows = zip(*self.columns.values(), strict=True)
        shown = ([_shown(key, value) for key, value in zip(self.columns, row, strict=True)] for row in rows)
        return csv_text([tuple(self.columns), *shown])

    def geojson(self, system: MapSystem) -> str:
        """One point feature per row, in WGS 84 as RFC 7946 wants; map coordinates stay properties."""
        plan = np.column_stack([np.asarray(self.columns[axis], dtype=np.float64) for axis in "xy"])
        places = system.to_system(plan, "EPSG:4326")
        features = [
            {
                "type": "Feature",
                "geometry": {"type": "Point", "coordinates": [round(float(c), 9) for c in place]},
                "properties": {key: _plain(value) for key, value in zip(self.columns, row, strict=True)},
            }
            for place, row in zip(places, zip(*self.columns.values(), strict=True), strict=True)
        ]
        whole = {"type": "FeatureCollection", "crs_of_properties": system.definition, "features": features}
        return json.dumps(whole, indent=1, ensure_ascii=False) + "\n"


def _shown(key: str, value: object) -> str:
    return f"{value:.{DECIMALS.get(key, USUAL)}f}" if isinstance(value, float) else str(value)


def _plain(value: object) -> object:
    if isinstance(value, float):
        return round(float(value), 9) if np.isfinite(value) else None
    return int(value) if isinstance(value, np.integer) else value
