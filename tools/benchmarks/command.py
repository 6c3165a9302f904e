"""What the command lines of the benches have in common."""

import argparse
import json
from pathlib import Path


def command_line(words: str | None) -> argparse.ArgumentParser:
    """A parser without options yet, whose help are the words of a module, laid out as they are."""
    return argparse.ArgumentParser(description=words, formatter_class=argparse.RawDescriptionHelpFormatter)


def write_json(path: Path | None, figures: object) -> None:
    """Writes the figures of a bench, where a file is asked for."""
    if path:
        path.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
