"""Writes docs/formats.md from the catalogue of formats, which tests/formats/test_catalogue.py holds to it."""

from pathlib import Path

from obseq.formats.blocks.catalogue import BLOCKS, WRITERS
from obseq.formats.catalogue import FORMATS, Role
from obseq.formats.conversion import NETWORK_WRITERS, RESULT_WRITERS

PAGE = Path(__file__).resolve().parents[1] / "docs" / "formats.md"
HEAD = """# Formats

<!-- Written by tools/formats.py from src/obseq/formats/catalogue.py. -->

`obseq adjust FILES...` takes any mixture: files say by suffix, root element or first line what they are.
Points of one file complete the observations of another. `--obs` and `--cor` say it where names do not. What
each reader takes, and what it refuses, is in [files of other programs](other-formats.md),
[OBS and COR](survey-files.md) and [blocks of images](first-block.md).

## Networks

| format | files | holds | read as | written by `obseq convert` |
|---|---|---|---|---|
"""


def page() -> str:
    """The text of the page."""
    rows = []
    for known in FORMATS:
        ends = [*known.suffixes, *(f".xml, `<{root}>`" for root in known.roots)]
        written = [end for end in NETWORK_WRITERS if end in known.suffixes]
        if "DnaXmlFormat" in known.roots:
            written.append(".xml")
        if known.role is Role.TABLE:
            written = [".csv", ".obs.csv"]
        cells = (known.name, " ".join(ends), known.holds, known.role.value, " ".join(written) or "-")
        rows.append(f"| {' | '.join(cells)} |\n")
    blocks = "".join(f"| `--{form.option} {form.takes}` | {form.holds} |\n" for form in BLOCKS)
    results = f"Results (`.json`) are written as {', '.join(RESULT_WRITERS)}."
    images = f"## Blocks of images\n\n| `obseq bundle` | is |\n|---|---|\n{blocks}"
    outputs = "".join(f"| `--{form.option} {form.takes}` | {form.holds} |\n" for form in WRITERS)
    images += f"\n| `obseq bundle` writes | is |\n|---|---|\n{outputs}"
    return f"{HEAD}{''.join(rows)}\n{results}\n\n{images}"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
