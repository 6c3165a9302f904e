"""`obseq report`: the reports of a stored result, made again."""

import argparse
from pathlib import Path

from obseq.cli.parsing import Commands, add_command
from obseq.cli.results import INCOMPLETE, add_result_arguments, outputs_of, show, write
from obseq.report.result_file import read_json
from obseq.writing import check_writable

MORE = """
Nothing is computed: what the reports say is what the file holds. Prints the summary; --out writes all
reports in a folder."""

EXAMPLE = """\
example:
  obseq report results/adjustment.json --html again.html

exit code: 0 done; 1 the adjustment had not converged, or points were left out; 2 could not run"""


def register(commands: Commands) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "report", run, "make the reports of a stored result again", MORE, EXAMPLE)
    command.add_argument("result", type=Path, metavar="RESULT.json", help="what `--json` or `--out` wrote")
    add_result_arguments(command)


def run(arguments: argparse.Namespace) -> int:
    """Read the result, write the reports, print the summary."""
    outputs = outputs_of(arguments)
    check_writable([path for path, _ in outputs], [arguments.result])
    record = read_json(arguments.result)
    write(record, outputs)
    show(record, outputs)
    return 0 if record.is_complete else INCOMPLETE
