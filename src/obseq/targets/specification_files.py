"""Specification files of MMVII: encodings and full specifications, read in all spellings and written.

XML of 2022 to 2026, or JSON. Files before 2024 have no `Root` above, lists with a count `Nb`, `Geometry` for
`GeometryCodedTarget`, and a tag with a comma in its name.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.project.tree import Reader, read_tree, root_of, tree_text
from obseq.reading.text import read_bytes
from obseq.targets.codes import bits_of, members
from obseq.targets.drawing.drawings import bit_centres, centre, corners
from obseq.targets.families import family
from obseq.targets.specification import Geometry, Specification

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from xml.etree.ElementTree import Element

    from obseq.arrays import FloatRows
    from obseq.project.tree import Tree

LARGEST = 64 << 20
"""Bytes of the largest file that is read; a set of 24793 codes takes 4 million."""
COMMA = re.compile(rb"<(/?)(\w+),>")
"""A tag of old files with a comma at its end, which XML has not."""
COUNT, ENTRY = "Nb", "el"
CODED = re.compile(r"<el>\n(\s*<NumCode>\d+ (\d+)</NumCode>)")
FULL, ENCODING = "FullSpecifTarget", "BitEncoding"


def read_specifications(paths: Sequence[str | Path]) -> list[Specification]:
    """The specifications of several files; names are told apart by their images.

    Raises:
        InputError: two files give targets of one name, or one of them cannot be read.
    """
    found = [read_specification(path) for path in paths]
    owner: dict[str, str | Path] = {}
    for path, spec in zip(paths, found, strict=True):
        for name in spec.codes:
            other = owner.setdefault(name, path)
            if other != path:
                raise InputError(
                    f"{path}: the target {name} is also in {other}; look for one of the sets at a time, "
                    "or make one of them with names that begin differently"
                )
    return found


def read_specification(path: str | Path) -> Specification:
    """The specification of a file; one of codes alone has the geometry of its family.

    Raises:
        InputError: with file and field.
    """
    place = Path(path)
    whole = Reader(_content(place), str(place))
    if whole.has(FULL):
        whole = whole.fields(FULL)
    encoding = whole.fields(ENCODING) if whole.has(ENCODING) else whole
    asked = encoding.fields("Specifs")
    bits = asked.integer("NbBits")
    name = asked.text("Type")
    try:
        geometry = _geometry(whole, name, bits)
        spec = _specification(geometry, bits, asked, encoding)
    except InputError as error:
        message = str(error)
        raise InputError(message if message.startswith(str(place)) else f"{place}: {message}") from None
    return _with_order_of_rows(spec, whole)


def _content(path: Path) -> Tree:
    data = read_bytes(path, LARGEST)
    if data.lstrip()[:1] == b"{":
        return read_tree(path)
    if data.lstrip()[:1] != b"<":
        raise InputError(f"{path}: is neither XML nor JSON; give a specification of coded targets")
    found = _tree(root_of(path, COMMA.sub(rb"<\1\2>", data)), str(path), 0)
    if isinstance(found, dict) and isinstance(found.get("Data"), dict):
        found = found["Data"]
    if not isinstance(found, dict):
        raise InputError(f"{path}: holds no specification of coded targets")
    return found


def _tree(node: Element, where: str, depth: int) -> Tree:
    """What an element holds, as `obseq.project.tree` has it."""
    if depth > 32:
        raise InputError(f"{where}: is nested deeper than 32 levels")
    children = list(node)
    if not children:
        return _leaf((node.text or "").strip(), f"{where}: {node.tag}")
    if children[-1].tag == ENTRY:
        return [_tree(child, where, depth + 1) for child in children if child.tag == ENTRY]
    return {child.tag: _tree(child, where, depth + 1) for child in children}


def _leaf(text: str, where: str) -> Tree:
    if text.startswith('"'):
        return text.strip('"')
    try:
        return tuple([int(word) if word.lstrip("+-").isdecimal() else _finite(word) for word in text.split()])
    except ValueError:
        raise InputError(f"{where}: {text[:40]!r} is not a number (texts stand in quotes)") from None


def _finite(word: str) -> float:
    value = float(word)
    if not math.isfinite(value):
        raise ValueError(word)
    return value


def _geometry(whole: Reader, name: str, bits: int) -> Geometry:
    usual = family(name).geometry(bits)
    tags = [tag for tag in ("GeometryCodedTarget", "Geometry") if whole.has(tag)]
    if not tags:
        return usual
    found = whole.fields(tags[0])
    x, y = found.numbers("CenterOrientTablet", 2) if found.has("CenterOrientTablet") else usual.mark_place
    unit = float(found.number("SzCCB")) if found.has("SzCCB") else 1.0
    if not unit > 0.0:
        raise InputError(f"{found.where}: SzCCB must be positive, not {unit}")

    def flag(tag: str, value: bool) -> bool:
        return bool(found.integer(tag, int(value)))

    return Geometry(
        name,
        found.number("ThickN_WhiteInt") / unit,
        found.number("ThickN_Code") / unit,
        found.number("ThickN_WhiteExt") / unit,
        found.number("ThickN_BorderExt") / unit,
        _exact(float(found.number("ChessBoardAngle"))),
        flag("WithChessBoard", usual.is_chequered),
        flag("WhiteBackGround", usual.is_white),
        flag("ZeroIsBackGround", usual.zero_is_sheet),
        flag("AntiClockWiseBit", usual.grows),
        flag("ModeFlight", usual.in_rows),
        flag("CBAtTop", usual.at_top),
        _optional(found, "RayOrientTablet", usual.mark),
        (float(x), float(y)),
        _optional(found, "RayCenterMiniTarget", usual.rings),
    )


def _exact(angle: float) -> float:
    """An angle of which the file has 15 digits: eighths of a turn are meant as such."""
    whole = math.pi / 4 * round(angle / (math.pi / 4))
    return whole if abs(angle - whole) < 1e-9 else angle


def _optional(found: Reader, tag: str, usual: float) -> float:
    return float(found.number(tag)) if found.has(tag) else usual


def _specification(geometry: Geometry, bits: int, asked: Reader, encoding: Reader) -> Specification:
    codes: dict[str, int] = {}
    numbers: dict[str, int] = {}
    for entry in encoding.list("Encoding"):
        fields = Reader(entry, f"{encoding.where}: Encoding")
        number, code = fields.numbers("NumCode", 2)
        name = fields.text("Name")
        if name in codes:
            raise InputError(f"{fields.where}: the name {name!r} stands twice")
        if not name or name != name.strip() or any(letter.isspace() for letter in name):
            raise InputError(f"{fields.where}: the name {name!r} is empty or holds spaces; rename the target")
        codes[name], numbers[name] = int(code), int(number)
    computed = asked.fields("Computed") if asked.has("Computed") else asked
    runs = asked.numbers("MaxRunL", 2) if asked.has("MaxRunL") else (1000, 1000)
    return Specification(
        geometry,
        bits,
        asked.integer("FreqCircEq") or bits,
        codes,
        numbers,
        asked.integer("MinHammingD", 1),
        (int(runs[0]), int(runs[1])),
        asked.integer("Parity", 3),
        asked.integer("MaxNb", 1000),
        asked.integer("Base4N", 10),
        computed.integer("NbDigit", max((len(name) for name in codes), default=2)),
        computed.text("TargetNamePrefix", ""),
        bool(asked.integer("UseHammingCode", 0)),
        computed.text("Prefix", ""),
    )


def _with_order_of_rows(spec: Specification, whole: Reader) -> Specification:
    """The same with lower rows as the file's own places of bits have them: until 2023 forwards, then back."""
    if not (spec.geometry.in_rows and not spec.geometry.at_top and whole.has("Centers")):
        return spec
    places = np.array([entry for entry in whole.list("Centers") if isinstance(entry, tuple)], dtype=float)
    if places.shape != (spec.bits, 2):
        raise InputError(f"{whole.where}: Centers should be {spec.bits} points")
    lower = places[spec.bits // 2 :, 0]
    if lower[0] > lower[-1]:
        return spec
    return replace(spec, geometry=replace(spec.geometry, is_lower_row_forwards=True))


def encoding_text(spec: Specification) -> str:
    """The file `<prefix>_SpecEncoding.xml`: the codes alone."""
    return _commented(tree_text(ENCODING, _encoding(spec)), spec.bits)


def specification_text(spec: Specification) -> str:
    """The file `<prefix>_FullSpecif.xml`: codes, geometry, and where bits are in the reduced drawing."""
    content: Tree = {
        ENCODING: _encoding(spec),
        "GeometryCodedTarget": _geometry_tree(spec),
        "Centers": _points(bit_centres(spec)),
    }
    return _commented(tree_text(FULL, content), spec.bits)


def _commented(text: str, bits: int) -> str:
    """The same with the bits of each code, bit 0 first, in a comment."""
    return CODED.sub(lambda found: f"<el>  <!--{bits_of(int(found[2]), bits)}-->\n{found[1]}", text)


def _encoding(spec: Specification) -> Tree:
    turned = [max(members(code, spec.bits, spec.frequency)) for code in spec.codes.values()]
    asked: Tree = {
        "Type": spec.family,
        "NbBits": (spec.bits,),
        "FreqCircEq": (spec.frequency,),
        "MinHammingD": (spec.distance,),
        "UseHammingCode": (int(spec.uses_hamming),),
        "MaxRunL": spec.runs,
        "Parity": (spec.parity,),
        "MaxNb": (spec.most,),
        "Base4N": (spec.base,),
        "Computed": {
            "Prefix": spec.prefix,
            "NbDigit": (spec.digits,),
            "TargetNamePrefix": spec.before,
            "MaxNum": (max(spec.numbers.values()),),
            "MaxLowCode": (max(spec.codes.values()),),
            "MaxCodeEqui": (max(turned),),
        },
    }
    entries: list[Tree] = [
        {"NumCode": (spec.numbers[name], code), "Name": name} for name, code in spec.codes.items()
    ]
    return {"Specifs": asked, "Encoding": entries}


def _geometry_tree(spec: Specification) -> Tree:
    geometry = spec.geometry
    first, second = corners(spec)
    return {
        "Type": geometry.family,
        "NbBits": (spec.bits,),
        "CenterF": _numbers(centre(spec)),
        "CornEl1": _numbers(first),
        "CornEl2": _numbers(second),
        "SzCCB": (1,),
        "ThickN_WhiteInt": (geometry.inside,),
        "ThickN_Code": (geometry.code,),
        "ThickN_WhiteExt": (geometry.outside,),
        "ThickN_BorderExt": (geometry.border,),
        "ThickN_Car": (0.3 if geometry.in_rows else 0.7,),
        "ChessBoardAngle": (geometry.angle,),
        "ModeFlight": (int(geometry.in_rows),),
        "CBAtTop": (int(geometry.at_top),),
        "WithChessBoard": (int(geometry.is_chequered),),
        "WhiteBackGround": (int(geometry.is_white),),
        "ZeroIsBackGround": (int(geometry.zero_is_sheet),),
        "AntiClockWiseBit": (int(geometry.grows),),
        "RayOrientTablet": (geometry.mark,),
        "CenterOrientTablet": geometry.mark_place,
        "RayCenterMiniTarget": (geometry.rings,),
    }


def _points(places: FloatRows) -> Tree:
    found: list[Tree] = [_numbers(place) for place in places]
    return found


def _numbers(values: Iterable[float]) -> tuple[float, ...]:
    return tuple(float(value) for value in values)
