"""What commands on a project tree share: their arguments, and that they compute first and write together."""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from obseq.cli.parsing import Commands, add_command
from obseq.cli.progress import Progress
from obseq.printable import printable
from obseq.writing import check_writable, write_all

if TYPE_CHECKING:
    from obseq.project.layout import ProjectTree

CHECK_FAILED = 1
EXIT = "exit code: 0 done; 1 done, and an image or a point failed the check; 2 could not run"
IMAGES = "a regular expression of image names, or a list (SetOfName file)"

Files = dict[Path, "str | bytes"]
Job = Callable[[argparse.Namespace, "ProjectTree"], tuple[str, Files, bool]]
"""What a command does: the text that is printed, the files that are written, whether all passed."""

WORDS = {
    "images": IMAGES,
    "measures": "folder of measures in images (ObjMesInstr, PointsMeasure)",
    "any_measures": "folder of measures in images; * for any, and for images in the folder of the project",
    "points": "folder of 3D points (ObjCoordWorld, PointsMeasure)",
    "calibrations": "folder of orientations with the calibrations",
    "orientation": "folder of orientations (Ori)",
    "pattern": "of image names, with a group for the camera and one for the exposure",
    "system": "the new coordinate system",
    "out": "folder that is written",
    "file": "what is imported",
    "format": "fields of a line: N X Y Z, and A, Sx Sy Sz, Sxyz, ? or S (skip), Bla (the rest)",
    "folder": "folder of metadata (MetaData)",
    "block": "folder of instrument blocks (InstrBlock)",
    "readings": "folder of readings of clinometers (MeasureClino)",
    "clinometers": "numbers of one or two clinometers of the readings, from 0: [0,1]",
    "mode": "what the rules give: Focalmm, FocalPix, PPPix, Aperture, ModelCam, NbPixel, AdditionalName",
}


def add_tree_command(
    commands: Commands, name: str, job: Job, purpose: str, positional: Sequence[str], *, is_new: bool = False
) -> argparse.ArgumentParser:
    """Add a command on a project tree, with the positional arguments of `WORDS`.

    Args:
        commands: where it is added.
        name: what the user types.
        job: what it does.
        purpose: its line in the list of commands.
        positional: names of its arguments.
        is_new: whether it makes the tree where there is none.
    """
    command = add_command(commands, name, _run(job, is_new), purpose, "", EXIT)
    for one in positional:
        command.add_argument(one, metavar=one.upper(), help=WORDS[one])
    command.add_argument(
        "--project", type=Path, default=Path(), metavar="DIR", help="that holds MMVII-PhgrProj (here)"
    )
    command.add_argument("--metadata", default="Std", metavar="NAME", help="folder of metadata (Std)")
    command.add_argument("--json-files", action="store_true", help="write JSON instead of XML")
    return command


def ending_of(arguments: argparse.Namespace) -> str:
    """Of the files that are written."""
    return ".json" if arguments.json_files else ".xml"


def _run(job: Job, is_new: bool) -> Callable[[argparse.Namespace], int]:
    def run(arguments: argparse.Namespace) -> int:
        from obseq.project.layout import ProjectTree

        with Progress("computing"):
            text, files, passed = job(arguments, ProjectTree.at(arguments.project, is_new=is_new))
            check_writable(files)
            write_all(files)
        print(printable(text), end="")
        return 0 if passed else CHECK_FAILED

    return run
