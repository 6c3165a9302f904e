"""What `obseq bundle` is told of the world: control points, check points, observed positions, in a system."""

from __future__ import annotations

import sys
from math import inf, radians
from pathlib import Path
from typing import TYPE_CHECKING

from obseq.cli.parsing import positive_number
from obseq.printable import printable_line

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

    from obseq.arrays import FloatArray
    from obseq.formats.blocks.observations import Carried
    from obseq.images.block import Block

MILLI = 1e-3
"""Seconds in the unit of readouts."""


def add_ground(command: argparse.ArgumentParser) -> None:
    """Add the options."""
    world = command.add_argument_group("the world")
    world.add_argument(
        "--check-points",
        nargs="+",
        type=Path,
        default=[],
        metavar="FILE",
        help="points that check the result, as a table of control points; they are no control points",
    )
    world.add_argument(
        "--control-crs",
        metavar="SYSCO",
        help="system of control and check points: EPSG:2154, EPSG:2154+5720 for heights above the geoid",
    )
    world.add_argument(
        "--positions-crs", metavar="SYSCO", help="system of --positions (that of --control-crs)"
    )
    world.add_argument(
        "--lever-arm",
        nargs=3,
        type=float,
        metavar=("X", "Y", "Z"),
        help="from the centre to the antenna of --positions, or of the files: right, down, forward",
    )
    world.add_argument(
        "--lever-arm-sigma", type=float, metavar="S", help="of it; 0 holds it (without: it is unknown)"
    )
    world.add_argument(
        "--angle-sigma", type=positive_number, metavar="DEG", help="of the angles that --positions has"
    )
    world.add_argument(
        "--readout", type=float, metavar="MS", help="the shutter rolls: a first value of its readout, or 0"
    )
    world.add_argument(
        "--readout-sigma", type=float, metavar="MS", help="of it; 0 holds it (without: it is unknown)"
    )


def put_ground(block: Block, arguments: argparse.Namespace) -> None:
    """Adds control points and check points, in the frame of the block.

    Raises:
        InputError: a table is wrong.
    """
    from obseq.formats.blocks.ground import (
        control_in_frame,
        frame_for,
        heights_said,
        put_check_points,
        put_control,
    )
    from obseq.formats.blocks.tables import control_table

    system = arguments.control_crs
    of_files = frozenset(block.control.names), frozenset(block.check_points.names)
    for paths, put, own in (
        (arguments.control, put_control, of_files[0]),
        (arguments.check_points, put_check_points, of_files[1]),
    ):
        for path in paths:
            control, table = control_table(path, arguments.control_sigma)
            if system:
                block.notes += say_outside(path, system, control.coordinates, control.names)
                block.system = system
                block.frame = frame_for(block, system, control.coordinates, arguments.frame)
                control = control_in_frame(control, system, block.frame)
            with table.located():
                put(block, control, table.origin, own)
    if system and (arguments.control or arguments.check_points):
        block.notes.append(f"control points in {heights_said(system)}; computed in {block.frame}")


def say_outside(path: Path, system: str, places: FloatArray, names: Sequence[str]) -> list[str]:
    """Warns of places (n, 3) outside the area where their system is used, and returns what was said."""
    from obseq.crs import area_warning, parse

    outside = area_warning(parse(system), places, names)
    if outside:
        print(printable_line(f"warning: {path}: {outside}"), file=sys.stderr)
    return [f"{path}: {outside}"] if outside else []


def carried_by(arguments: argparse.Namespace) -> Carried:
    """What the options say of how positions are carried."""
    from obseq.formats.blocks.observations import Carried

    sigma, readout, spread = arguments.lever_arm_sigma, arguments.readout, arguments.readout_sigma
    return Carried(
        None if arguments.lever_arm is None else tuple(arguments.lever_arm),
        inf if sigma is None else sigma,
        None if arguments.angle_sigma is None else radians(arguments.angle_sigma),
        None if readout is None else MILLI * readout,
        inf if spread is None else MILLI * spread,
        arguments.positions_crs or arguments.control_crs or "",
        arguments.frame,
    )
