"""Commands of MMVII that bring things into a project tree: `edit-metadata`, `import-gcp`, `import-obs`."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from obseq.cli.mmvii.tree_command import Files, add_tree_command, ending_of
from obseq.cli.parsing import Commands, finite_number, positive_integer
from obseq.errors import InputError

if TYPE_CHECKING:
    from obseq.images import ControlPoints
    from obseq.project.layout import ProjectTree
    from obseq.project.tree import Tree
    from obseq.survey import PointFileOptions, Points


def register(commands: Commands) -> None:
    """Add the commands to the parser."""
    purpose = "show, try or change the rules that give metadata from image names (EditCalcMTDI)"
    command = add_tree_command(
        commands, "edit-metadata", _edit_metadata, purpose, ("folder", "mode"), is_new=True
    )
    command.add_argument(
        "--modify",
        nargs=3,
        metavar=("PATTERN", "VALUE", "RANK"),
        help="a rule, and its rank: 0 or more replaces the one there or comes last; -1 goes first; -2 is "
        "the only one",
    )
    command.add_argument("--test", metavar="IMAGE", help="tell which value an image gets")
    command.add_argument("--save", action="store_true", help="write the file, and keep the old one")

    purpose = "import 3D points from a text file (ImportGCP)"
    command = add_tree_command(
        commands, "import-gcp", _import_points, purpose, ("file", "format", "out"), is_new=True
    )
    _add_point_options(command)

    purpose = "check a file of survey observations and copy it into the project (ImportOBS)"
    add_tree_command(commands, "import-obs", _import_observations, purpose, ("file", "out"), is_new=True)


def _add_point_options(command: argparse.ArgumentParser) -> None:
    command.add_argument("--name", help="of the set (name of the file)")
    command.add_argument(
        "--systems",
        nargs="+",
        default=["LocalNONE"],
        metavar="SYSCO",
        help="of the points; or of the file, then of the points (RTL: a new local frame at their mean)",
    )
    command.add_argument("--multiplier", type=finite_number, default=1.0, metavar="M", help="of coordinates")
    command.add_argument(
        "--sigma", type=finite_number, metavar="S", help="of all (1 where the format has none); below 0: free"
    )
    command.add_argument("--free", metavar="PATTERN", help="points whose field A matches are free")
    command.add_argument("--name-digits", type=positive_integer, metavar="N", help="pads whole numbers")
    command.add_argument("--name-pattern", nargs=2, metavar=("PATTERN", "BY"), help="renames points")
    command.add_argument("--first-line", type=int, default=0, metavar="K", help="from 0")
    command.add_argument("--last-line", type=int, metavar="K", help="the first that is not read")
    command.add_argument("--comment", default="#", metavar="C", help="what begins a comment (#)")
    command.add_argument("--separator", default="", metavar="C", help="of fields, beside blanks and commas")
    command.add_argument("--skip-repeated", action="store_true", help="leave out repeated lines")


def _edit_metadata(arguments: argparse.Namespace, tree: "ProjectTree") -> tuple[str, Files, bool]:
    from obseq.project.metadata import edited, rules_text

    path, rules = tree.metadata(arguments.folder)
    if arguments.modify:
        pattern, value, rank = arguments.modify
        rules = edited(rules, arguments.mode, pattern, value, _rank(rank))
    lines = [f"{pattern}  ->  {value}" for pattern, value in rules.rules(arguments.mode)]
    if arguments.test:
        found = rules.value(arguments.mode, arguments.test)
        lines.append(f"{arguments.test}: {'no rule' if found is None else found}")
    files: Files = {}
    if arguments.save:
        if path.is_file():
            files[_backup(path)] = path.read_bytes()
        files[path] = rules_text(rules, as_json=path.suffix == ".json")
    return "".join(f"{line}\n" for line in lines), files, True


def _rank(word: str) -> int:
    if not word.lstrip("-").isdecimal() or int(word) < -2:
        raise InputError(f"--modify: the rank is -2, -1, 0 or more, not {word!r}")
    return int(word)


def _backup(path: Path) -> Path:
    """A name that is free: BckUp_00001_CalcMTD.xml."""
    number = 1
    while (place := path.with_name(f"BckUp_{number:05d}_{path.name}")).exists():
        number += 1
    return place


def _import_points(arguments: argparse.Namespace, tree: "ProjectTree") -> tuple[str, Files, bool]:
    from obseq.project.points import points_text, system_text
    from obseq.survey import read_points

    if len(arguments.systems) > 2:
        raise InputError("--systems takes one system, or two: of the file, and of the points")
    points = read_points(arguments.file, arguments.format, _options(arguments))
    control, definition, saved = _converted(arguments, tree, points)
    name = arguments.name or Path(arguments.file).stem
    said: dict[str, Tree] = {
        name: {"AdditionalInfo": words} for name, words in zip(points.names, points.infos, strict=True)
    }
    out, ending = tree.folder("ObjCoordWorld", arguments.out), ending_of(arguments)
    as_json = arguments.json_files
    files: Files = {
        out / f"MesGCP-{name}{ending}": points_text(control, name, said, as_json=as_json),
        out / f"CurSysCo{ending}": system_text(definition, as_json=as_json),
    }
    if saved:
        files[tree.folder("SysCo", f"RTL{ending}")] = system_text(definition, as_json=as_json)
    free = int(control.is_free.all(axis=1).sum())
    return f"{len(control)} points, {free} of them free, in {definition}\n", files, True


def _options(arguments: argparse.Namespace) -> "PointFileOptions":
    from obseq.survey import PointFileOptions

    pattern = arguments.name_pattern
    return PointFileOptions(
        sigma=arguments.sigma,
        multiplier=arguments.multiplier,
        name_digits=arguments.name_digits,
        name_pattern=(pattern[0], pattern[1]) if pattern else None,
        free_pattern=arguments.free,
        first_line=arguments.first_line,
        last_line=arguments.last_line,
        comment=arguments.comment,
        separator=arguments.separator,
        skip_repeated=arguments.skip_repeated,
    )


def _converted(
    arguments: argparse.Namespace, tree: "ProjectTree", points: "Points"
) -> "tuple[ControlPoints, str, bool]":
    """The points in the last system, its definition, and whether it is a new one; sigmas are in it."""
    import numpy as np

    from obseq import crs
    from obseq.images import ControlPoints

    given, wanted = (tree.system(word) for word in (arguments.systems[0], arguments.systems[-1]))
    sigmas = np.where(np.isnan(points.sigmas), np.inf, points.sigmas)
    if given == wanted:
        return ControlPoints.of(points.names, points.coordinates, sigmas), wanted, False
    source = crs.parse(given)
    target = crs.complete_rtl(points.coordinates, source) if wanted == "RTL" else crs.parse(wanted)
    places = crs.Transformer(source, target).forward(points.coordinates, points.names)
    return ControlPoints.of(points.names, places, sigmas), target.definition, wanted == "RTL"


def _import_observations(arguments: argparse.Namespace, tree: "ProjectTree") -> tuple[str, Files, bool]:
    from obseq.reading.text import read_bytes
    from obseq.survey import read_obs

    path = Path(arguments.file)
    if path.suffix.lower() != ".obs":
        raise InputError(f"{path}: survey observations are in files that end in .obs")
    book = read_obs(path)
    text = f"{len(book.observations)} observations of {len(book.point_names)} points, "
    text += f"{len(book.stations)} stations\n"
    return text, {tree.folder("Topo", arguments.out) / path.name: read_bytes(path)}, True
