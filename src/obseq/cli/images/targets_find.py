"""`obseq targets find`, `simulate`, `complete`: targets in images."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from obseq.cli.parsing import Commands, add_command, output_file, positive_integer, positive_number, say
from obseq.cli.progress import Progress
from obseq.errors import InputError
from obseq.printable import printable
from obseq.writing import check_writable, write_all

if TYPE_CHECKING:
    from collections.abc import Mapping

    from obseq.images import Camera
    from obseq.targets import Found, Truth

INCOMPLETE = 1
"""Exit code: an image could not be read, or has no target."""

FIND = """
Writes the place of each target with its covariance, from the least squares of its drawing against the
image: the true centre, which is not that of the ellipse. Nothing is named that its drawing does not
confirm. Pixel centres are at whole numbers, x right, y down. Images are read as stored, without their
EXIF orientation, by Pillow: pip install 'obseq[images]'."""

FIND_EXAMPLE = """\
example:
  obseq targets find photos/*.jpg --spec sheets/CERN_*_FullSpecif.xml --csv measures.csv

exit code: 0 done; 1 done, and an image has no target or could not be read: it is named; 2 could not run"""

SIMULATE = """
Images of sheets that lie at random before a camera with perspective, distortion, blur, noise and a ramp
of light, and truth.csv with the places of their centres. With --measure the targets are looked for too,
and a table says how many were found and how well."""

COMPLETE = """
Spots without code (names NONE_...) get the names of the points that should be seen where they are. A
spot and a point must each be the nearest to the other."""


def register(commands: Commands) -> None:
    """Add the commands to the parser."""
    _register_find(commands)
    _register_simulate(commands)
    _register_complete(commands)


def _register_find(commands: Commands) -> None:
    command = add_command(commands, "find", find, "find and measure targets in images", FIND, FIND_EXAMPLE)
    command.add_argument("images", nargs="+", type=Path, metavar="IMAGE", help="images")
    _add_specs(command)
    command.add_argument(
        "--csv", type=output_file, metavar="FILE", help="table of the measures, - to print it"
    )
    command.add_argument(
        "--block", type=output_file, metavar="FILE", help="table of measures for `obseq bundle --measures`"
    )
    command.add_argument("--why", type=output_file, metavar="FILE", help="table of what was seen and refused")
    command.add_argument(
        "--mmvii", type=Path, metavar="DIR", help="write MesIm-IMAGE.xml there, with the variances"
    )
    command.add_argument("--overlay", type=Path, metavar="DIR", help="write images with their targets there")
    command.add_argument("--page", type=Path, metavar="FILE", help="page of all targets, cut out (HTML)")
    command.add_argument(
        "--focal",
        type=positive_number,
        metavar="PX",
        help="focal length, pixels: it says how much perspective there may be (the image's longer side)",
    )
    command.add_argument(
        "--uncoded", action="store_true", help="measure spots without code too, as NONE_000000 and so on"
    )
    command.add_argument(
        "--ellipse",
        action="store_true",
        help="write centres of ellipses, as other programs do",
    )


def _add_specs(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--spec", nargs="+", type=Path, required=True, metavar="FILE", help="specifications of the sets"
    )


def find(arguments: argparse.Namespace) -> int:
    """Look for targets and write what is asked for."""
    from obseq.targets import Finder, cells_of, overlay, read_picture, read_specifications
    from obseq.targets.pictures import png_bytes

    specs = read_specifications(arguments.spec)
    names = [path.name for path in arguments.images]
    if double := next((name for name in names if names.count(name) > 1), ""):
        raise InputError(f"{double}: two images have this name; measures are told apart by names of images")
    outputs = _outputs(arguments, names)
    check_writable(outputs, [*arguments.images, *arguments.spec])
    finder = Finder(specs, focal=arguments.focal, uncoded=arguments.uncoded)
    half_widths = {spec.family: spec.geometry.radii[3] for spec in specs}
    found: dict[str, Found] = {}
    cells: list[tuple[float, str]] = []
    unread: list[str] = []
    with Progress("looking for targets") as progress:
        for number, path in enumerate(arguments.images, 1):
            progress(f"looking for targets: image {number} of {len(names)}")
            try:
                picture = read_picture(path)
            except InputError as error:
                unread.append(str(error))
                continue
            one = found[picture.name] = finder.find(picture.grey)
            if arguments.overlay:
                drawn = png_bytes(overlay(picture.grey, one))
                write_all({arguments.overlay / f"{picture.name}.png": drawn})
            if arguments.page:
                cells += cells_of(picture.grey, picture.name, one, half_widths)
    if not found:
        raise InputError(unread[0] if len(unread) == 1 else f"no image can be read; the first: {unread[0]}")
    write_all(_texts(arguments, found, cells))
    return _said(arguments, found, unread, outputs)


def _outputs(arguments: argparse.Namespace, names: list[str]) -> list[Path]:
    single = [path for path in (arguments.csv, arguments.block, arguments.why, arguments.page) if path]
    each = [arguments.mmvii / f"MesIm-{name}.xml" for name in names] if arguments.mmvii else []
    each += [arguments.overlay / f"{name}.png" for name in names] if arguments.overlay else []
    return single + each


def _texts(
    arguments: argparse.Namespace, found: "Mapping[str, Found]", cells: list[tuple[float, str]]
) -> dict[Path, str | bytes]:
    from obseq.targets import (
        block_text,
        measures_of,
        mmvii_text,
        page_text,
        refusals_text,
        table_text,
    )

    texts: dict[Path, str | bytes] = {}
    if arguments.csv:
        texts[arguments.csv] = table_text(found, of_ellipse=arguments.ellipse)
    if arguments.block:
        texts[arguments.block] = block_text(measures_of(found, of_ellipse=arguments.ellipse))
    if arguments.why:
        texts[arguments.why] = refusals_text(found)
    if arguments.mmvii:
        for name, one in found.items():
            measures = measures_of({name: one}, of_ellipse=arguments.ellipse)
            texts[arguments.mmvii / f"MesIm-{name}.xml"] = mmvii_text(name, measures)
    if arguments.page:
        texts[arguments.page] = page_text(cells)
    return texts


def _said(
    arguments: argparse.Namespace, found: "Mapping[str, Found]", unread: list[str], outputs: list[Path]
) -> int:
    """Say what was found; the exit code."""
    lines = []
    for name, one in found.items():
        plain = f", {len(one.uncoded)} without code" if arguments.uncoded else ""
        corrected = sum(bool(target.corrected) for target in one.targets)
        mended = f"; in {corrected} a bit was corrected" if corrected else ""
        lines.append(f"{name}: {len(one.targets)} targets{plain}{mended}")
    empty = [name for name, one in found.items() if not one.targets]
    lines += [f"not read: {message}" for message in unread]
    if not outputs:
        lines.append(
            "Nothing is written: --csv, --block, --mmvii, --page, --why and --overlay write what was found"
        )
    say(printable("\n".join(lines) + "\n"), outputs)
    return INCOMPLETE if unread or empty else 0


def _register_simulate(commands: Commands) -> None:
    command = add_command(commands, "simulate", simulate, "make images of targets, with the truth", SIMULATE)
    _add_specs(command)
    command.add_argument("--images", type=positive_integer, default=1, metavar="N", help="how many (1)")
    command.add_argument(
        "--size", type=positive_integer, nargs=2, default=(1600, 1200), metavar=("W", "H"), help="of an image"
    )
    command.add_argument("--focal", type=positive_number, default=1500.0, metavar="PX", help="pixels (1500)")
    command.add_argument("--distortion", type=float, default=0.0, metavar="K1", help="radial distortion (0)")
    command.add_argument("--targets", type=positive_integer, default=20, metavar="N", help="per image (20)")
    command.add_argument(
        "--sizes",
        type=positive_number,
        nargs=2,
        default=(30.0, 120.0),
        metavar="PX",
        help="of targets (30 120)",
    )
    command.add_argument("--tilt", type=float, default=45.0, metavar="DEG", help="largest (45)")
    command.add_argument("--blur", type=float, default=0.9, metavar="PX", help="sigma of the spread (0.9)")
    command.add_argument("--noise", type=float, default=3.0, metavar="GREY", help="of a pixel (3)")
    command.add_argument(
        "--contrast", type=positive_number, nargs=2, default=(100.0, 180.0), metavar="GREY", help="(100 180)"
    )
    command.add_argument("--hidden", type=float, default=0.0, metavar="SHARE", help="targets half hidden (0)")
    command.add_argument("--deep", action="store_true", help="images of 16 bits")
    command.add_argument("--seed", type=int, default=0, metavar="N", help="of all that is by chance (0)")
    command.add_argument("--measure", action="store_true", help="look for the targets, and print statistics")
    command.add_argument("--out", type=Path, metavar="DIR", help="folder of the images and truth.csv")


def simulate(arguments: argparse.Namespace) -> int:
    """Make images; measure them where that is asked for."""
    from obseq.targets import Conditions, Finder, Scene, photograph, random_sheets, read_specifications
    from obseq.targets.pictures import png_bytes
    from obseq.targets.statistics import Trial, statistics_text

    if not (arguments.out or arguments.measure):
        raise InputError("targets simulate: give --out DIR, --measure or both")
    camera = _camera(arguments)
    specs = read_specifications(arguments.spec)
    names = [f"image_{number:03d}.png" for number in range(1, arguments.images + 1)]
    outputs = [arguments.out / name for name in (*names, "truth.csv")] if arguments.out else []
    check_writable(outputs, arguments.spec)
    scene = Scene(
        arguments.targets,
        tuple(arguments.sizes),
        (0.0, arguments.tilt),
        tuple(arguments.contrast),
        arguments.hidden,
    )
    seen = Conditions(arguments.blur, arguments.noise, deep=arguments.deep)
    files: dict[Path, str | bytes] = {}
    truths: dict[str, list[Truth]] = {}
    trials: list[Trial] = []
    finder = Finder(specs, focal=arguments.focal)
    with Progress("making images"):
        for number, name in enumerate(names):
            seed = arguments.seed + number
            sheets = random_sheets(camera, specs, replace(scene, seed=seed))
            image, truths[name] = photograph(camera, sheets, replace(seen, seed=seed))
            if arguments.out:
                files[arguments.out / name] = png_bytes(image)
            if arguments.measure:
                trials.append(Trial(truths[name], finder.find(image)))
    if arguments.out:
        files[arguments.out / "truth.csv"] = _truth_text(truths)
        write_all(files)
    placed, asked = sum(map(len, truths.values())), arguments.targets * arguments.images
    print(
        f"{placed} targets in {len(names)} images" + ("" if placed == asked else f" ({asked} were asked for)")
    )
    if trials:
        print(statistics_text(trials), end="")
    return 0 if placed == asked else INCOMPLETE


def _camera(arguments: argparse.Namespace) -> "Camera":
    import numpy as np

    from obseq.images import Camera

    width, height = arguments.size
    middle = np.array([(width - 1) / 2, (height - 1) / 2])
    distortion = {"K1": arguments.distortion} if arguments.distortion else {}
    return Camera("simulated", width, height, arguments.focal, middle, distortion=distortion)


def _truth_text(truths: "Mapping[str, list[Truth]]") -> str:
    import math

    rows = ["image,point,x,y,family,size_px,tilt_deg,hidden\n"]
    for image, seen in truths.items():
        for one in sorted(seen, key=lambda one: one.name):
            x, y = one.centre.tolist()
            rows.append(
                f"{image},{one.name},{x:.4f},{y:.4f},{one.family},{one.size:.1f},"
                f"{math.degrees(one.tilt):.1f},{one.hidden:.2f}\n"
            )
    return "".join(rows)


def _register_complete(commands: Commands) -> None:
    purpose = "give spots without code the names of points that are seen there"
    command = add_command(commands, "complete", complete, purpose, COMPLETE)
    command.add_argument("measures", type=Path, metavar="CSV", help="table of `obseq targets find --uncoded`")
    command.add_argument(
        "--orientation",
        type=Path,
        required=True,
        metavar="DIR",
        help="poses and cameras (MMVII's Ori)",
    )
    command.add_argument(
        "--points", type=Path, required=True, metavar="DIR", help="folder of MesGCP files with the points"
    )
    command.add_argument(
        "--within", type=positive_number, default=2.0, metavar="PX", help="largest distance (2 pixels)"
    )
    command.add_argument("--csv", type=output_file, required=True, metavar="FILE", help="the completed table")


def complete(arguments: argparse.Namespace) -> int:
    """Name spots, and write the table again."""
    from obseq.project import read_control_points, read_orientation
    from obseq.targets import completed, read_table
    from obseq.targets.measures import measures_text

    check_writable([arguments.csv], [arguments.measures])
    measures = read_table(arguments.measures)
    images = list(dict.fromkeys(one.image for one in measures))
    points = read_control_points(arguments.points)
    poses, cameras = read_orientation(arguments.orientation, images)
    found = []
    for number, image in enumerate(images):
        mine = [one for one in measures if one.image == image]
        camera = cameras[poses.cameras[number]]
        found += completed(mine, camera, poses[image], points, arguments.within)
    write_all({arguments.csv: measures_text(found)})
    count = sum(one.point != other.point for one, other in zip(found, measures, strict=True))
    say(f"{count} spots have names now: {arguments.csv}\n", [arguments.csv])
    return 0
