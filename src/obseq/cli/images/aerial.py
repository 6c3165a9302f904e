"""`obseq image-world`, `world-image`, `intersect`, `resect`: aerial images on a map, from Borea's files."""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from obseq.cli.images.bundle_ground import say_outside
from obseq.cli.parsing import Commands, add_command, finite_number, positive_integer, positive_number
from obseq.cli.progress import Progress
from obseq.errors import InputError
from obseq.printable import printable, printable_line
from obseq.writing import check_writable, write_all

if TYPE_CHECKING:
    from obseq.images.aerial import FrameCamera, Geoid, HeightType, MapSystem, Surface, Worksite
    from obseq.images.aerial.result_columns import LeftOut, Table

LEFT_OUT = 1
"""Exit code: something was left out, or residuals are larger than expected."""
SHOWN = 20
"""Lines of what was left out that are printed."""

MORE = """
Files have columns separated by blanks, and no line that names them: options (--shots-header, ...) say
what they hold, one letter each: N shot, X Y, Z altitude or H ellipsoidal height, O P K angles,
C camera, P point, T type, S skipped."""

EXIT = "exit code: 0 done; 1 done, and lines were left out (each with its reason); 2 could not run"

EXIT_RAYS = """\
The last lines say whether the rays meet as --sigma announces, and which points are suspected to be
gross errors (column sigma0: residuals of each point over what is announced).

exit code: 0 done; 1 done, and lines were left out (each with its reason), rays miss each other by
more than is announced, or a gross error is suspected; 2 could not run"""


def register(commands: Commands) -> None:
    """Add the four commands to the parser."""
    _image_world(commands)
    _world_image(commands)
    _intersect(commands)
    _resect(commands)


def _image_world(commands: Commands) -> None:
    purpose = "find the ground points of image points on a terrain model or at a height"
    command = add_command(commands, "image-world", _run(_ground), purpose, MORE, EXIT)
    _add_site(command)
    _add_measures(command, required=True)
    command.add_argument(
        "--height", type=finite_number, metavar="Z", help="ground of this z everywhere, of the type --z-type"
    )
    _add_results(command)


def _world_image(commands: Commands) -> None:
    purpose = "find where ground points are in the images"
    command = add_command(commands, "world-image", _run(_images), purpose, MORE, EXIT)
    _add_site(command)
    _add_ground(command)
    _add_measures(command, required=False, what="which points in which shots (without it: wherever they are)")
    _add_results(command)


def _intersect(commands: Commands) -> None:
    purpose = "intersect the rays of points measured in several images"
    command = add_command(commands, "intersect", _run(_intersections), purpose, MORE, EXIT_RAYS)
    _add_site(command)
    _add_measures(command, required=True)
    command.add_argument(
        "--method",
        choices=("pair", "all"),
        default="pair",
        help="the two most distant shots of a point, or least squares over all its rays (pair)",
    )
    command.add_argument(
        "--sigma", type=positive_number, default=1.0, metavar="PX", help="of a column or line, pixels (1)"
    )
    _add_results(command)


def _resect(commands: Commands) -> None:
    purpose = "find the poses of images from points known on the ground"
    command = add_command(commands, "resect", _run(_poses), purpose, MORE, EXIT)
    _add_cameras(command)
    _add_map(command)
    _add_measures(command, required=True)
    _add_ground(command)
    command.add_argument(
        "--position", nargs=3, type=finite_number, metavar=("X", "Y", "H"), help="approximate, of all shots"
    )
    command.add_argument(
        "--camera-of", type=Path, metavar="FILE", help="table image camera, where there are several cameras"
    )
    command.add_argument(
        "--order", default="opk", metavar="OPK", help="order of the rotations in the written shots (opk)"
    )
    _add_results(command)
    command.add_argument("--opk", type=Path, metavar="FILE", help="also write the shots as an OPK file")


def _add_cameras(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--cameras", nargs="+", type=Path, required=True, metavar="FILE", help="files of 'key = value' lines"
    )


def _add_site(command: argparse.ArgumentParser) -> None:
    shots = command.add_argument_group("shots")
    shots.add_argument("--shots", type=Path, required=True, metavar="FILE", help="positions and angles (OPK)")
    shots.add_argument("--shots-header", default="NXYZOPKC", metavar="LETTERS", help="its columns (NXYZOPKC)")
    shots.add_argument("--first", type=positive_integer, metavar="N", help="first line read, from 1")
    shots.add_argument("--last", type=positive_integer, metavar="N", help="first line not read any more")
    shots.add_argument("--order", default="opk", metavar="OPK", help="order of the rotations (opk)")
    shots.add_argument(
        "--unit", choices=("degree", "gon", "radian"), default="degree", help="of the angles (degree)"
    )
    shots.add_argument(
        "--no-alteration",
        action="store_true",
        help="z of the shots does not carry the linear alteration of the map (without this: it does)",
    )
    shots.add_argument(
        "--approximate", action="store_true", help="compute on a sphere, with the alteration kept in z"
    )
    _add_cameras(command)
    _add_map(command)


def _add_map(command: argparse.ArgumentParser) -> None:
    place = command.add_argument_group("map and heights")
    place.add_argument("--crs", metavar="CRS", required=True, help="projected system, such as EPSG:2154")
    place.add_argument("--geoid", nargs="+", metavar="GRID", help="geoid grids, where altitudes meet heights")
    place.add_argument("--dtm", type=Path, metavar="FILE", help="terrain model")
    place.add_argument(
        "--dtm-type", choices=("altitude", "height"), help="what its z is counted from (as the shots)"
    )
    place.add_argument(
        "--z-type", choices=("altitude", "height"), help="of the resulting z (as the shots or points)"
    )


def _add_measures(
    command: argparse.ArgumentParser, *, required: bool, what: str = "points measured in images"
) -> None:
    command.add_argument("--points", type=Path, required=required, metavar="FILE", help=what)
    command.add_argument("--points-header", default="PNXY", metavar="LETTERS", help="its columns (PNXY)")


def _add_ground(command: argparse.ArgumentParser) -> None:
    command.add_argument("--ground", type=Path, required=True, metavar="FILE", help="points on the ground")
    command.add_argument("--ground-header", default="PTXYZ", metavar="LETTERS", help="its columns (PTXYZ)")


def _add_results(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help="write the result as .csv or .geojson (without it: print CSV)",
    )


Job = Callable[[argparse.Namespace], "tuple[Table, dict[Path, str]]"]


def _run(job: Job) -> Callable[[argparse.Namespace], int]:
    """Do the job, write its table, say what was left out."""

    def run(arguments: argparse.Namespace) -> int:
        outputs = [path for path in (arguments.out, getattr(arguments, "opk", None)) if path]
        check_writable(outputs, _inputs(arguments))
        with Progress("computing"):
            table, texts = job(arguments)
            if arguments.out:
                texts[arguments.out] = _text(table, arguments)
            write_all(texts)
        if not arguments.out:
            print(printable(table.csv()), end="")
        _say_left_out(table.left_out)
        if table.verdict is None:
            return LEFT_OUT if table.left_out else 0
        print(printable(table.verdict.sentences()), file=sys.stderr)
        return LEFT_OUT if table.left_out or not table.verdict.is_good else 0

    return run


def _inputs(arguments: argparse.Namespace) -> list[Path]:
    named = (getattr(arguments, name, None) for name in ("shots", "points", "ground", "dtm"))
    return [path for path in (*named, *arguments.cameras, getattr(arguments, "camera_of", None)) if path]


def _text(table: "Table", arguments: argparse.Namespace) -> str:
    ending = arguments.out.suffix.lower()
    if ending == ".csv":
        return table.csv()
    if ending in (".geojson", ".json"):
        if "x" not in table.columns:
            raise InputError(f"{arguments.out}: these results are pixels, not places; write them as .csv")
        return table.geojson(_system(arguments))
    raise InputError(f"{arguments.out}: results are written as .csv or .geojson, not as {ending or 'this'}")


def _say_left_out(left_out: "Sequence[LeftOut]") -> None:
    for where, reason in left_out[:SHOWN]:
        print(printable_line(f"left out: {where}: {reason}"), file=sys.stderr)
    if len(left_out) > SHOWN:
        print(f"left out: {len(left_out) - SHOWN} more, {len(left_out)} in all", file=sys.stderr)


def _ground(arguments: argparse.Namespace) -> "tuple[Table, dict[Path, str]]":
    from obseq.images.aerial import ConstantHeight, read_image_points
    from obseq.images.aerial.jobs import ground_of_measures

    if (arguments.dtm is None) == (arguments.height is None):
        raise InputError("give the ground: a terrain model (--dtm), or a height (--height), one of them")
    flat = ConstantHeight(arguments.height or 0.0, _type(arguments.z_type))
    surface = _terrain(arguments) or flat
    measured = read_image_points(arguments.points, arguments.points_header, keep_good=True)
    site, bad = _site(arguments)
    return _with(ground_of_measures(site, measured, surface, _type(arguments.z_type)), bad), {}


def _images(arguments: argparse.Namespace) -> "tuple[Table, dict[Path, str]]":
    from obseq.images.aerial import read_ground_points, read_image_points
    from obseq.images.aerial.jobs import images_of_ground

    known = read_ground_points(arguments.ground, arguments.ground_header, keep_good=True)
    seen = None
    if arguments.points:
        seen = read_image_points(arguments.points, arguments.points_header, keep_good=True)
    site, bad = _site(arguments)
    say_outside(arguments.ground, _system(arguments).definition, known.coordinates, known.names)
    return _with(images_of_ground(site, known, seen), bad + known.left_out()), {}


def _intersections(arguments: argparse.Namespace) -> "tuple[Table, dict[Path, str]]":
    from obseq.images.aerial import read_image_points
    from obseq.images.aerial.jobs import intersections

    measured = read_image_points(arguments.points, arguments.points_header, keep_good=True)
    site, bad = _site(arguments)
    kind, all_rays = _type(arguments.z_type), arguments.method == "all"
    return _with(intersections(site, measured, kind, all_rays=all_rays, sigma=arguments.sigma), bad), {}


def _poses(arguments: argparse.Namespace) -> "tuple[Table, dict[Path, str]]":
    import numpy as np

    from obseq.images.aerial import HeightType, read_ground_points, read_image_points, shots_text
    from obseq.images.aerial.jobs import resections

    known = read_ground_points(arguments.ground, arguments.ground_header, keep_good=True)
    measured = read_image_points(arguments.points, arguments.points_header, keep_good=True)
    position = np.array(arguments.position) if arguments.position else None
    system = _system(arguments)
    say_outside(arguments.ground, system.definition, known.coordinates, known.names)
    shots, table = resections(
        _cameras(arguments).values(),
        measured,
        known,
        system,
        _geoid(arguments),
        position=position,
        camera_of=_camera_of(arguments, measured.shots),
        height_type=_type(arguments.z_type),
    )
    letter = "H" if shots.height_type is HeightType.HEIGHT else "Z"
    texts = {}
    if arguments.opk:
        texts[arguments.opk] = shots_text(shots, f"NXY{letter}OPKC", order=arguments.order)
    return _with(table, known.left_out()), texts


def _camera_of(arguments: argparse.Namespace, shots: Sequence[str]) -> Callable[[str], str] | None:
    """What tells the camera of a shot; None where nothing is said.

    Raises:
        InputError: a shot is in no row, or its camera is not among those that are given.
    """
    if arguments.camera_of is None:
        return None
    from obseq.reading.tables import Table

    table = Table.read(arguments.camera_of)
    table.allow(("image", "camera"))
    table.require("image", "camera")
    found = dict(zip(table.texts("image"), table.texts("camera"), strict=True))
    lost = next((shot for shot in shots if shot not in found), None)
    if lost is not None:
        raise InputError(f"{arguments.camera_of}: no row says which camera took {lost}")
    known = _cameras(arguments)
    other = next((row for row, name in enumerate(table.texts("camera")) if name not in known), None)
    if other is not None:
        raise InputError(f"{table.place(other)}: the camera is none of {', '.join(known)} (--cameras)")
    return found.__getitem__


def _with(table: "Table", before: "list[LeftOut]") -> "Table":
    from obseq.images.aerial.result_columns import Table

    return Table(table.columns, (*before, *table.left_out), table.verdict)


def _site(arguments: argparse.Namespace) -> "tuple[Worksite, list[LeftOut]]":
    from obseq.images.aerial import Worksite, read_shots
    from obseq.images.aerial.result_columns import LeftOut

    shots, bad = read_shots(
        arguments.shots,
        arguments.shots_header,
        interval=(arguments.first, arguments.last),
        unit=arguments.unit,
        order=arguments.order,
        has_alteration=not arguments.no_alteration,
        keep_good=True,
    )
    system = _system(arguments)
    say_outside(arguments.shots, system.definition, shots.positions, shots.names)
    site = Worksite(shots, _cameras(arguments), system, _geoid(arguments))
    terrain = _terrain(arguments)
    if terrain is not None and shots.has_alteration:
        site = site.with_nadir(terrain)
    left = [LeftOut(f"{arguments.shots}:{line.number}", line.reason) for line in bad]
    return site.approximately() if arguments.approximate else site, left


def _cameras(arguments: argparse.Namespace) -> "dict[str, FrameCamera]":
    from obseq.images.aerial import read_camera

    cameras: dict[str, FrameCamera] = {}
    for path in arguments.cameras:
        camera = read_camera(path)
        if camera.name in cameras:
            raise InputError(f"{path}: the camera {camera.name} was given before")
        cameras[camera.name] = camera
    return cameras


def _system(arguments: argparse.Namespace) -> "MapSystem":
    from obseq.images.aerial import MapSystem

    return MapSystem(arguments.crs)


def _geoid(arguments: argparse.Namespace) -> "Geoid | None":
    from obseq.images.aerial import Geoid

    return Geoid(arguments.geoid) if arguments.geoid else None


def _terrain(arguments: argparse.Namespace) -> "Surface | None":
    from obseq.images.aerial import read_terrain

    return read_terrain(arguments.dtm, _type(arguments.dtm_type)) if arguments.dtm else None


def _type(name: str | None) -> "HeightType | None":
    from obseq.images.aerial import HeightType

    return HeightType(name) if name else None
