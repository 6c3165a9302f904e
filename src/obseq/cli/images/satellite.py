"""`obseq satellite`: a block of satellite images with rational polynomials."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from obseq.cli.parsing import Commands, add_command, positive_integer, positive_number, say
from obseq.cli.progress import Progress
from obseq.cli.results import INCOMPLETE
from obseq.errors import InputError
from obseq.writing import check_writable, write_all

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable

    from obseq.images.satellite.block import SatelliteSolution

MORE = """
The rational polynomials of each image are corrected by a shift (bias), or by a shift and drifts
(affine), which tie points and control points determine. Points come out with their covariances."""

EXAMPLE = """\
example:
  obseq satellite --rpc A_RPC.TXT B.RPB C_RPC.XML --measures m.csv --image-sigma 0.5 \\
      --control gcp.csv --check-points check.csv --control-crs EPSG:32721 --out results

columns: measures image point x y [sigma] (sample and line, (0, 0) is the centre of the first pixel);
control point x y z [sigma, or sx sy sz] (metres)

exit code: 0 adjusted; 1 not converged, or something left out; 2 could not run"""

FORMS = ("txt", "rpb", "xml")
AFFINE = "affine"


def register(commands: Commands) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "satellite", run, "adjust a block of satellite images", MORE, EXAMPLE)
    files = command.add_argument_group("the block")
    files.add_argument("--rpc", nargs="+", type=Path, required=True, metavar="FILE", help="of each image")
    files.add_argument("--measures", nargs="+", type=Path, required=True, metavar="FILE", help="of points")
    files.add_argument("--control", nargs="+", type=Path, default=[], metavar="FILE", help="known points")
    files.add_argument("--check-points", nargs="+", type=Path, default=[], metavar="FILE", help="to compare")
    files.add_argument(
        "--control-crs", default="Geog", metavar="SYSCO", help="of these (Geog: lon, lat, height)"
    )
    files.add_argument("--image-sigma", type=positive_number, metavar="PX", help="of measures without one")
    files.add_argument("--control-sigma", type=positive_number, metavar="M", help="of points without one")
    how = command.add_argument_group("computation")
    how.add_argument("--correction", choices=("bias", AFFINE), default="bias", help="of each image (bias)")
    how.add_argument("--bias-sigma", type=positive_number, default=10.0, metavar="PX", help="of shifts (10)")
    how.add_argument(
        "--drift-sigma",
        type=positive_number,
        default=1.0,
        metavar="PX",
        help="of drifts, over half of the image (1)",
    )
    how.add_argument("--iterations", type=positive_integer, default=30, metavar="N", help="at most")
    results = command.add_argument_group("results")
    results.add_argument("--out", type=Path, metavar="DIR", help="points.csv, corrections.csv, satellite.txt")
    results.add_argument("--rpc-out", type=Path, metavar="DIR", help="corrected coefficients of each image")
    results.add_argument("--rpc-form", choices=FORMS, default=FORMS[0], help="of these (txt)")


def run(arguments: argparse.Namespace) -> int:
    """Adjust what the command line names."""
    with Progress("loading") as progress:
        from obseq import crs
        from obseq.formats.blocks.ground import heights_said
        from obseq.formats.rpc.reader import SatelliteFiles
        from obseq.images.satellite.output import summary

        progress("reading")
        system = crs.parse(arguments.control_crs).definition
        files = SatelliteFiles(
            arguments.rpc, arguments.measures, arguments.control, arguments.check_points, system,
            arguments.image_sigma, arguments.control_sigma,
        )  # fmt: skip
        block = files.block(arguments.correction, arguments.bias_sigma, arguments.drift_sigma)
        places = _places(arguments, block.measures.image_names)
        inputs = [*arguments.rpc, *arguments.measures, *arguments.control, *arguments.check_points]
        check_writable(list(places), inputs)
        progress("adjusting")
        solution = block.solve(arguments.iterations)
        shown = summary(solution)
        if arguments.control or arguments.check_points:
            shown += f"note: {heights_said(arguments.control_crs)}\n"
        write_all({path: make(solution, shown) for path, make in places.items()})
    say(shown + "".join(f"written: {path}\n" for path in places), places)
    return 0 if solution.result.converged and not solution.left_out else INCOMPLETE


def _places(
    arguments: argparse.Namespace, images: tuple[str, ...]
) -> dict[Path, Callable[[SatelliteSolution, str], str]]:
    """Files that are asked for, and what makes each."""
    from obseq.images.satellite.output import correction_table, point_table

    found: dict[Path, Callable[[SatelliteSolution, str], str]] = {}
    if arguments.out:
        found[arguments.out / "points.csv"] = lambda solution, _: point_table(solution)
        found[arguments.out / "corrections.csv"] = lambda solution, _: correction_table(solution)
        found[arguments.out / "satellite.txt"] = lambda _, shown: shown
    if arguments.rpc_out:
        for image in images:
            end = "_RPC.TXT" if arguments.rpc_form == FORMS[0] else f".{arguments.rpc_form}"
            if "/" in image or "\\" in image:
                raise InputError(f"image {image!r}: --rpc-out makes a file of its name")
            path = arguments.rpc_out / f"{image}{end}"
            found[path] = partial(_corrected, image=image, path=path)
    return found


def _corrected(solution: SatelliteSolution, shown: str, image: str, path: Path) -> str:
    from obseq.formats.rpc.files import rpc_text
    from obseq.images.satellite.output import corrected_rpc

    return rpc_text(corrected_rpc(solution, image), path)
