"""Antennas, rolling shutters and check points in words; check points as a table."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.images.output.text_tables import sigma_text, text_table
from obseq.reading.tables import table_text

if TYPE_CHECKING:
    from obseq.images.output.block_record import BundleRecord
    from obseq.images.output.references import AntennaRecord

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
    rows = [
        ("mean", "", *map("{:+.4f}".format, mean), ""),
        ("rms", "", *map("{:.4f}".format, rms), ""),
    ]
    rows += [
        (
            point.name,
            str(point.n_rays),
            *map("{:+.4f}".format, point.residual),
            "OFF" if point.is_off else _largest_share(point.residual, point.sigmas),
        )
        for point in sorted(found, key=lambda point: -max(map(abs, point.residual)))
    ]
    title = f"Check points ({len(found)}{_coverage(record)}), adjusted minus given, largest first\n"
    return title + text_table(("point", "rays", "dx", "dy", "dz", "in sigmas"), rows) + lost


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


def _largest_share(residual: tuple[float, ...], sigmas: tuple[float, ...] | None) -> str:
    if sigmas is None:
        return "-"
    return f"{max(abs(value) / sigma for value, sigma in zip(residual, sigmas, strict=True)):.2f}"


def check_table(record: BundleRecord) -> str:
    """Check points as a table: differences, adjusted minus given, and their sigmas."""
    nothing = ("", "", "")
    rows = [
        (point.name, *point.residual, *(point.sigmas or nothing), point.n_rays)
        for point in record.check_points
    ]
    return table_text(("point", "dx", "dy", "dz", "sx", "sy", "sz", "rays"), rows)


def references(record: BundleRecord) -> str:
    """Lever arms, what positions leave, readouts."""
    lines = [line for antenna in record.antennas for line in _antenna(antenna)]
    lines += [
        f"  shutter of {one.camera}: readout {1000 * one.readout:.4g} ms"
        + ("" if one.sigma is None else f" (sigma {sigma_text(1000 * one.sigma)})")
        for one in record.shutters
    ]
    return "References of images\n" + "\n".join(lines) + "\n" if lines else ""


def _antenna(antenna: AntennaRecord) -> list[str]:
    rms = ", ".join(f"{value:.4g}" for value in antenna.rms)
    lines = [f"  antenna {antenna.name}: {len(antenna.images)} positions, rms {rms}"]
    if any(antenna.lever_arm) or any(antenna.lever_sigmas or ()):
        lever = ", ".join(f"{value:.4f}" for value in antenna.lever_arm)
        sigmas = ", ".join(sigma_text(value) for value in antenna.lever_sigmas or ())
        lines.append(
            f"    lever arm {lever} (camera: right, down, forward)" + (f", sigma {sigmas}" if sigmas else "")
        )
    return lines
