"""Targets of images as measures: a table, files of MMVII, and points for an adjustment."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.images import ImagePoints
from obseq.project.tree import Reader, read_tree, tree_text
from obseq.reading.tables import Table
from obseq.spreadsheets import csv_text
from obseq.targets.specification import extent

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from obseq.arrays import FloatArray, FloatRows
    from obseq.project.tree import Tree
    from obseq.targets.finding.finder import Found, Target
    from obseq.targets.simulation import Truth
    from obseq.targets.specification import Specification

UNCODED = "NONE"
"""What the names of spots without code begin with, as in MMVII."""
MEASURED = "image", "point", "x", "y", "sxx", "sxy", "syy"
"""Columns that make a measure."""
COLUMNS = (
    *MEASURED,
    *("family", "centre", "size_px", "tilt_deg", "blur_px", "contrast", "likeness", "sigma0"),
    *("least_margin", "corrected_bits"),
)
"""Columns of the table; variances in pixels squared. `centre` is true, or that of the ellipse: of
spots without code it always is."""
TRUE, ELLIPSE = "true", "ellipse"
DIGITS = 6
"""Of the running number of a spot without code."""


@dataclass(frozen=True, eq=False)
class Measure:
    """A row of the table: a point in an image.

    Attributes:
        image: its name.
        point: name of the target; `NONE_...` for a spot without code.
        xy: (2,) pixels.
        covariance: (2, 2) pixels squared.
    """

    image: str
    point: str
    xy: FloatArray
    covariance: FloatRows


def named(found: Found) -> list[tuple[str, Target]]:
    """All targets of an image with their names; spots without code are numbered from the upper left."""
    plain = sorted(
        found.uncoded, key=lambda target: (round(float(target.centre[1])), float(target.centre[0]))
    )
    return [(target.name, target) for target in found.targets] + [
        (f"{UNCODED}_{number:0{DIGITS}d}", target) for number, target in enumerate(plain)
    ]


def place_of(target: Target, of_ellipse: bool) -> FloatArray:
    """(2,) the centre that is written, pixels."""
    return target.ellipse if of_ellipse else target.centre


def table_text(found: Mapping[str, Found], *, of_ellipse: bool = False) -> str:
    """The table of the targets of images, CSV.

    Args:
        found: by the names of the images.
        of_ellipse: write the centres of ellipses, as other programs do, and not the true ones.
    """
    rows = (
        _row(image, name, target, of_ellipse) for image, one in found.items() for name, target in named(one)
    )
    return csv_text([COLUMNS, *rows])


def _row(image: str, name: str, target: Target, of_ellipse: bool) -> list[str]:
    x, y = place_of(target, of_ellipse)
    c, placed = target.covariance, target.fit.placed
    margin = float(np.abs(target.margins).min()) if len(target.margins) else math.nan
    return [
        image,
        name,
        f"{x:.4f}",
        f"{y:.4f}",
        *(f"{value:.4e}" for value in (c[0, 0], c[0, 1], c[1, 1])),
        target.family,
        ELLIPSE if of_ellipse or not target.name else TRUE,
        f"{target.size:.1f}",
        f"{math.degrees(target.tilt):.0f}",
        f"{placed.sigma:.2f}",
        f"{abs(target.fit.gain):.1f}",
        f"{target.fit.likeness:.4f}",
        f"{target.fit.sigma0:.2f}",
        f"{margin:.2f}" if math.isfinite(margin) else "",
        str(target.corrected),
    ]


def refusals_text(found: Mapping[str, Found]) -> str:
    """What looked like a target and was refused, with the reason, CSV."""
    rows = [["image", "x", "y", "what", "value", "limit"]]
    for image, one in found.items():
        for refusal in one.refused:
            limit = f"{refusal.limit:.3g}" if math.isfinite(refusal.limit) else ""
            place = f"{refusal.x:.1f}", f"{refusal.y:.1f}"
            rows.append([image, *place, refusal.stage, f"{refusal.value:.6g}", limit])
    return csv_text(rows)


def mmvii_text(image: str, measures: Sequence[Measure]) -> str:
    """The file `MesIm-<image>.xml`: names, places, and variances (the original writes 1 0 1)."""
    entries: list[Tree] = [
        {
            "Name": one.point,
            "Pt": (float(one.xy[0]), float(one.xy[1])),
            "Sigma2": tuple(float(one.covariance[k]) for k in ((0, 0), (0, 1), (1, 1))),
        }
        for one in sorted(measures, key=lambda one: one.point)
    ]
    return tree_text("SetMesIm", {"NameIm": image, "Measures": entries})


def truth_text(truths: Sequence[Truth], spec: Specification, radii: Sequence[float]) -> str:
    """The file `..._GroundTruth.xml` of made images: codes, centres, and half sides of sheets, pixels."""
    half = spec.geometry.radii[3] / extent(spec)
    geometries: list[Tree] = [
        {
            "Encod": {"NumCode": (float(list(spec.codes).index(one.name)), float(spec.codes[one.name]))},
            "Name": one.name,
            "Center": (float(one.centre[0]), float(one.centre[1])),
            "R1": (half * one.size * math.cos(one.tilt),),
            "R2": (half * one.size,),
        }
        for one in truths
    ]
    return tree_text("ResSimul", {"RadiusMinMax": tuple(map(float, radii)), "Geoms": geometries})


def attributes_text(found: Found) -> str:
    """The file `Attribute-MesIm-<image>.xml`: ellipses of the central figures, and their grey levels."""
    entries: list[Tree] = []
    for name, target in named(found):
        centre, shape = target.fit.placed.ellipse
        inverse = np.linalg.inv(shape)
        values, ways = np.linalg.eigh(shape)
        entries.append(
            {
                "AffinIm2Ref": {"P0": (0.0, 0.0), "VX": (1.0, 0.0), "VY": (0.0, 1.0)},
                "Ellipse": {
                    "V": (*(float(inverse[k]) for k in ((0, 0), (0, 1), (1, 1))), 0.0, 0.0),
                    "C0": _pair(centre),
                    "GeomForComment": {
                        "LengthGreatAxe": (math.sqrt(values[1]),),
                        "LengthSmallAxe": (math.sqrt(values[0]),),
                        "DirGreatAxe": _pair(ways[:, 1]),
                    },
                },
                "NameCode": name,
                "Black": (min(target.fit.offset, target.fit.offset + target.fit.gain),),
                "White": (max(target.fit.offset, target.fit.offset + target.fit.gain),),
            }
        )
    return tree_text("Attributes", entries)


def _pair(values: FloatArray) -> tuple[float, ...]:
    return float(values[0]), float(values[1])


def read_ellipses(path: str | Path) -> dict[str, tuple[FloatArray, FloatRows]]:
    """The ellipses of such a file, by name: centre (2,), and shape (2, 2) of `(p - c)' shape^-1 (p - c) = 1`.

    Raises:
        InputError: with file and field.
    """
    found: dict[str, tuple[FloatArray, FloatRows]] = {}
    for number, entry in enumerate(Reader(read_tree(path), str(path)).list("Attributes"), 1):
        fields = Reader(entry, f"{path}: entry {number}")
        ellipse = fields.fields("Ellipse")
        a, b, c, d, e = ellipse.numbers("V", 5)
        matrix = np.array([[a, b], [b, c]])
        if not np.linalg.det(matrix) > 0.0 or a <= 0.0:
            raise InputError(f"{ellipse.where}: V is no ellipse")
        away = np.linalg.solve(2.0 * matrix, [-d, -e])
        shape = np.asarray(np.linalg.inv(matrix / (1.0 + float(away @ matrix @ away))), dtype=np.float64)
        found[fields.text("NameCode")] = np.array(ellipse.numbers("C0", 2)) + away, shape
    return found


def read_mmvii(path: str | Path) -> list[Measure]:
    """The measures of a file `MesIm-<image>.xml`, also of spots without code.

    Raises:
        InputError: with file and field.
    """
    whole = Reader(read_tree(path), str(path)).fields("SetMesIm")
    image = whole.text("NameIm")
    found = []
    for number, entry in enumerate(whole.list("Measures"), 1):
        fields = Reader(entry, f"{path}: entry {number}")
        sigma = fields.numbers("Sigma2", 3) if fields.has("Sigma2") else (1.0, 0.0, 1.0)
        values = np.array([*fields.numbers("Pt", 2), *sigma], dtype=float)
        found.append(_measure(fields.where, image, fields.text("Name"), values))
    return found


def measures_of(found: Mapping[str, Found], *, of_ellipse: bool = False) -> list[Measure]:
    """The targets of images as rows of the table."""
    return [
        Measure(image, name, place_of(target, of_ellipse), target.covariance)
        for image, one in found.items()
        for name, target in named(one)
    ]


def image_points(measures: Sequence[Measure]) -> ImagePoints:
    """Measures as an adjustment takes them, with their covariances; spots without code are left out."""
    coded = [one for one in measures if not one.point.startswith(UNCODED)]
    if not coded:
        raise InputError("targets: there are no named measures")
    sigmas = np.sqrt([np.diag(one.covariance) for one in coded])
    return ImagePoints.of(
        [one.image for one in coded],
        [one.point for one in coded],
        np.array([one.xy for one in coded]),
        sigmas,
        np.array([one.covariance[0, 1] for one in coded]),
    )


def measures_text(measures: Sequence[Measure]) -> str:
    """The first columns of the table alone, CSV."""
    rows: list[Sequence[str]] = [MEASURED]
    for one in measures:
        x, y = one.xy
        c = one.covariance
        variances = (f"{value:.4e}" for value in (c[0, 0], c[0, 1], c[1, 1]))
        rows.append([one.image, one.point, f"{x:.4f}", f"{y:.4f}", *variances])
    return csv_text(rows)


def block_text(measures: Sequence[Measure]) -> str:
    """The table of measures that `obseq bundle` reads, with covariances; no spots without code."""
    rows = [["image", "point", "x", "y", "sx", "sy", "sxy"]]
    for one in measures:
        if not one.point.startswith(UNCODED):
            x, y = one.xy
            sx, sy = np.sqrt(np.diag(one.covariance))
            spread = f"{sx:.5f}", f"{sy:.5f}", f"{one.covariance[0, 1]:.4e}"
            rows.append([one.image, one.point, f"{x:.4f}", f"{y:.4f}", *spread])
    return csv_text(rows)


def read_table(path: str | Path) -> list[Measure]:
    """The measures of a table that was written here.

    Raises:
        InputError: with the line and the column that is wrong.
    """
    table = Table.read(path)
    table.require(*MEASURED)
    values = np.column_stack([table.numbers(column) for column in MEASURED[2:]])
    names = zip(table.texts("image"), table.texts("point"), strict=True)
    return [_measure(table.place(row), image, point, values[row]) for row, (image, point) in enumerate(names)]


def _measure(where: str, image: str, point: str, values: FloatArray) -> Measure:
    x, y, sxx, sxy, syy = values
    if sxx <= 0.0 or syy <= 0.0 or sxx * syy < sxy**2:
        raise InputError(f"{where}: point {point}: sxx, sxy and syy are no variances")
    return Measure(image, point, np.array([x, y]), np.array([[sxx, sxy], [sxy, syy]]))
