"""Files of rational polynomial coefficients (RPC00B): `_RPC.TXT`, `.rpb`, and XML of DIMAP and of Maxar.

Lines and samples count from the centre of the first pixel, (0, 0). DIMAP counts from (1, 1): one is
taken off.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from obseq.errors import InputError
from obseq.images.aerial.rpc import KEYS, Rpc
from obseq.reading.tables import text_of
from obseq.reading.xml import Element, read_xml

PARTS = ("LINE_NUM", "LINE_DEN", "SAMP_NUM", "SAMP_DEN")
COUNT = 20
ENDINGS = (
    "_RPC.TXT",
    "_rpc.txt",
    "_RPC.txt",
    "_RPC.XML",
    "_RPC",
    ".RPB",
    ".rpb",
    ".xml",
    ".XML",
    ".txt",
    ".TXT",
    ".rpc",
    ".RPC",
)
"""How files of coefficients end after the name of their image, the longest that fits."""
SHORT = {
    "LINE_OFF": "LINEOFFSET", "SAMP_OFF": "SAMPOFFSET", "LAT_OFF": "LATOFFSET", "LONG_OFF": "LONGOFFSET",
    "HEIGHT_OFF": "HEIGHTOFFSET", "LINE_SCALE": "LINESCALE", "SAMP_SCALE": "SAMPSCALE",
    "LAT_SCALE": "LATSCALE", "LONG_SCALE": "LONGSCALE", "HEIGHT_SCALE": "HEIGHTSCALE",
    "LINE_NUM": "LINENUMCOEF", "LINE_DEN": "LINEDENCOEF", "SAMP_NUM": "SAMPNUMCOEF",
    "SAMP_DEN": "SAMPDENCOEF",
}  # fmt: skip
"""What `.rpb` and Maxar's XML call them, in capitals."""
FIELD = re.compile(r"^\s*([A-Za-z_0-9]+)\s*[:=]\s*(\([^)]*\)|[^;\n]*)", re.MULTILINE)
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?")


def image_of(path: str | Path) -> str:
    """The name of the image that a file of coefficients belongs to: its own without its ending."""
    name = Path(path).name
    ending = next((end for end in sorted(ENDINGS, key=len, reverse=True) if name.endswith(end)), "")
    return name[: len(name) - len(ending)] or name


def read_rpc(path: str | Path) -> Rpc:
    """The coefficients of a file.

    Raises:
        InputError: one is missing, or no number; the file is named.
    """
    place = Path(path)
    values = dict(_of_xml(place) if place.suffix.lower() == ".xml" else _of_text(place))
    offsets = {key: _one(values, f"{key}_OFF", place) for key in KEYS}
    scales = {key: _one(values, f"{key}_SCALE", place) for key in KEYS}
    wrong = [key for key, value in scales.items() if value == 0.0]
    if wrong:
        raise InputError(f"{place}: {wrong[0]}_SCALE is zero")
    coefficients = np.array([_many(values, part, place) for part in PARTS])
    if not coefficients[1::2].any(axis=1).all():
        raise InputError(f"{place}: a denominator has no coefficient but zero")
    return Rpc(offsets, scales, coefficients)


def _of_text(place: Path) -> Iterator[tuple[str, list[float]]]:
    """Fields and their numbers."""
    for name, text in FIELD.findall(text_of(place)):
        numbers = [float(word.upper().replace("D", "E")) for word in NUMBER.findall(text)]
        yield name.upper(), numbers if text.startswith("(") else numbers[:1]


def _of_xml(place: Path) -> Iterator[tuple[str, list[float]]]:
    """The same of elements: of DIMAP, those that lead from the ground to the image."""
    root = read_xml(place)
    inverse = [item for item in _all(root) if item.name == "Inverse_Model"]
    shift = 1.0 if any(item.name == "Rational_Function_Model" for item in _all(root)) else 0.0
    for item in [*_all(root), *(found for part in inverse for found in _all(part))]:
        words = item.text.split() if item.text else []
        if words and not item.children and all(NUMBER.fullmatch(word) for word in words):
            numbers = [float(word) for word in words]
            is_pixel = item.name in ("LINE_OFF", "SAMP_OFF")
            yield item.name.upper(), [numbers[0] - shift] if is_pixel else numbers


def _all(item: Element) -> Iterator[Element]:
    yield item
    for child in item.children:
        yield from _all(child)


def _one(values: dict[str, list[float]], key: str, place: Path) -> float:
    found = values.get(key) or values.get(SHORT[key])
    if not found or not np.isfinite(found[0]):
        raise InputError(f"{place}: {key} is missing, or no number")
    return found[0]


def _many(values: dict[str, list[float]], part: str, place: Path) -> list[float]:
    """The twenty coefficients of a polynomial: a list, or one field each."""
    found = values.get(SHORT[part]) or values.get(f"{part}_COEFF") or []
    if len(found) != COUNT:
        found = [_coefficient(values, f"{part}_COEFF_{k}", place) for k in range(1, COUNT + 1)]
    if not np.isfinite(found).all():
        raise InputError(f"{place}: a coefficient of {part} is not finite")
    return found


def _coefficient(values: dict[str, list[float]], key: str, place: Path) -> float:
    if not values.get(key):
        raise InputError(f"{place}: {key} is missing, or no number")
    return values[key][0]


def rpb_text(rpc: Rpc) -> str:
    """The text of a `.rpb` file."""
    names = {"LINE": "line", "SAMP": "samp", "LAT": "lat", "LONG": "long", "HEIGHT": "height"}
    lines = ['satId = "????";', 'bandId = "P";', 'SpecId = "RPC00B";', "BEGIN_GROUP = IMAGE"]
    lines += [f"\t{names[key]}Offset = {rpc.offsets[key]!r};" for key in KEYS]
    lines += [f"\t{names[key]}Scale = {rpc.scales[key]!r};" for key in KEYS]
    for part, row in zip(PARTS, rpc.coefficients.tolist(), strict=True):
        word = "".join([part.split("_")[0].lower(), part.split("_")[1].capitalize(), "Coef"])
        lines.append(f"\t{word} = (\n" + ",\n".join(f"\t\t{value!r}" for value in row) + ");")
    return "\n".join([*lines, "END_GROUP = IMAGE", "END;"]) + "\n"


def xml_text(rpc: Rpc) -> str:
    """The text of an XML file, as Maxar has it."""
    lines = [f"<{SHORT[f'{key}_OFF']}>{rpc.offsets[key]!r}</{SHORT[f'{key}_OFF']}>" for key in KEYS]
    lines += [f"<{SHORT[f'{key}_SCALE']}>{rpc.scales[key]!r}</{SHORT[f'{key}_SCALE']}>" for key in KEYS]
    for part, row in zip(PARTS, rpc.coefficients.tolist(), strict=True):
        name, words = SHORT[part], " ".join(map(repr, row))
        lines.append(f"<{name}List><{name}>{words}</{name}></{name}List>")
    inside = "\n".join(lines)
    return f'<?xml version="1.0" encoding="utf-8"?>\n<isd><RPB><IMAGE>\n{inside}\n</IMAGE></RPB></isd>\n'


def rpc_text(rpc: Rpc, path: Path) -> str:
    """The text of a file in the form that its ending says."""
    ending = path.suffix.lower()
    return rpb_text(rpc) if ending == ".rpb" else xml_text(rpc) if ending == ".xml" else rpc.text()
