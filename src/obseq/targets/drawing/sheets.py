"""Targets on paper: outlines of ink, and files of them in SVG and PDF at a stated size."""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterable, Sequence

import numpy as np

from obseq.arrays import FloatRows
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.printable import printable_line
from obseq.targets.drawing.drawings import figure_of, inked_bits, row_box
from obseq.targets.drawing.legend import legend_places
from obseq.targets.specification import Specification

MILLIMETRE = 72.0 / 25.4
"""Points of PDF."""
LARGEST_SHEET = 5000.0
"""Width of the largest sheet, millimetres: what a PDF page may be."""
ARC = math.radians(1.0)
"""Arcs are drawn in pieces of one degree: 0.04 mm from the circle at a radius of one metre."""
CAPTION = 4.0
"""Height of the caption below the sheet, millimetres."""


@dataclass(frozen=True)
class Outline:
    """A sheet: its edges, and polygons (k, 2) of ink and of what is cut out of ink again, in units."""

    edges: tuple[float, float, float, float]
    ink: Sequence[FloatRows]
    cut: Sequence[FloatRows]


def outline(spec: Specification, name: str, *, legend: bool = True) -> Outline:
    """The outlines of a target.

    Raises:
        InputError: the set has no such name.
    """
    code = inked_bits(spec, spec.code_of(name))
    ink = [*_centre(spec), *_bits(spec, code)]
    cut: list[FloatRows] = []
    for k, radius in enumerate(_ring_radii(spec)):
        (cut if k % 2 == 0 else ink).append(_sector(0.0, radius, 0.0, 2.0 * math.pi))
    figure = figure_of(spec)
    if figure.mark > 0.0:
        ways = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
        ink.append(np.array([figure.mark_x, figure.mark_y]) + figure.mark * ways)
    if legend:
        ink += _legend(spec, name)
    return Outline(spec.geometry.sheet, ink, cut)


def _centre(spec: Specification) -> list[FloatRows]:
    angle = spec.geometry.angle
    if not spec.geometry.is_chequered:
        return [_sector(0.0, 1.0, 0.0, 2.0 * math.pi)]
    quarter = math.pi / 2
    return [_sector(0.0, 1.0, angle + k * quarter, angle + (k + 1) * quarter) for k in (1, 3)]


def _ring_radii(spec: Specification) -> list[float]:
    """Radii of the rings for surveyors, from the outermost: inside each, the colour changes."""
    radius = spec.geometry.rings
    if radius <= 0.0:
        return []
    count = math.ceil(math.log2(radius * spec.raster.scale))
    return [radius / 2**k for k in range(max(count, 1))]


def _sector(inner: float, outer: float, first: float, last: float) -> FloatRows:
    """A sector of a ring."""
    turns = np.linspace(first, last, max(2, math.ceil(abs(last - first) / ARC) + 1))
    out = outer * np.column_stack((np.cos(turns), np.sin(turns)))
    if inner == 0.0:
        return out if last - first >= 2.0 * math.pi else np.vstack((out, [[0.0, 0.0]]))
    return np.vstack((out, inner / outer * out[::-1]))


def _bits(spec: Specification, code: int) -> list[FloatRows]:
    found = []
    for bit in range(spec.bits):
        if code >> bit & 1:
            found.append(_row_bit(spec, bit) if spec.geometry.in_rows else _ring_bit(spec, bit))
    return found


def _ring_bit(spec: Specification, bit: int) -> FloatRows:
    geometry, step = spec.geometry, 2.0 * math.pi / spec.bits
    first = geometry.angle + (bit * step if geometry.grows else -(bit + 1) * step)
    begin, end, _, _ = geometry.radii
    return _sector(begin, end, first, first + step)


def _row_bit(spec: Specification, bit: int) -> FloatRows:
    left, low, right, high = row_box(spec, bit)
    return np.array([[left, low], [right, low], [right, high], [left, high]])


def _legend(spec: Specification, name: str) -> list[FloatRows]:
    places = legend_places(spec, name)
    return [
        np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
        for left, top, right, bottom in places
    ]


def check_width(width: float) -> None:
    """Refuses sheets that cannot be printed.

    Raises:
        InputError: the width is not positive, or larger than a page may be.
    """
    if not 1.0 <= width <= LARGEST_SHEET:
        raise InputError(f"a sheet {width} mm wide: 1 to {LARGEST_SHEET:.0f} mm are possible")


def svg_text(spec: Specification, name: str, width: float, *, legend: bool = True) -> str:
    """A sheet as SVG.

    Args:
        spec: the set.
        name: of the target.
        width: of the sheet, millimetres.
        legend: whether the name stands in the corners.

    Raises:
        InputError: no such name, or no such size.
    """
    check_width(width)
    sheet = outline(spec, name, legend=legend)
    left, right, top, bottom = sheet.edges
    height = width * (bottom - top) / (right - left)
    paper, ink = ("#fff", "#000") if spec.geometry.is_white else ("#000", "#fff")
    box = f"{left:.6g} {top:.6g} {right - left:.6g} {bottom - top:.6g}"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.6g}mm" height="{height:.6g}mm" '
        f'viewBox="{box}">\n<title>{_escaped(name)}</title>\n'
        f'<path fill="{paper}" d="M{left:.6g} {top:.6g}H{right:.6g}V{bottom:.6g}H{left:.6g}Z"/>\n'
        f'<path fill="{ink}" d="{_svg_path(sheet.ink)}"/>\n{_svg_cut(sheet, paper)}</svg>\n'
    )


def _svg_cut(sheet: Outline, paper: str) -> str:
    return f'<path fill="{paper}" d="{_svg_path(sheet.cut)}"/>\n' if sheet.cut else ""


def _svg_path(polygons: Iterable[FloatRows]) -> str:
    return "".join(f"M{'L'.join(f'{x:.6g} {y:.6g}' for x, y in polygon)}Z" for polygon in polygons)


def _escaped(text: str) -> str:
    return printable_line(text).replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def pdf_bytes(spec: Specification, names: Sequence[str], width: float, *, legend: bool = True) -> bytes:
    """Sheets as PDF, a page each, with a caption below that says name and size.

    Args:
        spec: the set.
        names: of the targets.
        width: of the sheet, millimetres.
        legend: whether the name stands in the corners.

    Raises:
        InputError: no such name, or no such size.
    """
    check_width(width)
    pages = [_page(spec, name, width, legend) for name in names]
    first = 4
    kids = " ".join(f"{first + 2 * k} 0 R" for k in range(len(pages)))
    parts = [
        b"<</Type/Catalog/Pages 2 0 R>>",
        f"<</Type/Pages/Count {len(pages)}/Kids[{kids}]>>".encode(),
        b"<</Type/Font/Subtype/Type1/BaseFont/Helvetica>>",
    ]
    for k, (box, content) in enumerate(pages):
        stream = zlib.compress(content.encode("latin-1", "replace"))
        parts += [
            f"<</Type/Page/Parent 2 0 R/MediaBox[{box}]/Contents {first + 2 * k + 1} 0 R"
            "/Resources<</Font<</F 3 0 R>>>>>>".encode(),
            f"<</Length {len(stream)}/Filter/FlateDecode>>stream\n".encode() + stream + b"\nendstream",
        ]
    return _pdf_file(parts)


def _page(spec: Specification, name: str, width: float, legend: bool) -> tuple[str, str]:
    """The box of a page, and what is drawn there."""
    sheet = outline(spec, name, legend=legend)
    left, right, top, bottom = sheet.edges
    scale = width * MILLIMETRE / (right - left)
    below = CAPTION * MILLIMETRE
    height = (bottom - top) * scale
    paper, ink = ("1 g", "0 g") if spec.geometry.is_white else ("0 g", "1 g")
    corner = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
    move = np.array([-left * scale, below + bottom * scale])
    turn = np.array([scale, -scale])

    def filled(colour: str, polygons: Iterable[FloatRows]) -> str:
        return "".join(f"{colour}\n{_pdf_path(polygon * turn + move)} f\n" for polygon in polygons)

    caption = f"{spec.prefix}  {name}  {width:.6g} mm wide, unit {scale / MILLIMETRE:.6g} mm"
    text = caption.replace("\\", "\\\\").replace("(", "\\(").replace(")", "\\)")
    content = filled(paper, [corner]) + filled(ink, sheet.ink) + filled(paper, sheet.cut)
    content += f"0 g BT /F {0.5 * below:.4g} Tf {0.2 * below:.4g} {0.3 * below:.4g} Td ({text}) Tj ET\n"
    return f"0 0 {width * MILLIMETRE:.4f} {height + below:.4f}", content


def _pdf_path(polygon: FloatRows) -> str:
    words = [f"{x:.4f} {y:.4f} {'l' if k else 'm'}" for k, (x, y) in enumerate(polygon)]
    return " ".join(words) + " h"


def _pdf_file(parts: Sequence[bytes]) -> bytes:
    out = bytearray(b"%PDF-1.4\n")
    places = []
    for number, part in enumerate(parts, 1):
        places.append(len(out))
        out += f"{number} 0 obj".encode() + part + b"endobj\n"
    begin = len(out)
    out += f"xref\n0 {len(parts) + 1}\n0000000000 65535 f \n".encode()
    for place in places:
        out += f"{place:010d} 00000 n \n".encode()
    out += f"trailer<</Size {len(parts) + 1}/Root 1 0 R>>\nstartxref\n{begin}\n%%EOF\n".encode()
    return bytes(out)
