"""The tables of the page of a block."""

from __future__ import annotations

from collections.abc import Callable, Collection

from obseq.images.output.arrays import arrays_of
from obseq.images.output.block_record import BundleRecord
from obseq.images.output.page_instruments import INSTRUMENT_TABLES
from obseq.printable import listed, printable_line
from obseq.report.head import printed
from obseq.report.tables.columns import choice, column, elements, field, filled, table
from obseq.report.tables.units import Plain

MOST_NAMES = 4
"""Names of what took no part, by kind and reason."""


def tables(record: BundleRecord, names: Collection[str] = ()) -> list[Plain]:
    """Image points, points, images, parameters of cameras, instruments; or the tables of some names."""
    return filled(of(record) for name, of in TABLES.items() if not names or name in names)


def names_of(record: BundleRecord) -> list[str]:
    """Names of points and images, by the numbers that tables hold."""
    return printed([*record.points.values("name"), *(image.name for image in record.images)])


def _measures(record: BundleRecord) -> Plain | None:
    found, tests = record.measures, record.reliability
    if not found:
        return None
    places, names = arrays_of(record), [image.name for image in record.images]
    of = found.values
    columns = [
        column("image", "point", (len(record.points) + places.image).tolist(), key="from"),
        column("point", "point", places.point.tolist(), key="to"),
        column("x", "coarse_pixel", of("x"), paper=False),
        column("y", "coarse_pixel", of("y"), paper=False),
        column("dx", "pixel", of("dx"), by_size=True),
        column("dy", "pixel", of("dy"), by_size=True),
    ]
    if tests is not None:
        limit, shares = tests.critical, map(min, of("redundancy_x"), of("redundancy_y"))
        w, least = (map(_larger, of(f"{name}_x"), of(f"{name}_y")) for name in ("w", "detectable"))
        larger, smaller = "the larger of its two coordinates", "the smaller of its two coordinates"
        columns += [
            column("w", "number", w, by_size=True, bar="w", about=larger, limit=limit),
            column("redundancy", "number", shares, bar="redundancy", about=smaller),
            column("detectable", "pixel", least, about="smallest error that its test finds"),
        ]
    columns += [column(f"s{axis}", "pixel", of(f"s{axis}"), rare=True) for axis in "xy"]
    if (places.weights != 1.0).any():
        columns.append(column("weight", "number", of("weight"), about="what robust weights leave"))
    about = "Residuals are computed minus measured, in pixels."
    chips = [] if tests is None else [[f"|w| > {tests.critical:.2f}", f"|w|>{tests.critical:.2f}"]]
    return table(
        "measures",
        "Image points",
        columns,
        about=about,
        rows="measure",
        order="w",
        chips=chips,
        hint=f"{printable_line(names[0])} |w|>2",
    )


def _larger(x: float | None, y: float | None) -> float | None:
    known = [value for value in (x, y) if value is not None]
    return max(known, key=abs) if known else None


def _length(record: BundleRecord) -> dict[str, str]:
    """The unit of the world: metres where control points say so, as far as anybody knows."""
    return {} if any(point.kind == "control" for point in record.points) else {"unit": "world units"}


def _points(record: BundleRecord) -> Plain | None:
    found, unit = record.points, _length(record)
    spread = [
        None if point.covariance is None else [point.covariance[k] ** 0.5 for k in (0, 3, 5)]
        for point in found
    ]
    small, off = "fine" if unit else "small_length", "adjusted minus given"
    columns = [
        column("point", "point", range(len(found))),
        choice("kind", [point.kind for point in found]),
        field("rays", "count", found, "n_rays"),
        *(column(axis, "length", [getattr(point, axis) for point in found], **unit) for axis in "xyz"),
        *elements(("sx", "sy", "sz"), small, spread),
        field("rms", "pixel", found, "rms", about="per coordinate"),
        *elements(("dx", "dy", "dz"), small, (point.residual for point in found), by_size=True, about=off),
    ]
    return table(
        "points",
        "Points",
        columns,
        rows="point",
        order="rms",
        about=f"Precisions {record.precision}.",
        hint="control rays<3",
        chips=[["control", "control"]],
    )


def _images(record: BundleRecord) -> Plain | None:
    found, unit = record.images, _length(record)
    small, angles = "fine" if unit else "small_length", ("omega", "phi", "kappa")
    spreads = [f"s {angle}" for angle in angles]
    columns = [
        column("image", "point", (len(record.points) + k for k in range(len(found)))),
        choice("camera", [image.camera for image in found]),
        field("points", "count", found, "n_measures"),
        field("rms", "pixel", found, "rms", about="per coordinate"),
        field("largest", "pixel", found, "largest"),
        field("mean dx", "pixel", found, "mean_dx", by_size=True),
        field("mean dy", "pixel", found, "mean_dy", by_size=True),
        *elements("xyz", "length", (image.centre for image in found), **unit),
        *elements(("sx", "sy", "sz"), small, (image.centre_sigmas for image in found)),
        *elements(angles, "angle", (image.opk for image in found), rare=True),
        *elements(spreads, "small_angle", (image.opk_sigmas for image in found), rare=True),
    ]
    return table("images", "Images", columns, order="rms", hint="rms>0.5")


def _parameters(record: BundleRecord) -> Plain:
    rows = [(camera, parameter) for camera in record.cameras for parameter in camera.parameters]
    states = ["held" if parameter.sigma == 0.0 else "estimated" for _, parameter in rows]
    columns = [
        choice("camera", [camera.name for camera, _ in rows]),
        column("parameter", "text", [parameter.name for _, parameter in rows]),
        column("value", "value", [parameter.value for _, parameter in rows]),
        column("sigma", "small_number", [parameter.sigma or None for _, parameter in rows]),
        choice("state", states),
    ]
    about = "; ".join(
        f"{camera.name}: {camera.projection} {camera.degree}, {camera.width} by {camera.height} pixels"
        for camera in record.cameras
    )
    return table("parameters", "Parameters of cameras", columns, about=printable_line(about))


def _tests(record: BundleRecord) -> Plain | None:
    found = () if record.reliability is None else record.reliability.largest.largest
    columns = [
        column("observation", "text", [printable_line(item.name) for item in found]),
        field("w", "number", found, "w", by_size=True, bar="w"),
        field("error", "small_number", found, "blunder", by_size=True),
        choice("unit", [item.unit or "world units" for item in found]),
        field("weight", "number", found, "weight"),
    ]
    return table("tests", "Largest tests", columns, about="Of observations of all kinds.")


def _without(record: BundleRecord) -> Plain | None:
    """What took no part, and why."""
    parts = {
        "left out": record.left_out,
        "changes nothing": record.unmeasured,
        "not in pairs": record.unpaired,
    }
    groups: dict[tuple[str, str, str], list[str]] = {}
    for what, items in parts.items():
        for item in items:
            groups.setdefault((what, item.kind, item.reason), []).append(item.name)
    rows = sorted(groups.items(), key=lambda group: -len(group[1]))
    columns = [
        choice("what", [what for (what, _, _), _ in rows]),
        choice("kind", [kind for (_, kind, _), _ in rows]),
        column("which", "text", [printable_line(listed(names, MOST_NAMES)) for _, names in rows]),
        choice("why", [reason for (_, _, reason), _ in rows]),
        column("how many", "count", [len(names) for _, names in rows]),
    ]
    count = sum(len(names) for names in groups.values())
    return table("without", f"Without part ({count})", columns)


TABLES: dict[str, Callable[[BundleRecord], Plain | None]] = {
    "measures": _measures,
    "points": _points,
    "images": _images,
    "parameters": _parameters,
    **INSTRUMENT_TABLES,
    "tests": _tests,
    "without": _without,
}
"""The tables by name, in the order of the page."""
