"""The `gencode` command: says what to install where the generator's own needs are missing."""

import sys

from obseq.cli.guard import CANNOT_RUN, guarded
from obseq.errors import MissingPackageError


def main() -> int:
    """Run gencode and return its exit code."""
    try:
        from obseq.codegen.main import main as generate
    except MissingPackageError as error:
        sys.stderr.write(f"gencode: {error}\n")
        return CANNOT_RUN
    return guarded("gencode", generate)
