"""The tables of what cameras stand on or carry, and of check points."""

from __future__ import annotations

from collections.abc import Callable

from obseq.images.output.block_record import BundleRecord
from obseq.printable import printable_line
from obseq.report.tables.columns import choice, column, elements, field, table
from obseq.report.tables.units import Plain


def _check_points(record: BundleRecord) -> Plain | None:
    found = record.check_points
    columns = [
        choice("point", [item.name for item in found]),
        field("rays", "count", found, "n_rays"),
        *elements(("dx", "dy", "dz"), "small_length", (item.residual for item in found)),
        *elements(("sx", "sy", "sz"), "small_length", (item.sigmas for item in found)),
        choice("verdict", ["off" if item.is_off else "as expected" for item in found]),
    ]
    about = "Adjusted minus given; they take no part in the adjustment."
    return table("check-points", "Check points", columns, about=about)


def _antennas(record: BundleRecord) -> Plain | None:
    found = record.antennas
    levers = [
        choice("antenna", [item.name for item in found]),
        *elements(("lever x", "y", "z"), "small_length", (item.lever_arm for item in found)),
        *elements(("sx", "sy", "sz"), "small_length", (item.lever_sigmas for item in found)),
        *elements(("rms x", "rms y", "rms z"), "small_length", (item.rms for item in found)),
    ]
    about = "Lever arms from the projection centre, in the frame of the camera."
    return table("antennas", "Antennas", levers, about=about)


def _positions(record: BundleRecord) -> Plain | None:
    rows = [
        (item.name, image, part)
        for item in record.antennas
        for image, part in zip(item.images, item.residuals, strict=True)
    ]
    residuals = [
        choice("antenna", [name for name, _, _ in rows]),
        choice("image", [image for _, image, _ in rows]),
        *elements(("dx", "dy", "dz"), "small_length", [part for _, _, part in rows]),
    ]
    return table("positions", "Positions", residuals, about="Adjusted minus observed.")


def _shutters(record: BundleRecord) -> Plain | None:
    found = record.shutters
    columns = [
        choice("camera", [item.camera for item in found]),
        field(
            "readout",
            "small_number",
            found,
            "readout",
            unit="s",
            about="from the first line to the last",
        ),
        field("sigma", "small_number", found, "sigma", unit="s"),
    ]
    return table("shutters", "Rolling shutters", columns)


def _rigid(record: BundleRecord) -> Plain | None:
    places = [(block, place) for block in record.rigid_blocks for place in block.places]
    if not places:
        return None
    first = [
        choice("block", [block.name for block, _ in places]),
        choice("camera", [place.camera for _, place in places]),
        *elements(("x", "y", "z"), "fine", [place.centre for _, place in places]),
        *elements(("qw", "qx", "qy", "qz"), "fine", [place.quaternion for _, place in places]),
        *elements(
            ("sx", "sy", "sz", "s rot x", "s rot y", "s rot z"),
            "small_number",
            [place.sigmas for _, place in places],
        ),
    ]
    about = f"In the frame of {printable_line(record.rigid_blocks[0].master)}; radians."
    return table("rigid", "Rigid blocks", first, about=about)


def _exposures(record: BundleRecord) -> Plain | None:
    exposures = [(block, item) for block in record.rigid_blocks for item in block.exposures]
    second = [
        choice("block", [block.name for block, _ in exposures]),
        choice("cameras", [f"{item.first}, {item.second}" for _, item in exposures]),
        choice("exposure", [item.exposure for _, item in exposures]),
        *elements(("dx", "dy", "dz"), "small_number", [item.translation for _, item in exposures]),
        *elements(("rot x", "rot y", "rot z"), "small_angle", [item.rotation for _, item in exposures]),
    ]
    return table("exposures", "Exposures", second)


def _pairs(record: BundleRecord) -> Plain | None:
    """How far the cameras of rigid blocks are from their places, over all exposures."""
    pairs = [(block.name, pair) for block in record.rigid_blocks for pair in block.pairs]
    columns = [
        choice("block", [name for name, _ in pairs]),
        choice("cameras", [f"{pair.first}, {pair.second}" for _, pair in pairs]),
        column("rms of places", "small_number", [pair.rms_translation for _, pair in pairs]),
        column("rms of rotations", "small_angle", [pair.rms_rotation for _, pair in pairs]),
    ]
    return table("pairs", "Pairs of rigid blocks", columns, about="Over all exposures, per coordinate.")


def _clinometers(record: BundleRecord) -> Plain | None:
    found = record.clinometers
    columns = [
        choice("clinometer", [item.name for item in found]),
        *elements(("axis x", "axis y", "axis z"), "fine", (item.axis for item in found)),
        *elements(
            tuple(f"degree {k}" for k in range(4)), "small_number", (item.correction for item in found)
        ),
        field("rms", "small_angle", found, "rms"),
    ]
    return table("clinometers", "Clinometers", columns)


def _readings(record: BundleRecord) -> Plain | None:
    readings = [
        (item.name, image, value)
        for item in record.clinometers
        for image, value in zip(item.images, item.residuals, strict=True)
    ]
    read = [
        choice("clinometer", [name for name, _, _ in readings]),
        choice("image", [image for _, image, _ in readings]),
        column(
            "residual",
            "small_angle",
            [value for _, _, value in readings],
            by_size=True,
            about="computed minus read",
        ),
    ]
    return table("readings", "Readings", read, order="residual")


INSTRUMENT_TABLES: dict[str, Callable[[BundleRecord], Plain | None]] = {
    "check-points": _check_points,
    "rigid": _rigid,
    "pairs": _pairs,
    "exposures": _exposures,
    "clinometers": _clinometers,
    "readings": _readings,
    "antennas": _antennas,
    "positions": _positions,
    "shutters": _shutters,
}
"""The tables by name, in the order of the page."""
INSTRUMENTS = tuple(name for name in INSTRUMENT_TABLES if name != "check-points")
"""Those of what cameras stand on or carry: they stand together."""
