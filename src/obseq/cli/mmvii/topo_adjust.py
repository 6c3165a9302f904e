"""`obseq topo-adjust`: MMVII's `TopoAdj`, the survey network of a project tree."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from obseq.cli.mmvii.tree_command import Files
from obseq.cli.parsing import Commands, add_command, say
from obseq.cli.progress import Progress
from obseq.cli.results import (
    INCOMPLETE,
    add_result_arguments,
    detail_of,
    outputs_of,
    show_adjustment,
    shown_in,
    write,
)
from obseq.errors import InputError
from obseq.writing import check_writable

if TYPE_CHECKING:
    from obseq.project.layout import ProjectTree
    from obseq.project.options.bundle_options import BundleOptions
    from obseq.survey import Adjustment

MORE = """
Options are MMVII's, Name=value:
  GCP3D=[[Folder,SG,Out?],...] 3D points, the factor of their sigmas, where they go when adjusted
  NbIter=N the most iterations; GCPFilter=Pat GCPFilterAdd=Pat choose points
  TopoRefr=k the refraction coefficient of zenith angles
The points must be in a local frame (`obseq change-sysco` converts them)."""

EXAMPLE = """\
example:
  obseq topo-adjust Field Adjusted 'GCP3D=[[Known,1,New]]' --json result.json

exit code: 0 adjusted; 1 not converged, something left out, or gross errors suspected; 2 could not run"""


def register(commands: Commands) -> None:
    """Add the command to the parser."""
    purpose = "adjust the survey network of a project tree (MMVII's TopoAdj)"
    command = add_command(commands, "topo-adjust", run, purpose, MORE, EXAMPLE)
    command.add_argument("topo", metavar="TOPO", help="folder of survey observations (Topo)")
    command.add_argument("topo_out", metavar="OUT", help="folder of survey observations that is written")
    command.add_argument("options", nargs="+", metavar="NAME=VALUE", help="MMVII's options")
    command.add_argument(
        "--project", type=Path, default=Path(), metavar="DIR", help="that holds MMVII-PhgrProj (here)"
    )
    command.add_argument("--json-files", action="store_true", help="write JSON instead of XML in the project")
    add_result_arguments(command)


def run(arguments: argparse.Namespace) -> int:
    """Adjust what the command line names."""
    from obseq.project.layout import ProjectTree
    from obseq.project.options.bundle_options import TOPO, parse_options

    options, tree = parse_options(arguments.options, TOPO), ProjectTree.at(arguments.project)
    outputs, detail = outputs_of(arguments), detail_of(arguments, "adjustment")
    check_writable([path for path, _ in outputs])
    with Progress("reading") as progress:
        from obseq.project.networks import control_of, network_of, survey_points
        from obseq.project.topo import read_topo, said_of_those_without_place
        from obseq.survey.network import MAX_ITERATIONS

        if not options.points:
            raise InputError("GCP3D=[[Folder,SG],...] is missing: it says where the points are")
        control, definition = control_of(tree, options)
        observed = read_topo(tree.topo(arguments.topo))
        made = network_of(survey_points(control), observed, definition, options.refraction)
        network = shown_in(made, arguments.units)
        adjustment = network.adjust(options.iterations or MAX_ITERATIONS, progress=progress)
        record = adjustment.record()
        files = _files(arguments, tree, options, adjustment, definition)
        check_writable(files)
        record = write(record, outputs, files)
    count = sum(observation.active for observation in record.observations)
    sigmas = [*(step.sigma0 for step in record.iterations), record.sigma0]
    lines = [f"Topo sigma0: {'undefined' if s is None else f'{s:g}'} ({count} obs)" for s in sigmas]
    if lost := said_of_those_without_place(adjustment.book):
        lines.append(lost)
    say("".join(f"{line}\n" for line in lines), [path for path, _ in outputs])
    show_adjustment(record, outputs, detail, files)
    return 0 if record.is_complete else INCOMPLETE


def _files(
    arguments: argparse.Namespace,
    tree: "ProjectTree",
    options: "BundleOptions",
    adjustment: "Adjustment",
    definition: str,
) -> Files:
    from obseq.project.networks import adjusted_control, adjusted_sets
    from obseq.project.topo import OUTPUT, AdjustedTopo, topo_text

    as_json = arguments.json_files
    stations = adjustment.stations
    found = AdjustedTopo(adjustment.book, adjustment.residuals, stations.orientations, stations.g0)
    out = tree.folder("Topo", arguments.topo_out)
    files: Files = {out / f"{OUTPUT}{'.json' if as_json else '.xml'}": topo_text(found, as_json=as_json)}
    return files | adjusted_sets(tree, options, adjusted_control(adjustment), definition, as_json=as_json)
