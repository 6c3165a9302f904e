"""`obseq report`: the reports of a stored result, made again."""

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeVar

from msgspec import structs

from obseq.cli.parsing import Commands, add_command
from obseq.cli.results import (
    INCOMPLETE,
    Outputs,
    add_result_arguments,
    detail_of,
    forget,
    in_units,
    outputs_of,
    show,
    show_adjustment,
    suiting,
    tell_not_written,
    write,
)
from obseq.errors import InputError
from obseq.records.adjustment import AdjustmentRecord
from obseq.records.comparison import ComparisonRecord
from obseq.records.plan import PlanRecord
from obseq.records.record import from_plain
from obseq.records.shown_units import chosen_units
from obseq.report.result_file import read_plain
from obseq.writing import Content, check_writable, write_all

STEMS = {"obseq-bundle": "bundle", "obseq-plan": "plan", "obseq-comparison": "comparison"}
"""Names of files in a folder, by the format of the result; of adjustments that of all others."""

SMALL = ("obseq-plan", "obseq-comparison")
"""Formats of results that are never columns."""

Kind = TypeVar("Kind", PlanRecord, ComparisonRecord)

MORE = """
Nothing is computed: what the reports say is what the file holds, of a network, a plan, a comparison or a
block of images.
Prints the summary; --out writes all reports in a folder."""

EXAMPLE = """\
example:
  obseq report results/adjustment.json --html again.html

  obseq report results/bundle.json --html again.html
  obseq report results/comparison.json --units ft --html again.html

exit code: 0 done; 1 as the command that wrote the result; 2 could not run"""


def register(commands: Commands) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "report", run, "make the reports of a stored result again", MORE, EXAMPLE)
    command.add_argument(
        "result", type=Path, metavar="RESULT", help="a .json or .npz that `--out`, `--json` or `--npz` wrote"
    )
    add_result_arguments(command)


def run(arguments: argparse.Namespace) -> int:
    """Read the result, write the reports, print the summary."""
    plain = read_plain(arguments.result)
    kind = str(plain.get("format")) if isinstance(plain, dict) else ""
    outputs = outputs_of(arguments, STEMS.get(kind))
    check_writable([path for path, _ in outputs], [arguments.result])
    ways = {"obseq-bundle": _block, "obseq-plan": _plan, "obseq-comparison": _comparison}
    if kind in SMALL:
        outputs = suiting(0, outputs)
    return ways.get(kind, _network)(plain, arguments, outputs)


def _network(plain: object, arguments: argparse.Namespace, outputs: Outputs) -> int:
    record = in_units(AdjustmentRecord.from_dict(plain, str(arguments.result)), arguments)
    check_writable([path for path, _ in outputs], map(Path, record.files or ()))
    record = write(record, outputs)
    show_adjustment(record, outputs, detail_of(arguments, ""))
    return 0 if record.is_complete else INCOMPLETE


def _block(plain: object, arguments: argparse.Namespace, outputs: Outputs) -> int:
    from obseq.images.output.block_record import block_record_of
    from obseq.images.output.page import contents, outcome

    if arguments.units:
        raise InputError("--units: reports of blocks of images are in the unit of their world, and in pixels")
    record = block_record_of(plain, str(arguments.result))
    found = outcome(record)
    size = len(record.measures)
    _write(contents(record), suiting(size, outputs))
    forget(size, outputs)
    show(found, _paths(suiting(size, outputs)), detail_of(arguments, ""))
    tell_not_written(size, outputs)
    return 0 if record.is_complete else INCOMPLETE


def _plan(plain: object, arguments: argparse.Namespace, outputs: Outputs) -> int:
    from obseq.cli.networks.plan import exit_code, texts_of
    from obseq.report.planned import outcome

    record = _read(PlanRecord, plain, arguments)
    record = structs.replace(record, adjustment=in_units(record.adjustment, arguments))
    _write(texts_of(record), outputs)
    show(outcome(record), _paths(outputs), detail_of(arguments, ""))
    return exit_code(record)


def _comparison(plain: object, arguments: argparse.Namespace, outputs: Outputs) -> int:
    from obseq.cli.networks.compare import exit_code, texts_of
    from obseq.report.compared import outcome

    record = _read(ComparisonRecord, plain, arguments)
    record = structs.replace(record, units=chosen_units(arguments.units, record.units))
    _write(texts_of(record), outputs)
    found = outcome(record)
    show(found, _paths(outputs), detail_of(arguments, ""))
    return exit_code(found)


def _read(kind: type[Kind], plain: object, arguments: argparse.Namespace) -> Kind:
    version = structs.fields(kind)[-1].default
    if isinstance(plain, dict) and plain.get("version") != version:
        raise InputError(
            f"{arguments.result}: it has another version than {version}; make it again with this obseq"
        )
    return from_plain(kind, plain, str(arguments.result))


def _paths(outputs: Outputs) -> list[Path]:
    return [path for path, _ in outputs]


def _write(texts: Mapping[str, Callable[[], Content]], outputs: Outputs) -> None:
    """Write the reports by the names of their formats.

    Raises:
        InputError: a format is asked for that this result is not written in.
    """
    if lacking := [form.name for _, form in outputs if form.name not in texts]:
        raise InputError(f"--{lacking[0]}: only networks and blocks are written as columns")
    write_all({path: texts[form.name]() for path, form in outputs})
