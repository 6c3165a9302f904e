"""Write the page of all causes and slips from their objects: `python tools/causes_page.py`.

The page is checked by the tests, so that it says what the code does.
"""

from pathlib import Path

from obseq.cli.causes import paragraphs, sections
from obseq.diagnosis.page import Page

PAGE = Path(__file__).resolve().parents[1] / "docs" / "causes.md"
HEAD = """\
# What may be wrong: causes and slips

<!-- Written by tools/causes_page.py from the causes. -->

Results name what they accuse by a code. `obseq causes` lists the codes, and `obseq causes S120` explains one.
A cause says where an error is. A slip says what may be behind it. (Reference.)
"""


def page() -> str:
    """The text of the page."""
    parts = [HEAD]
    for title, pages in sections().items():
        parts += [f"## {title}\n", *map(_entry, pages)]
    return "\n".join(parts)


def _entry(one: Page) -> str:
    lines = [f"### {one.code} {one.name}", "", one.about, ""]
    lines += [f"- {title}: {text}" for title, text in paragraphs(one)]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
