"""Commands of MMVII on targets in a project: `extract-targets`, `complete-targets`, `refine-circles`."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from obseq.cli.mmvii.tree_command import Files, add_tree_command
from obseq.cli.parsing import Commands, positive_number
from obseq.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from obseq.arrays import Array
    from obseq.project.layout import ProjectTree
    from obseq.targets import Found, Measure, Truth
    from obseq.targets.pictures import Picture
    from obseq.targets.specification import Specification

PICTURES = "VISU"
SIMULATED = "SimulTarget_"
KNOWN = 1e-8
"""Variance of places that are known, pixels squared: of the numbers in files."""


def register(commands: Commands) -> None:
    """Add the commands to the parser."""
    purpose = "find and measure coded targets (CodedTargetExtract, CodedTargetCircExtract)"
    command = add_tree_command(commands, "extract-targets", _extract, purpose, ("images",), is_new=True)
    command.add_argument("specs", nargs="+", type=Path, metavar="SPEC", help="specifications of the sets")
    command.add_argument("--out", default="Std", metavar="NAME", help="folder of the measures (Std)")
    command.add_argument("--uncoded", action="store_true", help="spots without code too, as NONE_000000...")
    command.add_argument("--attributes", action="store_true", help="write ellipses and grey levels too")
    command.add_argument("--ellipse", action="store_true", help="write centres of ellipses, not of circles")
    command.add_argument("--only", default=".*", metavar="PATTERN", help="names that are kept (all)")
    command.add_argument("--overlay", action="store_true", help=f"draw what was found ({PICTURES})")

    purpose = "put targets into images, where their places are known (CodedTargetSimul)"
    command = add_tree_command(commands, "simulate-targets", _simulate, purpose, ("images",), is_new=True)
    command.add_argument("spec", type=Path, metavar="SPEC", help="specification of the set")
    command.add_argument("--out", default="Simul", metavar="NAME", help="folder of the measures (Simul)")
    command.add_argument("--names", default=".*", metavar="PATTERN", help="of the targets (all)")
    command.add_argument("--prefix", default="", metavar="TEXT", help="after SimulTarget_ in names of images")
    for name, default, about in (
        ("radius", (15.0, 60.0), "half side of a sheet, pixels"),
        ("ratio", (0.3, 1.0), "short side over long side"),
        ("noise", (0.0, 0.1), "amplitude over 128 grey levels, the second"),
        ("ramp", (0.0, 0.2), "change of the light across the image, the second"),
        ("grey", (0.0, 0.2), "loss of contrast between black and white"),
        ("dark", (0.0, 0.4), "loss of light"),
    ):
        told = f"{about} ({default[0]:g} {default[1]:g})"
        command.add_argument(f"--{name}", type=float, nargs=2, default=default, metavar="X", help=told)

    purpose = "give spots without code the names of points that are seen there (CodedTargetCompleteUncoded)"
    words = ("images", "orientation", "points", "measures", "out")
    command = add_tree_command(commands, "complete-targets", _complete, purpose, words)
    command.add_argument("--within", type=positive_number, default=2.0, metavar="PX", help="(2 pixels)")

    purpose = "from centres of ellipses to those of horizontal circles (CodedTargetRefineCirc)"
    words = ("images", "measures", "points", "orientation", "out")
    command = add_tree_command(commands, "refine-circles", _refine, purpose, words)
    command.add_argument("--radius", type=positive_number, metavar="R", help="of the circles (their median)")


def _extract(arguments: argparse.Namespace, tree: "ProjectTree") -> tuple[str, Files, bool]:
    from obseq.targets import Finder, overlay, read_picture, read_specifications
    from obseq.targets.pictures import png_bytes

    finder = Finder(read_specifications(arguments.specs), uncoded=arguments.uncoded)
    files: Files = {}
    lines: list[str] = []
    passed = True
    for name in tree.images(arguments.images):
        try:
            grey = read_picture(tree.root / name).grey
        except InputError as error:
            lines.append(f"not read: {error}\n")
            passed = False
            continue
        found = _only(finder.find(grey), arguments.only)
        plain = f", {len(found.uncoded)} without code" if arguments.uncoded else ""
        lines.append(f"{name}: {len(found.targets)} targets{plain}\n")
        passed = passed and bool(found.targets)
        files |= _measure_files(arguments, tree, name, found)
        if arguments.overlay:
            files[tree.folder(PICTURES, f"{name}.png")] = png_bytes(overlay(grey, found))
    if not files:
        raise InputError(lines[0].strip())
    return "".join(lines), files, passed


def _simulate(arguments: argparse.Namespace, tree: "ProjectTree") -> tuple[str, Files, bool]:
    import numpy as np

    from obseq.cli.images.targets import chosen_names
    from obseq.project.layout import MEASURES
    from obseq.targets import read_picture
    from obseq.targets.measures import Measure, mmvii_text, truth_text
    from obseq.targets.pictures import png_bytes
    from obseq.targets.specification_files import read_specification

    spec = read_specification(arguments.spec)
    names = chosen_names(spec, arguments.names)
    folder, lines, passed = tree.folder(MEASURES, arguments.out), [], True
    files: Files = {}
    for name in tree.images(arguments.images):
        if name.startswith(SIMULATED):
            continue
        image, truths = _with_targets(arguments, read_picture(tree.root / name), spec, names)
        made = f"{SIMULATED}{arguments.prefix}{Path(name).stem}"
        measures = [Measure(f"{made}.tif", one.name, one.centre, KNOWN * np.eye(2)) for one in truths]
        files[tree.root / f"{made}.tif"] = png_bytes(image, "TIFF")
        files[folder / f"MesIm-{made}.tif.xml"] = mmvii_text(f"{made}.tif", measures)
        files[folder / f"{made}_GroundTruth.xml"] = truth_text(truths, spec, arguments.radius)
        lines.append(f"{made}.tif: {len(truths)} targets\n")
        if lost := sorted(set(names) - {one.name for one in truths}):
            lines.append(f"no room for {len(lost)}: {' '.join(lost[:10])}{' ...' * (len(lost) > 10)}\n")
            passed = False
    if not files:
        raise InputError(f"{arguments.images}: there are only images that were made ({SIMULATED}...)")
    return "".join(lines), files, passed


def _with_targets(
    arguments: argparse.Namespace, picture: "Picture", spec: "Specification", names: list[str]
) -> "tuple[Array, list[Truth]]":
    """A picture with targets in it, by chance, that of its name; and where they are."""
    import math
    import zlib

    import numpy as np

    from obseq.images import Camera
    from obseq.targets import Conditions, Scene, photograph, random_sheets
    from obseq.targets.specification import extent

    height, width = picture.grey.shape
    seed = zlib.crc32(picture.name.encode())
    short, long = sorted(arguments.ratio)
    if not 0.0 < short <= long <= 1.0:
        raise InputError(f"--ratio {short:g} {long:g}: sides have ratios above 0, to 1")
    low, high = (2.0 * r * extent(spec) / (2.0 * spec.geometry.radii[3]) for r in sorted(arguments.radius))
    light = [(1.0 - a) * (1.0 - b) for a, b in zip(arguments.grey, arguments.dark, strict=True)]
    contrast = 255.0 * min(light), 255.0 * max(light)
    if not (low > 0.0 and contrast[0] > 0.0 and contrast[1] <= 255.0):
        raise InputError("--radius is above 0, --grey and --dark are from 0 to below 1")
    tilts = math.degrees(math.acos(long)), math.degrees(math.acos(short))
    middle = np.array([(width - 1) / 2, (height - 1) / 2])
    camera = Camera("simulated", width, height, float(max(width, height)), middle)
    sheets = random_sheets(camera, [spec], Scene(len(names), (low, high), tilts, contrast, seed=seed), names)
    deep = picture.grey.dtype.itemsize > 1
    seen = Conditions(
        noise=128.0 * arguments.noise[1] / math.sqrt(3.0), ramp=arguments.ramp[1], deep=deep, seed=seed
    )
    return photograph(camera, sheets, seen, scenery=picture.grey / (257.0 if deep else 1.0))


def _measure_files(
    arguments: argparse.Namespace, tree: "ProjectTree", name: str, found: "Found"
) -> "dict[Path, str]":
    from obseq.project.layout import MEASURES
    from obseq.targets.measures import attributes_text, measures_of, mmvii_text

    folder = tree.folder(MEASURES, arguments.out)
    measures = measures_of({name: found}, of_ellipse=arguments.ellipse)
    files = {folder / f"MesIm-{name}.xml": mmvii_text(name, measures)}
    if arguments.attributes:
        files[folder / f"Attribute-MesIm-{name}.xml"] = attributes_text(found)
    return files


def _only(found: "Found", pattern: str) -> "Found":
    from dataclasses import replace

    from obseq.project.metadata import chosen

    names = set(chosen([target.name for target in found.targets], pattern))
    return replace(found, targets=[target for target in found.targets if target.name in names])


def _each_image(
    arguments: argparse.Namespace,
    tree: "ProjectTree",
    better: "Callable[..., Sequence[Measure]]",
) -> tuple[int, Files]:
    """Measures of images with poses, made better; how many changed, and the files.

    Args:
        arguments: of the command.
        tree: the project.
        better: the new measures of an image, from its name, measures, camera and pose, and the points.
    """
    from obseq.project import read_control_points, read_orientation
    from obseq.project.layout import MEASURES
    from obseq.reading.text import read_bytes
    from obseq.targets.measures import mmvii_text, read_mmvii

    folder, out = tree.measures(arguments.measures), tree.folder(MEASURES, arguments.out)
    images = tree.images(arguments.images, folder)
    points = read_control_points(tree.points(arguments.points))
    poses, cameras = read_orientation(tree.orientation(arguments.orientation), images)
    files: Files = {}
    count = 0
    for number, image in enumerate(images):
        given = read_mmvii(folder / f"MesIm-{image}.xml")
        found = better(image, given, cameras[poses.cameras[number]], poses[image], points)
        changed = [(one, other) for one, other in zip(given, found, strict=True) if one is not other]
        count += len(changed)
        files[out / f"MesIm-{image}.xml"] = mmvii_text(image, found)
        attributes = folder / f"Attribute-MesIm-{image}.xml"
        if attributes.is_file():
            text = read_bytes(attributes).decode("utf-8")
            for one, other in changed:
                text = text.replace(f'"{one.point}"', f'"{other.point}"')
            files[out / attributes.name] = text
    return count, files


def _complete(arguments: argparse.Namespace, tree: "ProjectTree") -> tuple[str, Files, bool]:
    from obseq.targets import completed

    count, files = _each_image(
        arguments, tree, lambda _, given, *seen: completed(given, seen[0], seen[1], seen[2], arguments.within)
    )
    return f"{count} spots have names now\n", files, True


def _refine(arguments: argparse.Namespace, tree: "ProjectTree") -> tuple[str, Files, bool]:
    from statistics import median

    from obseq.targets.circles import radii_of, refined
    from obseq.targets.measures import read_ellipses

    folder = tree.measures(arguments.measures)
    ellipses = {
        image: read_ellipses(folder / f"Attribute-MesIm-{image}.xml")
        for image in tree.images(arguments.images, folder)
    }
    radius = arguments.radius
    if radius is None:
        radii: list[float] = []

        def measured(image: str, given: "Sequence[Measure]", *seen: Any) -> "Sequence[Measure]":
            radii.extend(radii_of(given, ellipses[image], *seen))
            return given

        _each_image(arguments, tree, measured)
        if not radii:
            raise InputError(f"{folder}: there is no ellipse of a point with coordinates; give --radius")
        radius = median(radii)
    count, files = _each_image(
        arguments,
        tree,
        lambda image, given, *seen: refined(given, ellipses[image], seen[0], seen[1], seen[2], radius),
    )
    return f"{count} centres corrected for circles of radius {radius:.6g}\n", files, True
