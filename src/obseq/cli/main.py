"""The `obseq` command: its parser, and what its exit code says.

Exit codes: 0 done; 1 done, and a check failed (no convergence, a derivative that is wrong); 2 could not run,
with one message on standard error; 130 interrupted from the keyboard.
"""

import argparse
import io
import os
import sys
import traceback
from collections.abc import Sequence

from obseq.cli import adjust, check_derivatives, demo, formulas, versions
from obseq.errors import ObseqError

CANNOT_RUN = 2
INTERRUPTED = 130

DESCRIPTION = """\
Least squares adjustment of survey observations.

Try `obseq demo` first. `obseq COMMAND --help` explains a command."""

EPILOG = """\
exit code: 0 done; 1 done, and a check failed; 2 could not run, with one message that says why"""


def parser() -> argparse.ArgumentParser:
    """The parser of the command line, with every subcommand."""
    top = argparse.ArgumentParser(
        prog="obseq",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = top.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for module in (demo, adjust, formulas, check_derivatives, versions):
        module.register(commands)
    return top


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code."""
    _print_any_character()
    try:
        chosen = parser().parse_args(arguments)
        code: int = chosen.run(chosen)
        sys.stdout.flush()
    except ObseqError as error:
        return _fail(str(error))
    except BrokenPipeError:
        _forget_standard_output()
        return 0
    except OSError as error:
        return _fail(f"{error.filename}: {error.strerror}" if error.filename else str(error))
    except MemoryError:
        return _fail("There is not enough memory for this computation.")
    except KeyboardInterrupt:
        _say("\nobseq: interrupted; no file is half-written.")
        return INTERRUPTED
    except Exception:
        traceback.print_exc()
        return _fail("This is a defect of obseq: please report it with the lines above and `obseq versions`.")
    return code


def _fail(message: str) -> int:
    _say(f"obseq: {message}")
    return CANNOT_RUN


def _say(message: str) -> None:
    sys.stderr.write(f"{message}\n")


def _print_any_character() -> None:
    """Let names that the terminal cannot show be printed as escapes instead of ending the command."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _forget_standard_output() -> None:
    """The reader of our output has gone (`obseq formulas | head`): leave nothing to flush at the end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    sys.exit(main())
