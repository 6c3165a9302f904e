"""The `gencode` command: says what to install where the generator's own needs are missing."""

import sys

from obseq.cli.guard import CANNOT_RUN, guarded


def main() -> int:
    """Run gencode and return its exit code."""
    from obseq.kernels.ondemand import GENERATOR_NEEDS, can_build

    if not can_build():
        needs = " and ".join(GENERATOR_NEEDS)
        sys.stderr.write(f"gencode: it needs {needs}; install them with: pip install 'obseq[gencode]'\n")
        return CANNOT_RUN
    from obseq.codegen.main import main as generate

    return guarded("gencode", generate)
