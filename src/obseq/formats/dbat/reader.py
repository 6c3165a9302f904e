"""Projects of DBAT (XML scripts): what is measured, known and free; operations and outputs are left aside.

The camera has its distortion on the measures (a backward camera here); its parameters are in the unit of the
sensor, ours in pixels: a pixel is the height of the sensor over that of the image.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.formats.blocks.reading import hold_all_but, new_block, note_count
from obseq.images.bundle import BundleAdjustment
from obseq.images.camera import Camera
from obseq.images.control import ControlPoints
from obseq.images.measures import ImagePoints
from obseq.images.poses import Poses
from obseq.reading.origin import Origin
from obseq.reading.tables import number_in, text_of
from obseq.reading.text import counted
from obseq.reading.xml import Element, read_xml

ROOT, MODEL = "document", 3
DEGREE = (3, 1, 1)
ASPECT = 1e-4
PARAMETERS = {
    "all": ".*", "focal": "F", "cc": "F", "pp": "PP.", "px": "PPx", "py": "PPy",
    "K": "K.", "K1": "K1", "K2": "K2", "K3": "K3", "P": "p.", "P1": "p1", "P2": "p2",
    "aspect": "b1", "skew": "b2",
}  # fmt: skip
"""DBAT's camera parameters, single or in groups, as patterns of ours."""
CAMERA_FILE = "dbat_camera_version"
"""Attribute of the root of a file of cameras."""
TERMS = ("F", "PPx", "PPy", "K1", "K2", "K3", "p1", "p2", "b1")
"""Our names of what a camera of DBAT has, its skew being zero."""
SIGMAS, TURNS = ("sx", "sy", "sz"), ("so", "sp", "sk")
"""Columns of the sigmas of poses: of centres, and of angles."""


@dataclass(frozen=True)
class BrownCamera:
    """A camera of PhotoModeler and DBAT, in the unit of its sensor.

    Attributes:
        name: of the camera.
        size: columns and lines of the image.
        pixel: height of a pixel.
        focal: camera constant.
        principal_point: px and py, from the upper left corner, y down.
        radial: K1, K2, K3.
        decentric: P1, P2.
        aspect: width of a pixel over its height.
    """

    name: str
    size: tuple[int, int]
    pixel: float
    focal: float
    principal_point: tuple[float, float]
    radial: Sequence[float] = ()
    decentric: Sequence[float] = ()
    aspect: float = 1.0

    def camera(self) -> Camera:
        """The same as ours: distortion on the measures, coefficients times powers of the focal length."""
        given = {f"K{k}": value * self.focal ** (2 * k) for k, value in enumerate(self.radial, 1)}
        if len(self.decentric) == 2:
            given |= {"p1": self.decentric[0] * self.focal, "p2": -self.decentric[1] * self.focal}
        given["b1"] = self.aspect - 1.0
        with np.errstate(all="ignore"):
            x, y, focal = np.array([*self.principal_point, self.focal]) / self.pixel
        if not np.isfinite([x, y, focal]).all():
            raise InputError(
                f"camera {self.name}: its focal length or principal point is not finite in pixels"
            )
        return Camera(self.name, *self.size, focal, np.array([x, y]), DEGREE, given, backward=True)


@dataclass(frozen=True)
class _Rows:
    """The rows of a text file under the columns that its `format` names."""

    path: Path
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]

    def __contains__(self, column: str) -> bool:
        return column in self.columns

    @property
    def origin(self) -> Origin:
        return Origin(str(self.path), self.lines)

    def texts(self, column: str) -> list[str]:
        if column not in self.columns:
            raise InputError(
                f"{self.path}: the format has no column {column!r}, but {','.join(self.columns)}"
            )
        place = self.columns.index(column)
        return [row[place] for row in self.rows]

    def numbers(self, *columns: str) -> FloatArray:
        """(n, k) finite numbers."""
        found = np.empty((len(self.rows), len(columns)))
        for k, column in enumerate(columns):
            for row, word in enumerate(self.texts(column)):
                found[row, k] = number_in(word, f"{self.path}:{self.lines[row]}: {column} is")
        return found


def read_dbat(path: str | Path) -> BundleAdjustment:
    """The block of a DBAT script: camera, images, measures, control points, priors, what is estimated.

    Control points whose file gives no sigma are held. Check points are free points. Images are called as
    their files, without folders, or by their numbers when two files are called alike.

    Raises:
        InputError: another camera model than 3, several cameras, a file or a column that is missing; with
            file and line.
    """
    root = read_xml(Path(path))
    source = root.first("input")
    if root.name != ROOT or source is None:
        raise root.problem("this is no script of DBAT (document with input)")
    folder = _folder(source, Path(path))
    camera = _camera(source, folder)
    with new_block(path) as block:
        block.add_cameras(camera)
        hold_all_but(block, {camera.name: TERMS})
        names = _images(source, folder)
        block.add_images(names.values(), camera.name)
        _add_control(block, source, folder)
        _note_checks(block, source, folder)
        _add_measures(block, source, folder, names)
        _add_poses(block, source, folder, names)
        _add_estimates(block, root)
    return block


def _folder(source: Element, path: Path) -> Path:
    base = source.attributes.get("base_dir", "$HERE").replace("$HERE", str(path.parent))
    if "$" in base:
        raise source.problem(f"base_dir {base!r}: only $HERE is known here; replace it by a folder")
    return Path(base)


def _tables(holder: Element | None, folder: Path) -> Iterator[tuple[Element, _Rows]]:
    for element in holder.children if holder is not None else ():
        if element.name == "file":
            yield element, _filtered(holder, _read(element, folder))


def _read(element: Element, folder: Path) -> _Rows:
    columns = tuple(word.strip() for word in element.attributes.get("format", "").split(","))
    place = folder / element.plain
    if not element.plain or columns == ("",):
        raise element.problem("it needs the name of a file, and format with the names of its columns")
    rows, lines = [], []
    for index, line in enumerate(counted(place, text_of(place).splitlines()), 1):
        fields = tuple(word.strip() for word in line.partition("#")[0].split(","))
        if fields == ("",):
            continue
        if len(fields) < len(columns):
            raise InputError(f"{place}:{index}: {len(fields)} fields where {','.join(columns)} are expected")
        rows.append(fields[: len(columns)])
        lines.append(index)
    return _Rows(place, columns, tuple(rows), tuple(lines))


def _filtered(holder: Element | None, table: _Rows) -> _Rows:
    """The rows that the filters of a list of points leave, as the script asks for."""
    for item in holder.children if holder is not None else ():
        if item.name != "filter":
            continue
        wanted = {word.strip() for word in item.attributes.get("id", "").split(",")}
        if item.plain not in ("keep", "remove"):
            raise item.problem(f"a filter keeps or removes; not {item.plain!r}")
        kept = [k for k, name in enumerate(table.texts("id")) if (name in wanted) == (item.plain == "keep")]
        table = _Rows(
            table.path,
            table.columns,
            tuple(table.rows[k] for k in kept),
            tuple(table.lines[k] for k in kept),
        )
    return table


def _require(element: Element, table: _Rows, *columns: str) -> None:
    missing = [column for column in columns if column not in table]
    if missing:
        raise element.problem(f"its format has no column {missing[0]!r}")


def _all_cameras(holder: Element | None, folder: Path) -> Iterator[Element]:
    """The cameras of a script: in it, or in files of cameras that it names."""
    for item in holder.children if holder is not None else ():
        if item.name == "camera":
            yield item
        elif item.name == "file":
            path = folder / item.plain
            root = read_xml(path)
            if root.name != ROOT or CAMERA_FILE not in root.attributes:
                raise root.problem(f"no file of cameras ({ROOT} with {CAMERA_FILE})")
            yield from _all_cameras(root.first("cameras"), path.parent)


def _camera(source: Element, folder: Path) -> Camera:
    cameras = list(_all_cameras(source.first("cameras"), folder))
    if len(cameras) != 1:
        raise source.problem(f"{len(cameras)} cameras: one is read")
    element = cameras[0]
    if int(element.numeric("model")) != MODEL:
        raise element.problem(f"camera model {element.content('model')}: only {MODEL} is read")
    width, height = (int(value) for value in _numbers(element, "image", 2))
    sensor = element.content("sensor").split(",")
    tall = _numbers(element, "sensor", 2, ("auto",))[1]
    pixel, aspect = tall / height, element.numeric("aspect", 1.0)
    if sensor[0].strip() != "auto":
        own = float(_numbers(element, "sensor", 2)[0]) / width / pixel
        if abs(own / aspect - 1.0) > ASPECT:
            raise element.problem(
                f"pixels of the sensor are {own:g} times as wide as high; aspect says {aspect:g}"
            )
    cc, pp = element.content("cc", "focal"), element.content("pp", "default")
    focal = element.numeric("focal") if cc == "focal" else element.numeric("cc")
    middle = (width * pixel * aspect / 2.0, height * pixel / 2.0)
    if pp != "default":
        x, y = _numbers(element, "pp", 2)
        middle = (x, y)
    radial, decentric = (_numbers(element, tag) if element.first(tag) else [] for tag in "KP")
    if len(radial) > DEGREE[0] or len(decentric) not in (0, 2) or element.numeric("skew", 0.0) != 0.0:
        raise element.problem("more than K1, K2, K3, P1, P2, or a skew, is not read")
    name = element.content("name", "camera")
    return BrownCamera(name, (width, height), pixel, focal, middle, radial, decentric, aspect).camera()


def _numbers(element: Element, tag: str, count: int | None = None, words: Sequence[str] = ()) -> list[float]:
    """The numbers of a list; NaN for words that are allowed instead."""
    fields = [field.strip() for field in element.content(tag).split(",")]
    try:
        found = [np.nan if field in words else float(field) for field in fields]
        found = [] if "nan" in "".join(fields).lower() else found
    except ValueError:
        found = []
    if any(np.isinf(found)) or len(found) != (count or len(found)) or not found:
        raise element.problem(f"{tag} should be {count or 'some'} numbers, not {element.content(tag)!r}")
    return found


def _images(source: Element, folder: Path) -> dict[str, str]:
    """Names of images by their numbers."""
    found: dict[str, str] = {}
    for element, table in _tables(source.first("images"), folder):
        _require(element, table, "id", "path")
        found |= dict(zip(table.texts("id"), table.texts("path"), strict=True))
    short = {number: path.replace("\\", "/").rpartition("/")[2] for number, path in found.items()}
    return short if len(set(short.values())) == len(short) else {number: number for number in found}


def _sigmas_of(element: Element, table: _Rows, *groups: tuple[str, tuple[str, ...]]) -> FloatArray | None:
    """(n, k) sigmas: from columns each, from one column for several, or from attributes."""
    columns: list[FloatArray] = []
    for common, own in groups:
        for name in own:
            if name in table:
                columns.append(table.numbers(name)[:, 0])
            elif common in table:
                columns.append(table.numbers(common)[:, 0])
            elif name in element.attributes or common in element.attributes:
                text = element.attributes.get(name, element.attributes.get(common, ""))
                columns.append(np.full(len(table.rows), _sigma(element, text)))
    return np.column_stack(columns) if columns else None


def _sigma(element: Element, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise element.problem(f"the sigma {text!r} is no number") from None


def _add_control(block: BundleAdjustment, source: Element, folder: Path) -> None:
    for element, table in _tables(source.first("ctrl_pts"), folder):
        _require(element, table, "id", "x", "y", "z")
        plan = "sxyz" if "sxyz" in table or "sxyz" in element.attributes else "sxy"
        sigmas = _sigmas_of(element, table, (plan, ("sx", "sy")), ("sxyz", ("sz",)))
        places = table.numbers("x", "y", "z")
        if sigmas is not None and sigmas.shape != places.shape:
            raise element.problem("sigmas of some coordinates are missing (sx, sy, sz, or sxyz)")
        control = ControlPoints.of(table.texts("id"), places, 0.0 if sigmas is None else sigmas)
        block.add_control_points(control, table.origin)


def _note_checks(block: BundleAdjustment, source: Element, folder: Path) -> None:
    """Says which coordinates take no part."""
    names = [name for _, table in _tables(source.first("check_pts"), folder) for name in table.texts("id")]
    note_count(block, names, "check points are free points, whose known coordinates take no part")


def _add_measures(block: BundleAdjustment, source: Element, folder: Path, names: dict[str, str]) -> None:
    for element, table in _tables(source.first("image_pts"), folder):
        _require(element, table, "id", "im", "x", "y")
        sigmas = _sigmas_of(element, table, ("sxy", ("sx", "sy")))
        if sigmas is None:
            raise element.problem("the measures have no sigma (sxy, or sx and sy, in format or as attribute)")
        numbers = table.texts("im")
        lost = [number for number in numbers if number not in names]
        if lost:
            raise element.problem(f"{table.path}: the image {lost[0]} is not in the list of images")
        images = [names[number] for number in numbers]
        points = ImagePoints.of(images, table.texts("id"), table.numbers("x", "y"), sigmas)
        block.add_measures(points, name=table.path.name, origin=table.origin)


def _add_poses(block: BundleAdjustment, source: Element, folder: Path, names: dict[str, str]) -> None:
    """Poses that are known beforehand; with sigmas they are observations."""
    for element, table in _tables(source.first("prior_eo"), folder):
        _require(element, table, "id", "x", "y", "z", "omega", "phi", "kappa")
        images = [names.get(number, number) for number in table.texts("id")]
        angles = np.radians(table.numbers("omega", "phi", "kappa"))
        poses = Poses.of(images, table.numbers("x", "y", "z"), angles, "opk")
        block.add_poses(poses)
        found = [name for name in (*SIGMAS, *TURNS) if name in table]
        if not found:
            continue
        if found not in ([*SIGMAS], [*SIGMAS, *TURNS]):
            raise element.problem(
                f"of the sigmas of poses there are {', '.join(found)}: needed are {', '.join(SIGMAS)}, and "
                f"{', '.join(TURNS)} where angles have them, or none",
            )
        turn = None
        if TURNS[0] in found:
            turns = table.numbers(*TURNS)
            turn = float(np.radians(turns.flat[0]))
            if np.ptp(turns) > 0.0:
                raise element.problem("sigmas of angles that differ are not read")
        block.observe_poses(poses, table.numbers(*SIGMAS), turn)


def _add_estimates(block: BundleAdjustment, root: Element) -> None:
    """What the bundle estimates: of the camera only what is said to be true; skew never."""
    operations = root.first("operations")
    for operation in operations.children if operations is not None else ():
        chosen = operation.first("set_bundle_estimate_params")
        if chosen is None:
            continue
        block.freeze_parameters(".*")
        for tag, free in _flags(chosen.first("io")):
            pattern = PARAMETERS.get(tag)
            if pattern is None:
                raise chosen.problem(
                    f"the camera parameter {tag!r} is not known here; known: {', '.join(PARAMETERS)}"
                )
            (block.free_parameters if free else block.freeze_parameters)(pattern)
        for tag, free in _flags(chosen.first("eo")):
            if tag != "all":
                raise chosen.problem("poses are estimated as a whole or not at all here")
            if not free:
                block.freeze_centres()
                block.freeze_rotations()
        block.freeze_parameters("b2")


def _flags(element: Element | None) -> Iterator[tuple[str, bool]]:
    if element is None:
        return
    if element.plain:
        yield "all", _flag(element)
    yield from ((child.name, _flag(child)) for child in element.children if child.name != "c")


def _flag(element: Element) -> bool:
    if element.plain not in ("true", "false", "default"):
        raise element.problem(f"true, false or default is expected, not {element.plain!r}")
    return element.plain == "true"
