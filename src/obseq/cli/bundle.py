"""`obseq bundle`: a block of images from tables, or from the files of other programs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from obseq.cli.parsing import Commands, add_command, positive_integer, positive_number
from obseq.cli.progress import Progress, described
from obseq.cli.results import INCOMPLETE
from obseq.errors import InputError
from obseq.writing import check_writable, write_all

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Mapping

    from obseq.images import BundleAdjustment, BundleSolution, Weighting

MORE = """
A block is given by tables with a line of column names (cameras, images with or without poses,
control points, image measures), or by one file of another program. Images without a pose are
placed by resection, or from their neighbours. With --obs and --cor, survey observations join the
same adjustment."""

EXAMPLE = """\
example:
  obseq bundle --cameras cameras.csv --images images.csv --control control.csv \\
      --measures measures.csv --image-sigma 0.5 --out results
  obseq bundle --bal problem.txt --datum centres --ply block.ply

columns (commas or blanks, any order; # begins a comment):
  cameras   name width height focal [ppx ppy K1 K2 K3 p1 p2 b1 b2 ...]       pixels
  images    image camera [x y z omega phi kappa]   degrees; or w p k, yaw pitch roll, qw qx qy qz
  control   point x y z [sigma, or sx sy sz]       0: held; empty: free
  measures  image point x y [sigma, or sx sy]      pixels

exit code: 0 adjusted; 1 not converged, or something was left out; 2 could not run"""

FILES = {
    "json": ("bundle.json", "every result at full precision"),
    "ply": ("block.ply", "points and cameras for a viewer"),
    "poses": ("poses.csv", "adjusted images, in the form of --images"),
    "interior": ("cameras.csv", "adjusted cameras, in the form of --cameras"),
    "points": ("points.csv", "adjusted points with their sigmas"),
    "text": ("bundle.txt", "what is printed"),
}


def register(commands: Commands) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "bundle", run, "adjust a block of images", MORE, EXAMPLE)
    _add_files(command)
    _add_computation(command)
    results = command.add_argument_group("results")
    names = ", ".join(name for name, _ in FILES.values())
    results.add_argument("--out", type=Path, metavar="DIR", help=f"folder for {names}")
    for option, (_, purpose) in FILES.items():
        results.add_argument(f"--{option}", type=Path, metavar="FILE", help=purpose)


def _add_files(command: argparse.ArgumentParser) -> None:
    files = command.add_argument_group("files")
    files.add_argument("--cameras", type=Path, metavar="FILE", help="table of cameras")
    files.add_argument("--images", type=Path, metavar="FILE", help="table of images, with poses or without")
    files.add_argument("--measures", nargs="+", type=Path, metavar="FILE", help="tables of image measures")
    files.add_argument(
        "--control", nargs="+", type=Path, default=[], metavar="FILE", help="tables of control points"
    )
    files.add_argument("--bal", type=Path, metavar="FILE", help="a problem of Bundle Adjustment in the Large")
    files.add_argument("--bundler", type=Path, metavar="FILE", help="a bundle.out of Bundler")
    files.add_argument("--colmap", type=Path, metavar="DIR", help="a sparse model of COLMAP, as text")
    files.add_argument("--obs", nargs="+", type=Path, metavar="FILE", help="survey observations (OBS)")
    files.add_argument("--cor", nargs="+", type=Path, metavar="FILE", help="points of the survey (COR)")
    files.add_argument("--frame", metavar="SYSCO", help="frame of the survey, and of the block")


def _add_computation(command: argparse.ArgumentParser) -> None:
    computation = command.add_argument_group("computation")
    computation.add_argument(
        "--image-sigma", type=positive_number, metavar="PX", help="sigma of measures whose table gives none"
    )
    computation.add_argument(
        "--control-sigma",
        type=positive_number,
        metavar="S",
        help="sigma of control points whose table gives none",
    )
    computation.add_argument(
        "--attenuation",
        type=positive_number,
        metavar="PX",
        help="robust weights: a measure with this residual has half of its weight (needs --image-sigma)",
    )
    computation.add_argument(
        "--threshold", type=positive_number, metavar="PX", help="measures beyond have no weight"
    )
    computation.add_argument(
        "--freeze",
        metavar="PATTERN",
        help="camera parameters that keep their values: 'K3|p.', or '.*' for all",
    )
    computation.add_argument(
        "--datum",
        choices=("control", "centres", "points"),
        default="control",
        help="what fixes position, orientation and scale (without control points: centres or points)",
    )
    computation.add_argument("--iterations", type=positive_integer, metavar="N", help="stop at this number")
    computation.add_argument(
        "--threads", type=positive_integer, default=1, metavar="N", help="how many share the work"
    )


def run(arguments: argparse.Namespace) -> int:
    """Adjust what the command line names."""
    outputs = _outputs(arguments)
    check_writable(outputs.values(), _inputs(arguments))
    with Progress("loading") as progress:
        from obseq.images.output.record import record_of
        from obseq.images.output.summary import summary

        block = _block(arguments, progress)
        solution = _solved(block, arguments, progress)
        progress("writing")
        record = record_of(solution)
        shown = summary(record, [str(path) for path in outputs.values()])
        texts = {"json": record.to_json, "text": lambda: shown, **_writers(solution)}
        write_all({path: texts[option]() for option, path in outputs.items()})
    print(shown, end="")
    return 0 if record.is_complete else INCOMPLETE


def _outputs(arguments: argparse.Namespace) -> dict[str, Path]:
    """Option -> file, for those that are asked for."""
    places = {
        option: getattr(arguments, option) or (arguments.out / name if arguments.out else None)
        for option, (name, _) in FILES.items()
    }
    return {option: path for option, path in places.items() if path}


def _inputs(arguments: argparse.Namespace) -> list[Path]:
    single = (arguments.cameras, arguments.images, arguments.bal, arguments.bundler)
    several = (arguments.measures, arguments.control, arguments.obs, arguments.cor)
    return [path for path in single if path] + [path for paths in several for path in paths or ()]


def _writers(solution: BundleSolution) -> Mapping[str, Callable[[], str]]:
    from obseq.images.output.clouds import camera_table, ply, point_table, pose_table

    return {
        "ply": lambda: ply(solution),
        "poses": lambda: pose_table(solution),
        "interior": lambda: camera_table(solution),
        "points": lambda: point_table(solution),
    }


def _block(arguments: argparse.Namespace, progress: Progress) -> BundleAdjustment:
    """The block that the options name: from tables, or from one file of another program."""
    progress("reading")
    others = {name: getattr(arguments, name) for name in ("bal", "bundler", "colmap")}
    given = {name: path for name, path in others.items() if path}
    tables = any((arguments.cameras, arguments.images, arguments.measures))
    if len(given) + tables != 1:
        raise InputError(
            "say where the block is: --cameras, --images and --measures, or one of --bal, --bundler, --colmap"
        )
    block = _read_other(*next(iter(given.items()))) if given else _read_tables(arguments)
    if given and arguments.control:
        from obseq.images.files.block_tables import read_control

        for path in arguments.control:
            block.add_control_points(read_control(path, arguments.control_sigma))
    _add_survey(block, arguments)
    if arguments.freeze:
        block.freeze_parameters(arguments.freeze)
    return block


def _read_other(kind: str, path: Path) -> BundleAdjustment:
    from obseq.images.files.bal import read_bal, read_bundler
    from obseq.images.files.colmap import read_colmap

    return {"bal": read_bal, "bundler": read_bundler, "colmap": read_colmap}[kind](path)


def _read_tables(arguments: argparse.Namespace) -> BundleAdjustment:
    from obseq.images import BundleAdjustment
    from obseq.images.files.block_tables import BlockFiles

    missing = [name for name in ("cameras", "images", "measures") if not getattr(arguments, name)]
    if missing:
        raise InputError(f"--{missing[0]} is missing: a block in tables takes cameras, images and measures")
    files = BlockFiles(
        arguments.cameras,
        arguments.images,
        arguments.measures,
        arguments.control,
        arguments.image_sigma,
        arguments.control_sigma,
    )
    block = BundleAdjustment()
    files.fill(block, _weighting(arguments))
    return block


def _weighting(arguments: argparse.Namespace) -> Weighting | None:
    from obseq.images import Weighting

    if arguments.attenuation is None and arguments.threshold is None:
        return None
    if arguments.image_sigma is None:
        raise InputError("--attenuation and --threshold go with --image-sigma: robust weights take one sigma")
    return Weighting(arguments.image_sigma, arguments.attenuation, arguments.threshold)


def _add_survey(block: BundleAdjustment, arguments: argparse.Namespace) -> None:
    if bool(arguments.obs) != bool(arguments.cor):
        raise InputError("--obs and --cor go together: survey observations and the points they start from")
    if arguments.obs:
        from obseq.survey import Network

        block.add_survey(Network.read(arguments.obs, arguments.cor, frame=arguments.frame))


def _solved(block: BundleAdjustment, arguments: argparse.Namespace, progress: Progress) -> BundleSolution:
    progress("first values")
    options: dict[str, Any] = {"datum": arguments.datum, "threads": arguments.threads}
    if arguments.iterations:
        options["max_iterations"] = arguments.iterations
    block.initialise()
    return block.solve(progress=lambda step: progress(described(step)), **options)
