"""The `gencode` command: says what to install where the generator's own needs are missing."""

from obseq.cli.guard import guarded


def main() -> int:
    """Run gencode and return its exit code."""
    return guarded("gencode", _generate)


def _generate() -> int:
    """Load the generator, which takes half a second, and run it."""
    from obseq.codegen.main import main as generate

    return generate()
