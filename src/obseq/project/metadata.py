"""Metadata of images by rules (`CalcMTD`), and lists of names."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import field, replace
from pathlib import Path

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.images import Camera
from obseq.project.tree import Reader, Tree, merged, read_tree, tree_text
from obseq.reading.tables import number_in

RULES, NAMES = "MetaData", "SetOfName"
MODES = ("Focalmm", "FocalPix", "PPPix", "Aperture", "ModelCam", "NbPixel", "AdditionalName")
UNSET = "NONE"


@dataclass(frozen=True)
class Rules:
    """Rules that give metadata of images from their names.

    Attributes:
        tries: by mode, patterns and values in the order they are tried.
        where: what messages begin with.
        entries: what the file that they were read from says of each mode; what it has besides is kept.
    """

    tries: dict[str, tuple[tuple[str, str], ...]]
    where: str = "metadata"
    entries: dict[str, Tree] = field(default_factory=dict)

    def value(self, mode: str, image: str) -> str | None:
        """The value of the first rule whose pattern matches the whole name and does not give NONE; else None.

        Raises:
            InputError: an unknown mode, or a pattern that is no regular expression.
        """
        for pattern, value in self.rules(mode):
            match = whole_match(pattern, image, self.where)
            if match:
                found = replaced(match, value)
                if found != UNSET:
                    return found
        return None

    def rules(self, mode: str) -> tuple[tuple[str, str], ...]:
        """Patterns and values of a mode in the order they are tried."""
        if mode not in MODES:
            raise InputError(f"{self.where}: unknown mode {mode!r}; modes are {', '.join(MODES)}")
        return self.tries.get(mode, ())

    def calibration_name(self, image: str) -> str:
        """``CalibIntr_Cam<model>[_Add<additional>]_Foc<1000 f>``, blanks of the model as underscores.

        Raises:
            InputError: no rule gives the model or the focal length of the image.
        """
        return self.calibration_names(image)[0]

    def calibration_names(self, image: str) -> tuple[str, str]:
        """The name of today, with thousandths of millimetres, and that of 2023, with millimetres."""
        model, focal = self.value("ModelCam", image), self.value("Focalmm", image)
        if model is None or focal is None:
            missing = "ModelCam" if model is None else "Focalmm"
            raise InputError(f"{self.where}: no rule of mode {missing} matches the image {image}")
        additional = self.value("AdditionalName", image)
        part = f"_Add{additional}" if additional else ""
        thousandth = round(1000.0 * number_in(focal, f"{self.where}: Focalmm of {image} is"))
        begin = f"CalibIntr_Cam{model.replace(' ', '_')}{part}_Foc"
        return f"{begin}{thousandth}", f"{begin}{thousandth // 1000}"


def read_rules(path: str | Path) -> Rules:
    """The rules of a file ``MetaData/<Folder>/CalcMTD.xml``."""
    tree = read_tree(path)
    entries: dict[str, Tree] = {}
    tries: dict[str, tuple[tuple[str, str], ...]] = {}
    for entry in Reader(tree, str(path)).list(RULES):
        fields = Reader(entry, f"{path}: {RULES}")
        mode = fields.text("Mode")
        if mode in tries:
            raise InputError(f"{path}: the mode {mode} comes twice")
        entries[mode] = entry
        rules = [Reader(one, f"{path}: {mode}") for one in fields.list("Tries")]
        tries[mode] = tuple((one.text("Pat"), one.text("Val")) for one in rules)
    return Rules(tries, str(path), entries)


def edited(rules: Rules, mode: str, pattern: str, value: str, rank: int) -> Rules:
    """The rules with one more, or another one, in a mode (MMVII's `Modif`).

    Args:
        rules: as they are.
        mode: what the rule gives.
        pattern: of whole names of images.
        value: with ``$1`` ... for the groups of the pattern; ``NONE`` leaves the choice to the next rule.
        rank: 0 or more takes the place of the rule there, or comes last; -1 goes first; -2 is the only one.

    Raises:
        InputError: an unknown mode, or no regular expression.
    """
    whole_match(pattern, "", rules.where)
    old, new = list(rules.rules(mode)), (pattern, value)
    before = old[: max(rank, 0)]
    after = [] if rank == -2 else old if rank == -1 else old[rank + 1 :]
    changed = [*before, new, *after]
    return replace(rules, tries={**rules.tries, mode: tuple(changed)})


def rules_text(rules: Rules, *, as_json: bool = False) -> str:
    """The file of rules."""
    content = [_entry(rules.entries.get(mode, {}), mode, tries) for mode, tries in rules.tries.items()]
    return tree_text(RULES, content, as_json=as_json)


def _entry(old: Tree, mode: str, tries: Iterable[tuple[str, str]]) -> Tree:
    """The entry of a mode: what the old one says besides, of the mode and of rules that are still there."""
    listed = old.get("Tries") if isinstance(old, dict) else None
    known = {(rule.get("Pat"), rule.get("Val")): rule for rule in listed or () if isinstance(rule, dict)}
    rules: list[Tree] = [
        merged(known.get((pattern, value), {}), {"Pat": pattern, "Val": value}) for pattern, value in tries
    ]
    return merged(old, {"Mode": mode, "Tries": rules})


def read_names(path: str | Path) -> list[str]:
    """The names of a list (``SetOfName``)."""
    found = Reader(read_tree(path), str(path)).list(NAMES)
    for name in found:
        if not isinstance(name, str):
            raise InputError(f"{path}: {NAMES} should hold texts in quotes")
    return [str(name) for name in found]


def names_text(names: Sequence[str], *, as_json: bool = False) -> str:
    """The file of a list of names."""
    return tree_text(NAMES, list(names), as_json=as_json)


def chosen(names: Iterable[str], pattern: str) -> list[str]:
    """The names that a pattern matches as a whole, in order; an empty pattern accepts all."""
    return [name for name in names if not pattern or whole_match(pattern, name, "pattern")]


def whole_match(pattern: str, name: str, where: str) -> re.Match[str] | None:
    """The match of a regular expression with a whole name.

    Raises:
        InputError: if the pattern is no regular expression.
    """
    try:
        return re.fullmatch(pattern, name)
    except re.error as error:
        raise InputError(f"{where}: {pattern!r} is no regular expression: {error}") from None


def replaced(match: re.Match[str], value: str) -> str:
    """A value with ``$1`` ... ``$9`` and ``$&`` replaced by what matched."""

    def part(found: re.Match[str]) -> str:
        which = found[1]
        if which == "&":
            return match[0]
        number = int(which)
        return (match[number] or "") if number <= (match.re.groups) else ""

    return re.sub(r"\$([1-9&])", part, value)


@dataclass(frozen=True)
class Body:
    """A camera body.

    Attributes:
        pixel_microns: size of a pixel.
        size: (width, height) of its full images.
    """

    pixel_microns: float
    size: tuple[int, int]


BODIES = {
    "UltraCam Eagle Mark 3": Body(4.0, (26460, 17004)),
    "NIKON D5600": Body(3.90, (6000, 4000)),
    "NIKON D3X": Body(5.95, (6048, 4032)),
    "SONY A6400": Body(3.9, (6000, 4000)),
    "ILCE-6400": Body(3.9, (6000, 4000)),
    "DIAG-ILCE-6400": Body(5.5, (5023, 5023)),
}


def initial_camera(
    rules: Rules,
    image: str,
    *,
    size: tuple[int, int] | None = None,
    degree: tuple[int, int, int] = (3, 1, 1),
    projection: str = "Stenope",
    fraser: bool = True,
) -> Camera:
    """The calibration that metadata give of an image, without distortion.

    The focal length is that of ``FocalPix``, or of ``Focalmm`` and the body, whose ratio of diagonals to
    `size` allows for reduced images. A focal length in pixels needs no body (the original asks for one all
    the same).

    Args:
        rules: of the project.
        image: name of the image.
        size: (width, height) of the image; that of the body when None.
        degree: of the distortion.
        projection: of the camera.
        fraser: choice of the terms of degree 1.

    Raises:
        InputError: a rule is missing, or the body is unknown and needed.
    """
    body = BODIES.get(rules.value("ModelCam", image) or "")
    if size is None:
        size = _body(body, rules, image).size
    pixels = rules.value("FocalPix", image)
    if pixels is not None:
        focal = float(pixels)
    else:
        known = _body(body, rules, image)
        millimetres = float(rules.value("Focalmm", image) or np.nan)
        reduction = float(np.hypot(*known.size) / np.hypot(*size))
        focal = 1000.0 * millimetres / (reduction * known.pixel_microns)
    principal = rules.value("PPPix", image)
    middle = np.array(size) / 2.0 if principal is None else np.array([float(v) for v in principal.split()])
    name = rules.calibration_name(image)
    return Camera(name, *size, focal, middle, degree, {}, projection, fraser)


def _body(body: Body | None, rules: Rules, image: str) -> Body:
    if body is None:
        model = rules.value("ModelCam", image)
        raise InputError(
            f"image {image}: the camera {model!r} is unknown; give the focal in pixels (rule FocalPix) and "
            f"the size of the image. Known are {', '.join(BODIES)}"
        )
    return body
