"""The options of adjustments in blocks: with little memory, or by many workers."""

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from obseq.cli.parsing import positive_integer
from obseq.errors import InputError
from obseq.printable import printable

if TYPE_CHECKING:
    from obseq.leastsquares import Blocks


def add_blocks_arguments(command: argparse.ArgumentParser) -> None:
    """Add what says how an adjustment goes in blocks."""
    blocks = command.add_argument_group("networks and blocks of any size")
    blocks.add_argument(
        "--memory",
        metavar="SIZE",
        help="solve in parts, so that each process needs no more than this (8GB) for it",
    )
    workers = blocks.add_mutually_exclusive_group()
    workers.add_argument(
        "--workers", type=positive_integer, metavar="N", help="by so many processes of this machine (Dask)"
    )
    workers.add_argument(
        "--scheduler", metavar="URL", help="by the workers of a Dask scheduler: tcp://host:8786"
    )
    blocks.add_argument(
        "--work", type=Path, metavar="DIR", help="folder of the parts, which all workers read and write"
    )
    blocks.add_argument(
        "--resume", action="store_true", help="take up what a run that was stopped left in --work"
    )


def blocks_of(arguments: argparse.Namespace) -> "Blocks | None":
    """How the adjustment goes in blocks; None for at once."""
    client = arguments.workers or arguments.scheduler
    if arguments.memory is None and client is None:
        for option in ("work", "resume"):
            if getattr(arguments, option):
                raise InputError(f"--{option} goes with --memory, --workers or --scheduler")
        return None
    from obseq.leastsquares import Blocks

    return Blocks(arguments.memory, client, arguments.work, arguments.resume, tell=cache(_tell))


def _tell(text: str) -> None:
    """Once: trials of the diagnosis are solved in the same way."""
    print(printable(text), file=sys.stderr)


@contextmanager
def ended(blocks: "Blocks | None") -> Iterator[None]:
    """Removes files and workers at its end, and says what this process took of the memory asked for."""
    if blocks is None:
        yield
        return
    with blocks:
        yield
        if blocks.memory is not None:
            _tell_most(blocks.memory)


def _tell_most(wanted: str | int) -> None:
    from obseq.leastsquares.blocks.memory import bytes_of, most_in_use, told

    if most := most_in_use():
        more = ", more than was asked for, which parts of the factorisation keep to; see docs/scaling.md"
        _tell(f"memory: {told(most)} at most{more if most > bytes_of(wanted) else ''}")
