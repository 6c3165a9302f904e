"""`obseq report`: the reports of a stored result, made again."""

import argparse
from pathlib import Path

from obseq.cli.parsing import Commands, add_command, say
from obseq.cli.results import (
    INCOMPLETE,
    Outputs,
    add_result_arguments,
    detail_of,
    in_units,
    outputs_of,
    show,
    write,
)
from obseq.errors import InputError
from obseq.records.adjustment import AdjustmentRecord
from obseq.report.result_file import read_plain
from obseq.writing import check_writable, write_all

BLOCK, STEM = "obseq-bundle", "bundle"
"""Format of the results of blocks of images, and the name of their files in a folder."""

MORE = """
Nothing is computed: what the reports say is what the file holds, of a network or of a block of images.
Prints the summary; --out writes all reports in a folder."""

EXAMPLE = """\
example:
  obseq report results/adjustment.json --html again.html

  obseq report results/bundle.json --html again.html

exit code: 0 done; 1 the adjustment had not converged, or points were left out; 2 could not run"""


def register(commands: Commands) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "report", run, "make the reports of a stored result again", MORE, EXAMPLE)
    command.add_argument("result", type=Path, metavar="RESULT.json", help="what `--json` or `--out` wrote")
    add_result_arguments(command)


def run(arguments: argparse.Namespace) -> int:
    """Read the result, write the reports, print the summary."""
    plain = read_plain(arguments.result)
    is_block = isinstance(plain, dict) and plain.get("format") == BLOCK
    outputs = outputs_of(arguments, STEM if is_block else None)
    check_writable([path for path, _ in outputs], [arguments.result])
    return _block(plain, arguments, outputs) if is_block else _network(plain, arguments, outputs)


def _network(plain: object, arguments: argparse.Namespace, outputs: Outputs) -> int:
    record = in_units(AdjustmentRecord.from_dict(plain, str(arguments.result)), arguments)
    check_writable([path for path, _ in outputs], map(Path, record.files or ()))
    record = write(record, outputs)
    show(record, outputs, detail=detail_of(arguments))
    return 0 if record.is_complete else INCOMPLETE


def _block(plain: object, arguments: argparse.Namespace, outputs: Outputs) -> int:
    """The same of a block of images."""
    from obseq.images.output.block_record import block_record_of
    from obseq.images.output.page import page
    from obseq.images.output.summary import summary

    if arguments.units:
        raise InputError("--units: reports of blocks of images are in the unit of their world, and in pixels")
    record = block_record_of(plain, str(arguments.result))
    paths = [path for path, _ in outputs]
    texts = {"text": summary(record, list(map(str, paths))), "json": record.to_json(), "html": page(record)}
    write_all({path: texts[form.name] for path, form in outputs})
    say(texts["text"], paths)
    return 0 if record.is_complete else INCOMPLETE
