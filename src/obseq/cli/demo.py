"""`obseq demo`: the packaged example, adjusted."""

import argparse
from importlib.resources import as_file, files
from pathlib import Path

from obseq.cli.networks.adjust import Request, adjust
from obseq.cli.networks.network_files import Source
from obseq.cli.parsing import Commands, add_command
from obseq.cli.results import add_detail, detail_of, outputs_in

FRAME = "RTL*657700*6860700*0*IGNF:LAMB93"
POINTS_CRS = "IGNF:LAMB93"

MORE = """
Four points in Lambert 93: PtA and PtD are known to 1 mm; a total station on each of them observed
PtB and PtC (directions, zenith angles, distances)."""


def register(commands: Commands) -> None:
    """Add the command to the parser."""
    command = add_command(
        commands, "demo", run, "adjust the packaged example network and write its results", MORE
    )
    command.add_argument(
        "--out",
        type=Path,
        default=Path("obseq-demo"),
        metavar="DIR",
        help="folder for the results (%(default)s)",
    )
    add_detail(command)


def run(arguments: argparse.Namespace) -> int:
    """Adjust the demo network."""
    data = files("obseq") / "survey" / "data"
    with as_file(data / "demo.obs") as observations, as_file(data / "demo.cor") as points:
        return adjust(
            Request(
                Source([observations], [points], {"frame": FRAME, "points_crs": POINTS_CRS}),
                {},
                outputs_in(arguments.out),
                detail=detail_of(arguments, "adjustment"),
            )
        )
