"""`obseq check-derivatives`: generated derivatives against finite differences."""

import argparse
from typing import TYPE_CHECKING

import msgspec

from obseq.cli.parsing import Commands, add_command, output_file, positive_integer, say
from obseq.cli.progress import Progress
from obseq.records.record import encoded
from obseq.writing import check_writable, write_all

if TYPE_CHECKING:
    from obseq.kernels.derivatives import DerivativeCheck

CHECK_FAILED = 1

MORE = """
Each derivative is compared with a sixth-order central difference at random admissible inputs. The
error is relative to the largest entry of its row of the Jacobian."""

EXAMPLE = "exit code: 0 all passed; 1 at least one failed; 2 could not run"


def register(commands: Commands) -> None:
    """Add the command to the parser."""
    command = add_command(
        commands, "check-derivatives", run, "compare every derivative with a finite difference", MORE, EXAMPLE
    )
    command.add_argument("names", nargs="*", metavar="NAME", help="formulas to check (all of them)")
    command.add_argument("--samples", type=positive_integer, metavar="N", help="random inputs per formula")
    command.add_argument("--json", type=output_file, metavar="FILE", help="also write the table as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Check, print a table, and return 1 when a derivative is wrong."""
    outputs = [arguments.json] if arguments.json else []
    check_writable(outputs)
    options = {"samples": arguments.samples} if arguments.samples else {}
    with Progress("checking derivatives") as progress:
        from obseq.kernels import derivatives

        checks = derivatives.check(arguments.names or None, progress=progress, **options)
        write_all({path: to_json(checks) for path in outputs})
    say(f"{to_text(checks)}\n", outputs)
    return 0 if all(check.passed for check in checks) else CHECK_FAILED


def to_text(checks: "list[DerivativeCheck]") -> str:
    """One line per formula: its worst relative error, and where."""
    width = max((len(check.name) for check in checks), default=0)
    lines = [f"{'formula':<{width}}  worst relative error  residual by unknown"]
    for check in checks:
        mark = "  STALE" if check.stale else "" if check.passed else "  FAILED"
        where = f"{check.residual} by {check.unknown}"
        lines.append(f"{check.name:<{width}}  {check.worst_relative_error:>20.2e}  {where}{mark}")
    failed = sum(not check.passed for check in checks)
    lines += [check.stale for check in checks if check.stale]
    lines.append(f"{failed} of {len(checks)} failed" if failed else f"all {len(checks)} passed")
    return "\n".join(lines)


def to_json(checks: "list[DerivativeCheck]") -> str:
    """The table as JSON; an error that is infinite is null."""
    rows = [
        {
            "name": check.name,
            "worst_relative_error": check.worst_relative_error,
            "unknown": check.unknown,
            "residual": check.residual,
            "passed": check.passed,
            "stale": check.stale,
        }
        for check in checks
    ]
    table = {"format": "obseq-derivative-checks", "version": 1, "formulas": rows}
    return msgspec.json.format(encoded(table), indent=1) + "\n"
