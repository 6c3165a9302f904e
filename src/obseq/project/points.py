"""Points of a project: measures in images (`MesIm`), coordinates (`MesGCP`), and the system they are in."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np

from obseq.arrays import FloatArray
from obseq.crs import parse
from obseq.errors import InputError
from obseq.images import ControlPoints, ImagePoints
from obseq.project.reports import converted
from obseq.project.tree import Reader, Tree, bare, merged, read_tree, tree_text
from obseq.reading.text import read_bytes

MEASURES, POINTS, SYSTEM = "SetMesIm", "SetGCP", "SysCoData"
MEASURES_PREFIX, POINTS_PREFIX, SYSTEM_FILE = "MesIm-", "MesGCP", "CurSysCo"
UNCODED = "NONE"
"""What the names of targets begin with that carry no code: they are no tie between images."""
NO_SYSTEM = "LocalNONE"
ENDINGS = (".xml", ".json")
_UPPER = np.triu_indices(3)


def read_image_measures(folder: str | Path, images: Iterable[str] | None = None) -> ImagePoints:
    """The measures of a folder ``ObjMesInstr/<Folder>`` (2023: ``PointsMeasure``); no uncoded targets.

    They have the variances and covariances of the files (which the original never uses).

    Args:
        folder: the folder.
        images: names of images, or None for all that have a file.

    Raises:
        InputError: with file and field; a point measured twice in an image; an image without file.
    """
    place = _folder(folder)
    files = _files(place, MEASURES_PREFIX) if images is None else [_measure_file(place, i) for i in images]
    if not files:
        raise InputError(f"{folder}: holds no measures ({MEASURES_PREFIX}<image>.xml or .json)")
    names: list[str] = []
    points: list[str] = []
    pixels: list[tuple[float, ...]] = []
    spread: list[tuple[float, ...]] = []
    for path in files:
        fields = Reader(read_tree(path), str(path)).fields(MEASURES)
        image = fields.text("NameIm")
        for one in _entries(fields, "Measures"):
            if one.text("Name").startswith(UNCODED):
                continue
            names.append(image)
            points.append(one.text("Name"))
            pixels.append(one.numbers("Pt", 2))
            spread.append(_pixel_spread(one))
    table = np.array(spread).reshape(-1, 3)
    return ImagePoints.of(names, points, np.array(pixels).reshape(-1, 2), table[:, :2], table[:, 2])


def measures_text(image: str, measures: ImagePoints, *, as_json: bool = False) -> str:
    """The file of the measures of one image."""
    mine = measures.of_image(image)
    entries: list[Tree] = [
        {
            "Name": mine.point_names[point],
            "Pt": _floats(xy),
            "Sigma2": (float(matrix[0, 0]), float(matrix[0, 1]), float(matrix[1, 1])),
        }
        for point, xy, matrix in zip(mine.point, mine.xy, mine.matrices, strict=True)
    ]
    return tree_text(MEASURES, {"NameIm": image, "Measures": entries}, as_json=as_json)


def measure_copies(source: Path, target: Path) -> dict[Path, str | bytes]:
    """The files of the measures in a folder, for another one; none where there is no such folder."""
    return {target / path.name: read_bytes(path) for path in sorted(source.glob(f"{MEASURES_PREFIX}*"))}


def read_control_points(
    folder: str | Path,
    *,
    is_chosen: Callable[[str, str], bool] = lambda name, information: True,
) -> ControlPoints:
    """The points of all ``MesGCP*`` files of a folder; those without variances are free.

    Args:
        folder: ``ObjCoordWorld/<Folder>`` (2023: ``PointsMeasure/<Folder>``).
        is_chosen: of name and additional information, whether a point is taken.

    Raises:
        InputError: no file, a field that is wrong, a name given twice.
    """
    chosen = [
        one for one in _point_entries(folder) if is_chosen(one.text("Name"), one.text("AdditionalInfo", ""))
    ]
    places = np.array([one.numbers("Pt", 3) for one in chosen], dtype=np.float64).reshape(-1, 3)
    plain = ControlPoints.of([one.text("Name") for one in chosen], places)
    return ControlPoints(plain.names, plain.coordinates, _covariances(chosen))


def read_entries(folder: str | Path) -> dict[str, Tree]:
    """What stands in the files of a folder of each of its points, by their names."""
    return {one.text("Name"): one.tree for one in _point_entries(folder)}


def _point_entries(folder: str | Path) -> Iterator[Reader]:
    files = _files(_folder(folder), POINTS_PREFIX)
    if not files:
        raise InputError(f"{folder}: holds no points ({POINTS_PREFIX}*.xml or .json)")
    for path in files:
        yield from _entries(Reader(read_tree(path), str(path)).fields(POINTS), "Measures")


def points_text(
    points: ControlPoints, name: str, sources: Mapping[str, Tree] | None = None, *, as_json: bool = False
) -> str:
    """The file of control points; free ones without variances, held ones with zeros.

    Args:
        points: what is written.
        name: of the set.
        sources: entries of points by name, as files have them (`read_entries`); what they have besides is
            kept.
        as_json: True for JSON.

    Raises:
        InputError: a point is known in some of its coordinates only.
    """
    known = sources or {}
    entries: list[Tree] = []
    for one, place, covariance in zip(points.names, points.coordinates, points.covariances, strict=True):
        entry: dict[str, Tree] = {
            "Name": one,
            "Pt": _floats(place),
            "AdditionalInfo": "",
        }
        if np.isfinite(covariance).all():
            entry["__Opt__Sigma2"] = _floats(covariance[_UPPER])
        elif not np.isinf(np.diag(covariance)).all():
            raise InputError(f"control point {one}: a project holds points known in x, y and z, or free")
        entries.append(_kept(known.get(one, {}), entry))
    return tree_text(POINTS, {"NameSet": name, "Measures": entries}, as_json=as_json)


def _kept(source: Tree, entry: dict[str, Tree]) -> Tree:
    """An entry of a point, with what its source says besides; its old variances are not."""
    old = source if isinstance(source, dict) else {}
    besides = {key: value for key, value in old.items() if bare(key) != "Sigma2"}
    return merged(besides, {**entry, "AdditionalInfo": besides.get("AdditionalInfo", "")})


def read_system(folder: str | Path) -> str:
    """The definition of the coordinate system of a folder; ``LocalNONE`` where it has none."""
    for ending in ENDINGS:
        if (path := Path(folder) / f"{SYSTEM_FILE}{ending}").is_file():
            return read_definition(path)
    return NO_SYSTEM


def read_definition(path: str | Path) -> str:
    """The definition of a coordinate system in a file (``SysCoData``)."""
    return Reader(read_tree(path), str(path)).fields(SYSTEM).text("Def")


def system_text(definition: str, *, as_json: bool = False) -> str:
    """The file of a coordinate system."""
    return tree_text(SYSTEM, {"Def": definition}, as_json=as_json)


def _folder(folder: str | Path) -> Path:
    place = Path(folder)
    if not place.is_dir():
        raise InputError(f"{folder}: there is no such folder")
    return place


def set_name(folder: Path, otherwise: str) -> str:
    """The name of the file of points in a folder, where it has one file."""
    files = _files(folder, POINTS_PREFIX)
    return files[0].stem if len(files) == 1 else f"{POINTS_PREFIX}-{otherwise}"


def _files(folder: Path, prefix: str) -> list[Path]:
    return sorted(path for path in folder.glob(f"{prefix}*") if path.suffix in ENDINGS)


def _measure_file(folder: Path, image: str) -> Path:
    for ending in ENDINGS:
        if (path := folder / f"{MEASURES_PREFIX}{image}{ending}").is_file():
            return path
    raise InputError(f"{folder}: there are no measures of the image {image} ({MEASURES_PREFIX}{image}.xml)")


def _entries(fields: Reader, name: str) -> list[Reader]:
    return [Reader(tree, f"{fields.where}: entry {k + 1}") for k, tree in enumerate(fields.list(name))]


def _pixel_spread(one: Reader) -> tuple[float, float, float]:
    """Standard deviations of column and line, and their covariance; one pixel where the file gives none."""
    if not one.has("Sigma2"):
        return 1.0, 1.0, 0.0
    xx, xy, yy = map(float, one.numbers("Sigma2", 3))
    if not (xx > 0 and yy > 0 and xy * xy < xx * yy):
        raise InputError(f"{one.where}: point {one.text('Name')}: Sigma2 must be positive variances")
    return xx**0.5, yy**0.5, xy


def _covariances(entries: list[Reader]) -> FloatArray:
    """(n, 3, 3) of points; infinite variances where the file gives none."""
    found = np.zeros((len(entries), 3, 3))
    found[:, range(3), range(3)] = np.inf
    given = [k for k, one in enumerate(entries) if one.has("Sigma2")]
    upper = np.array([entries[k].numbers("Sigma2", 6) for k in given], dtype=np.float64).reshape(-1, 6)
    rows, columns = _UPPER
    matrices = np.empty((len(given), 3, 3))
    matrices[:, rows, columns] = matrices[:, columns, rows] = upper
    negative = np.linalg.eigvalsh(matrices)[:, 0] < 0.0
    if negative.any():
        one = entries[given[int(negative.argmax())]]
        raise InputError(f"{one.where}: point {one.text('Name')}: Sigma2 is no covariance: not positive")
    found[given] = matrices
    return found


def _floats(values: FloatArray) -> tuple[float, ...]:
    return tuple(values.tolist())


def differ(first: str, second: str) -> bool:
    """Whether two definitions are of different systems; where one says nothing, nobody can tell."""
    return NO_SYSTEM not in (first, second) and first != second and parse(first) != parse(second)


def require_one(first: Path, second: Path) -> None:
    """Refuses two folders of different systems.

    Raises:
        InputError: they are, with their definitions.
    """
    one, other = read_system(first), read_system(second)
    if differ(one, other):
        raise InputError(
            f"{first} is in {one}, {second} in {other}: convert one of them (change-sysco converts points)"
        )


def brought_to(control: ControlPoints, points: Path, orientation: Path) -> tuple[ControlPoints, str]:
    """Points of a folder in the system of an orientation, and a sentence where they were converted.

    Raises:
        CrsError: a system is unknown, or nothing leads from one to the other.
    """
    given, wanted = read_system(points), read_system(orientation)
    if not differ(given, wanted):
        return control, ""
    told = f"points converted from {given} to {wanted}, the system of the orientation"
    return converted(control, given, wanted), told
