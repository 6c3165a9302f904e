"""Check points in words, and as a table."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.reading.tables import table_text

if TYPE_CHECKING:
    from obseq.arrays import FloatArray
    from obseq.images.output.block_record import BundleRecord

WITHIN = 1.96
"""Sigmas that 95 % of errors keep."""


def check_points(record: BundleRecord) -> str:
    """How check points agree with the result."""
    found = record.check_points
    lost = (
        f"Check points that nothing determines: {', '.join(record.unchecked)}\n" if record.unchecked else ""
    )
    if not found:
        return lost
    differences = np.array([point.residual for point in found])
    rms, mean = np.sqrt(np.mean(differences**2, axis=0)), differences.mean(axis=0)
    parts = [f"mean {_three(mean)}", f"rms {_three(rms)}{_coverage(record)}"]
    return f"Check points ({len(found)}), adjusted minus given: {', '.join(parts)}\n{lost}"


def _three(values: FloatArray) -> str:
    return " ".join(f"{value:.4f}" for value in values)


def _coverage(record: BundleRecord) -> str:
    """How many differences are within 1.96 of their sigmas."""
    pairs = [
        (abs(difference), sigma)
        for point in record.check_points
        if point.sigmas
        for difference, sigma in zip(point.residual, point.sigmas, strict=True)
    ]
    within = sum(difference <= WITHIN * sigma for difference, sigma in pairs)
    return f"; {within} of {len(pairs)} coordinates within 1.96 sigmas" if pairs else ""


def check_table(record: BundleRecord) -> str:
    """Check points as a table: differences, adjusted minus given, and their sigmas."""
    nothing = ("", "", "")
    rows = [
        (point.name, *point.residual, *(point.sigmas or nothing), point.n_rays)
        for point in record.check_points
    ]
    return table_text(("point", "dx", "dy", "dz", "sx", "sy", "sz", "rays"), rows)
