"""Commands of MMVII on instrument blocks: readings of clinometers, cameras and clinometers on one body."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from obseq.cli.mmvii.tree_command import Files, add_tree_command, ending_of
from obseq.cli.parsing import Commands, positive_number
from obseq.errors import InputError

if TYPE_CHECKING:
    from obseq.images import Poses
    from obseq.project.instruments.blocks import InstrumentBlock
    from obseq.project.layout import ProjectTree

NAME = "TheBlock"
UNITS = {"rad": 1.0, "gon": 0.015707963267948967, "deg": 0.017453292519943295}


def register(commands: Commands) -> None:
    """Add the commands to the parser."""
    purpose = "import readings of clinometers from a text file (ImportMeasuresClino)"
    words = ("file", "format", "out")
    command = add_tree_command(commands, "import-clinometers", _import, purpose, words, is_new=True)
    command.add_argument("--unit", choices=UNITS, default="rad", help="of angles and sigmas (rad)")
    command.add_argument("--first-line", type=int, default=0, metavar="K", help="from 0")
    command.add_argument("--comment", default="#", metavar="TEXT", help="what begins a comment (#)")
    command.add_argument(
        "--digits", type=int, default=0, metavar="N", help="pads identifiers that are numbers"
    )

    purpose = "name the cameras and clinometers of a body (BlockInstrEdit)"
    command = add_tree_command(commands, "edit-instruments", _edit, purpose, ("block",), is_new=True)
    command.add_argument("--cameras", nargs="+", metavar="PATTERN", help="of images, exposures, images used")
    command.add_argument("--readings", metavar="NAME", help="folder of MeasureClino: its clinometers")
    command.add_argument(
        "--right-angle", nargs=3, action="append", default=[], metavar=("A", "B", "SIGMA"), help="radians"
    )
    command.add_argument("--from-scratch", action="store_true", help="forget the file that is there")
    command.add_argument("--name", default=NAME, help=f"of the block ({NAME})")
    command.add_argument("--out", metavar="NAME", help="folder that is written (the same)")

    purpose = "find the places of the cameras of a body from poses (BlockInstrInitCam)"
    known = ("images", "block", "orientation")
    command = add_tree_command(commands, "init-cameras", _cameras, purpose, (*known, "out"))
    command.add_argument("--name", default=NAME, help=f"of the block ({NAME})")

    purpose = "find the axes of the clinometers of a body from poses (BlockInstrInitClino)"
    command = add_tree_command(
        commands, "init-clinometers", _clinometers, purpose, (*known, "readings", "out")
    )
    command.add_argument("--name", default=NAME, help=f"of the block ({NAME})")

    purpose = "find clinometers on a camera from poses, without a block (ClinoInit)"
    known = ("readings", "clinometers", "orientation")
    command = add_tree_command(commands, "init-boresights", _boresights, purpose, (*known, "out"))
    command.add_argument("--type", choices=("Spring", "Pendulum"), default="Spring", help="of them (Spring)")
    command.add_argument(
        "--second", default="i-kj", metavar="AXES", help="of the second, in the frame of the first (i-kj)"
    )
    command.add_argument("--exposures", default=".*", metavar="PATTERN", help="that are used (all)")
    command.add_argument("--others", action="store_true", help="leave exposures without an image aside")


def _boresights(arguments: argparse.Namespace, tree: "ProjectTree") -> tuple[str, Files, bool]:
    from obseq.project.cameras import read_orientation
    from obseq.project.instruments.blocks import read_clinometer_readings
    from obseq.project.instruments.boresights import found_boresights

    poses, _ = read_orientation(tree.orientation(arguments.orientation))
    readings = read_clinometer_readings(tree.folder("MeasureClino", arguments.readings))
    readings = readings.chosen(arguments.exposures)
    chosen = _numbers(arguments.clinometers)
    found = found_boresights(readings, poses, chosen, arguments.type, arguments.second)
    if found.alone and not arguments.others:
        raise InputError(
            f"{readings.path}: exposure {found.alone[0]} has no image with a pose ({len(found.alone)} have "
            "none; --others, OkNoCam=1, leaves them aside)"
        )
    folder = tree.folder("Clino", arguments.out)
    files: Files = {
        folder / f"{one.file}{ending_of(arguments)}": one.text(as_json=arguments.json_files)
        for one in found.boresights
    }
    return "".join(f"{line}\n" for line in found.lines), files, True


def _numbers(text: str) -> list[int]:
    """Whole numbers, as MMVII writes lists of them: `[0,1]`."""
    words = text.strip("[] ").split(",")
    if not all(word.strip().isdigit() for word in words):
        raise InputError(f"{text!r}: numbers of one or two clinometers are wanted, as [0,1]")
    return [int(word) for word in words]


def _import(arguments: argparse.Namespace, tree: "ProjectTree") -> tuple[str, Files, bool]:
    from obseq.project.instruments.clinometer_files import FILE, read_lines, readings_text

    factor = UNITS[arguments.unit]
    found = read_lines(
        Path(arguments.file),
        arguments.format,
        factor=factor,
        first=arguments.first_line,
        comment=arguments.comment,
        digits=arguments.digits,
    )
    path = tree.folder("MeasureClino", arguments.out) / f"{FILE}{ending_of(arguments)}"
    text = readings_text(found, as_json=arguments.json_files)
    return f"{len(found.exposures)} exposures, clinometers {', '.join(found.names)}\n", {path: text}, True


def _edit(arguments: argparse.Namespace, tree: "ProjectTree") -> tuple[str, Files, bool]:
    from obseq.project.instruments.blocks import read_clinometer_readings
    from obseq.project.instruments.making import (
        empty_block,
        with_cameras,
        with_clinometers,
        with_right_angles,
    )
    from obseq.project.tree import data_text, read_tree

    given = _file(arguments, tree, arguments.block)
    data = read_tree(given) if given.is_file() and not arguments.from_scratch else empty_block()
    if arguments.cameras:
        images, stamp, used = [*arguments.cameras, *arguments.cameras[-1:] * 2][:3]
        rules, known = tree.rules(arguments.metadata), tree.calibrations()
        names = [rules.calibration_names(image) for image in tree.images(images)]
        data = with_cameras(data, [old if old in known else new for new, old in names], stamp, used)
    if arguments.readings:
        data = with_clinometers(
            data, read_clinometer_readings(tree.folder("MeasureClino", arguments.readings))
        )
    angles = [(a, b, _sigma(sigma)) for a, b, sigma in arguments.right_angle]
    data = with_right_angles(data, angles)
    path = _file(arguments, tree, arguments.out or arguments.block)
    return f"{path}\n", {path: data_text(data, as_json=arguments.json_files)}, True


def _sigma(text: str) -> float:
    try:
        return positive_number(text)
    except argparse.ArgumentTypeError as error:
        raise InputError(f"--right-angle: {error}") from None


def _cameras(arguments: argparse.Namespace, tree: "ProjectTree") -> tuple[str, Files, bool]:
    from obseq.project.instruments.making import placed_cameras
    from obseq.project.tree import data_text

    block, poses, camera_of = _known(arguments, tree)
    data, lines = placed_cameras(block, poses, camera_of)
    path = _file(arguments, tree, arguments.out)
    text = data_text(data, as_json=arguments.json_files)
    return "".join(f"{line}\n" for line in lines), {path: text}, True


def _clinometers(arguments: argparse.Namespace, tree: "ProjectTree") -> tuple[str, Files, bool]:
    from obseq.project.instruments.blocks import read_clinometer_readings
    from obseq.project.instruments.making import found_axes
    from obseq.project.tree import data_text

    block, poses, camera_of = _known(arguments, tree)
    readings = read_clinometer_readings(tree.folder("MeasureClino", arguments.readings))
    data, lines = found_axes(block, poses, camera_of, readings)
    path = _file(arguments, tree, arguments.out)
    text = data_text(data, as_json=arguments.json_files)
    return "".join(f"{line}\n" for line in lines), {path: text}, True


def _known(
    arguments: argparse.Namespace, tree: "ProjectTree"
) -> "tuple[InstrumentBlock, Poses, dict[str, str]]":
    """The block, and the poses of the images that are asked for."""
    from obseq.project.cameras import read_orientation
    from obseq.project.instruments.blocks import read_instrument_block
    from obseq.project.metadata import chosen

    poses, _ = read_orientation(tree.orientation(arguments.orientation))
    images = tree.listed(arguments.images) or chosen(poses.images, arguments.images)
    poses = poses.select(images)
    block = read_instrument_block(_file(arguments, tree, arguments.block))
    return block, poses, dict(zip(poses.images, poses.cameras, strict=True))


def _file(arguments: argparse.Namespace, tree: "ProjectTree", folder: str) -> Path:
    from obseq.project.instruments.blocks import FILE

    return tree.folder("InstrBlock", folder) / f"{FILE}{arguments.name}{ending_of(arguments)}"
