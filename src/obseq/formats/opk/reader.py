"""Poses as text with omega, phi, kappa, or a rotation matrix: a table whose columns are told.

| writer | columns | unit | form |
|---|---|---|---|
| Borea, Metashape, OriExport of MicMac | `NXYZOPK` | degree | camera to world, y up, z backwards |
| PhotoModeler | `NXYZKPO` | degree | the same angles, in the other order of columns |
| PATB, Inpho | `NXYZM`, nine numbers by rows | - | camera to world, or its transpose (`world_to_camera`) |

There is no standard: `check_convention` tells with one image and its measures whether the declared one fits.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import numpy as np

from obseq.arrays import FloatArray
from obseq.errors import InputError, naming
from obseq.images.adjustment.solution import BundleSolution
from obseq.images.block import Block
from obseq.images.camera import Camera
from obseq.images.control import ControlPoints
from obseq.images.measures import ImagePoints
from obseq.images.names import index_of
from obseq.images.poses import Poses
from obseq.reading.tables import number_in, text_of

LETTERS = "NXYZOPKM?"
NAMED = {
    "x": "X", "y": "Y", "z": "Z", "omega": "O", "phi": "P", "kappa": "K", "easting": "X", "northing": "Y",
    "altitude": "Z", "height": "Z",
}  # fmt: skip
"""What titles call columns."""
UNITS = {"degree": np.pi / 180.0, "gon": np.pi / 200.0, "radian": 1.0}
FLIP = np.array([1.0, -1.0, -1.0])
FIT = 0.05
"""Share of the image by which the declared convention may miss, and others must."""


def read_opk(
    path: str | Path,
    columns: str = "NXYZOPK",
    unit: str = "degree",
    *,
    world_to_camera: bool = False,
    camera: str = "",
) -> Poses:
    """Poses of images.

    Args:
        path: a text of one line per image; fields by blanks, commas, semicolons or tabs; lines that begin
            with # are left out, columns after those that are named too. A first line that names columns
            (`imageName X Y Z Omega Phi Kappa`) must name those of here.
        columns: `N` name, `X Y Z` centre, `O P K` angles or `M` for nine numbers of a matrix by rows, `?`
            for a column that is skipped.
        unit: of the angles: `degree`, `gon` or `radian`.
        world_to_camera: True for matrices that go from the world to the camera.
        camera: name of the camera of all images.

    Raises:
        InputError: a column or unit that is not known; a line that does not hold what it should.
    """
    wanted = _columns(columns)
    if unit not in UNITS:
        raise InputError(f"unit {unit!r}: angles are in {', '.join(UNITS)}")
    lines = [
        (number, line)
        for number, line in enumerate(text_of(path).splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    rows = [_row(path, number, line, wanted) for number, line in _after_title(path, lines, wanted)]
    if not rows:
        raise InputError(f"{path}: holds no pose")
    names, numbers = [name for name, _ in rows], [found for _, found in rows]
    centres = np.array([[found[letter] for letter in "XYZ"] for found in numbers])
    if "M" in wanted:
        matrices = np.array([[found[f"M{k}"] for k in range(9)] for found in numbers]).reshape(-1, 3, 3)
        turned = np.swapaxes(matrices, 1, 2) if world_to_camera else matrices
        rotations, form = turned * FLIP, "matrix"
    else:
        angles = np.array([[found[letter] for letter in "OPK"] for found in numbers])
        rotations, form = angles * UNITS[unit], "opk"
    with naming(path):
        return Poses.of(names, centres, rotations, form, camera)


def _columns(text: str) -> str:
    letters = "".join(text.split()).upper()
    unknown = sorted(set(letters) - set(LETTERS))
    if unknown:
        raise InputError(f"columns {text!r}: {unknown[0]} is none of {' '.join(LETTERS)}")
    twice = [letter for letter in set(letters) - {"?"} if letters.count(letter) > 1]
    turned = "M" in letters or set("OPK") <= set(letters)
    if twice or not set("NXYZ") <= set(letters) or not turned:
        raise InputError(f"columns {text!r}: needed once each are N X Y Z, and O P K or M")
    return letters


def _after_title(path: str | Path, lines: list[tuple[int, str]], columns: str) -> list[tuple[int, str]]:
    """The lines after a title, which has no number where numbers belong.

    Raises:
        InputError: the title names other columns.
    """
    words = _words(lines[0][1], _count(columns)) if lines else []
    fields = list(zip(columns, words, strict=False))
    if "M" in columns or not words or any(_is_number(word) for letter, word in fields if letter in "XYZOPK"):
        return lines
    named = [(letter, NAMED.get(word.lower(), letter)) for letter, word in fields if letter not in "N?"]
    if any(letter != name for letter, name in named):
        raise InputError(
            f"{path}:{lines[0][0]}: the title names the columns {' '.join(words)}, not {columns}: say them "
            "in this order (--opk-columns)"
        )
    return lines[1:]


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _count(columns: str) -> int:
    """How many fields a line has."""
    return len(columns) + (8 if "M" in columns else 0)


def _row(path: str | Path, number: int, line: str, columns: str) -> tuple[str, dict[str, float]]:
    count = _count(columns)
    words = _words(line, count)
    if len(words) < count:
        raise InputError(f"{path}:{number}: {len(words)} fields where {columns} are {count}")
    found: dict[str, float] = {}
    name, place = "", 0
    for letter in columns:
        width = 9 if letter == "M" else 1
        taken = words[place : place + width]
        place += width
        if letter == "N":
            name = taken[0]
        elif letter != "?":
            keys = [f"M{k}" for k in range(9)] if letter == "M" else [letter]
            found |= {
                key: number_in(word, f"{path}:{number}: a field is")
                for key, word in zip(keys, taken, strict=True)
            }
    return name, found


def _words(line: str, count: int) -> list[str]:
    """Fields by one separator, names with blanks among them; by any, where one does not give enough."""
    for separator in (";", "\t", ","):
        words = [word.strip() for word in line.split(separator)]
        if len(words) >= count and all(words[:count]):
            return words
    others = r"[;\t ]+" if ";" in line or "\t" in line else r"[, ]+"
    return [word for word in re.split(others, line.strip()) if word]


def opk_text(poses: Poses) -> str:
    """Poses as text that `read_opk` takes: name, centre, omega, phi, kappa in degrees.

    Fields are separated by blanks; by semicolons where names have blanks or commas.

    Raises:
        InputError: a name has no place in such a text.
    """
    check_names(poses.images)
    separator = " " if all(map(_is_word, poses.images)) else "; "
    angles = np.degrees(poses.attitudes("opk"))
    rows = [
        separator.join([name, *(f"{value:.17g}" for value in (*centre, *turn))]) + "\n"
        for name, centre, turn in zip(poses.images, poses.centres.tolist(), angles.tolist(), strict=True)
    ]
    return "# image X Y Z omega phi kappa (degrees; camera to world, y up, z backwards)\n" + "".join(rows)


def opk_files(solution: BundleSolution, path: str | Path) -> dict[Path, str]:
    """The file of the poses of a solution."""
    return {Path(path): opk_text(solution.poses)}


def check_block(block: Block) -> None:
    """Refuses a block whose images have names that such a text cannot hold (see `check_names`)."""
    check_names(block.camera_of)


def _is_word(name: str) -> bool:
    """Whether a name is one field among others that are separated by blanks."""
    return len(name.split()) == 1 and "," not in name


def check_names(images: Iterable[str]) -> None:
    """Refuses images whose names such a text cannot hold.

    Raises:
        InputError: one begins with #, has semicolons, line ends or tabs, or blanks around it.
    """
    wrong = [name for name in images if name != name.strip() or re.search(r"^#|[;\t\r\n\v\f]|^$", name)]
    if wrong:
        raise InputError(
            f"image {wrong[0]!r}: a name that begins with #, with a semicolon or a tab in it or blanks "
            "around it, has no place in a text of omega, phi, kappa; write the table of images (--poses)"
        )


def check_convention(
    poses: Poses, measures: ImagePoints, control: ControlPoints, cameras: Mapping[str, Camera]
) -> None:
    """Refuses poses whose convention is not the declared one, by known points that were measured.

    Args:
        poses: as read.
        measures: points in images.
        control: known points.
        cameras: by image.

    Raises:
        InputError: the known points are not where they were measured; another convention that fits is named.
    """
    known = measures.of_points(control.names)
    images = [image for image in known.image_names if image in poses]
    if not images:
        raise InputError("the convention of the poses cannot be tested: no control point is measured in them")
    ground = control.coordinates[index_of(control.names, known.point_names, "control point")]
    misses = {
        word: max(
            _miss(image, turn(poses[image].rotation), poses, known, ground, cameras) for image in images
        )
        for word, turn in CONVENTIONS.items()
    }
    if misses["as declared"] <= FIT:
        return
    better = [word for word, miss in misses.items() if miss <= FIT]
    hint = f"the poses fit when read with {better[0]}" if better else "no other convention that is known fits"
    raise InputError(f"known points are not where they were measured with the declared convention: {hint}")


CONVENTIONS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "as declared": lambda rotation: rotation,
    "the transposed matrix (world to camera)": lambda rotation: (rotation * FLIP).T * FLIP,
    "a camera with y down and z forward": lambda rotation: rotation * FLIP,
    "a transposed matrix of a camera with y down and z forward": lambda rotation: (rotation * FLIP).T,
}


def _miss(
    image: str,
    rotation: FloatArray,
    poses: Poses,
    known: ImagePoints,
    ground: FloatArray,
    cameras: Mapping[str, Camera],
) -> float:
    """Median distance of measured and projected points in shares of the image; infinite behind the camera."""
    rows = np.flatnonzero(known.image == known.image_names.index(image))
    camera = cameras[image]
    local = (ground[known.point[rows]] - poses[image].centre) @ rotation
    if not camera.is_in_front(local).all():
        return float("inf")
    off = np.linalg.norm(camera.project(local) - known.xy[rows], axis=1)
    return float(np.median(off) / max(camera.width, camera.height, 1.0))
