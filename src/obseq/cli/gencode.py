"""The `gencode` command: says what to install where the generator's own needs are missing."""

from collections.abc import Sequence

from obseq.cli.guard import guarded


def main() -> int:
    """Run gencode and return its exit code."""
    return guarded("gencode", generate)


def generate(arguments: Sequence[str] | None = None) -> int:
    """Load the generator, which takes half a second, and run it; None for the arguments of the program."""
    from obseq.codegen.main import main as run

    return run(arguments)
