"""`obseq check-derivatives`: derivatives against finite differences, and kernels against their formulas."""

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING

import msgspec

from obseq.cli.parsing import Commands, add_command, output_file, positive_integer, say
from obseq.cli.progress import Progress
from obseq.packages import GENERATOR, missing
from obseq.records.record import encoded
from obseq.writing import check_writable, write_all

if TYPE_CHECKING:
    from obseq.kernels.awkward import AwkwardCheck
    from obseq.kernels.derivatives import DerivativeCheck

CHECK_FAILED = 1

MORE = """
Each derivative is compared with a sixth-order central difference at random admissible inputs. The
error is relative to the largest entry of its row of the Jacobian.

Where the generator is installed, values and derivatives are compared with the formula read in 50 digits
as well, at awkward places: along axes, at poles, at zero distance, at half turns, at far coordinates.
An error is relative to the result, or to what the last digits of the inputs leave of it. Where the
formula has no derivative is listed."""

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
        beside = compared(arguments.names or None, progress)
        write_all({path: to_json(checks, beside) for path in outputs})
    say(f"{to_text(checks)}\n\n{to_awkward_text(beside)}\n", outputs)
    passed = all(check.passed for check in checks) and all(check.passed for check in beside)
    return 0 if passed else CHECK_FAILED


def compared(names: Sequence[str] | None, progress: Progress) -> "list[AwkwardCheck]":
    """The kernels beside their formulas; nothing where the generator is not installed."""
    from obseq.kernels import awkward

    return [] if missing(*GENERATOR) else awkward.check(names, progress=progress)


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


def to_awkward_text(checks: "list[AwkwardCheck]") -> str:
    """One line per formula: the worst errors of values and derivatives, and where."""
    if not checks:
        return 'kernels were not compared with their formulas; that needs pip install "obseq[gencode]"'
    width = max(len(check.name) for check in checks)
    lines = [f"{'formula':<{width}}  value error  at{'':<20}  derivative error  at"]
    for check in checks:
        value = f"{check.value_error:>11.1e}  {check.value_place:<22}"
        lines.append(
            f"{check.name:<{width}}  {value}  {check.slope_error:>16.1e}  {check.slope_place}"
            + ("" if check.passed else "  FAILED")
        )
    lines += [f"{c.name} has no derivative: {', '.join(c.singular)}" for c in checks if c.singular]
    failed = sum(not check.passed for check in checks)
    lines.append(f"{failed} of {len(checks)} failed" if failed else f"all {len(checks)} are their formulas")
    return "\n".join(lines)


def to_json(checks: "list[DerivativeCheck]", beside: "Sequence[AwkwardCheck]" = ()) -> str:
    """The table as JSON; an error that is infinite is null."""
    more = {
        check.name: {
            "value_error": check.value_error,
            "value_place": check.value_place,
            "slope_error": check.slope_error,
            "slope_place": check.slope_place,
            "singular": list(check.singular),
        }
        for check in beside
    }
    passes = {check.name: check.passed for check in beside}
    rows = [
        {
            "name": check.name,
            "worst_relative_error": check.worst_relative_error,
            "unknown": check.unknown,
            "residual": check.residual,
            "passed": check.passed and passes.get(check.name, True),
            "stale": check.stale,
            **more.get(check.name, {}),
        }
        for check in checks
    ]
    table = {"format": "obseq-derivative-checks", "version": 1, "formulas": rows}
    return msgspec.json.format(encoded(table), indent=1) + "\n"
