"""Write the page "Coming from MMVII" from the table of its commands: `python tools/mmvii_page.py`.

The page is checked by the tests, so that it says what the code does.
"""

from pathlib import Path

from obseq.project.options.spelling import IDLE, Spelling
from obseq.project.options.spellings import SPELLINGS

PAGE = Path(__file__).resolve().parents[1] / "docs" / "coming-from-mmvii.md"
HEAD = """\
# Coming from MMVII

<!-- Written by tools/mmvii_page.py from the table of commands. -->

Type what you are used to, with `obseq mmvii` in place of `MMVII`:

```sh
obseq mmvii ImportGCP inputs/coords.cor ANXYZ InitRTL ChSys=[L93,RTL] AddInfoFree=0 Sigma=0.001 Comment=*
obseq mmvii ImportOBS inputs/meas.obs Obs1
obseq mmvii TopoAdj Obs1 InitRTL Obs1_out FinalRTL
obseq mmvii GCPChSysCo L93 FinalRTL FinalL93
```

Run it in the folder of the project. The tree `MMVII-PhgrProj` is made when it is needed. `obseq mmvii` lists
the commands; `obseq mmvii COMMAND -help` shows the arguments of one, `-Help` an example too. (How to.)

Each is done by a command of ours, which has more options (`obseq COMMAND --help`). What its files hold is in
[project trees of MMVII](projects.md).
"""


def page() -> str:
    """The text of the page."""
    parts = [HEAD, *map(_entry, SPELLINGS), "## Options without effect\n"]
    parts.append("They are accepted, and what they are not needed for is said.\n")
    rows = [f"| `{name}` | {why} |" for name, why in IDLE.items()]
    parts.append("\n".join(["| option | why |", "|---|---|", *rows]) + "\n")
    return "\n".join(parts)


def _entry(spelling: Spelling) -> str:
    lines = [f"## `{spelling.name}`", "", f"{spelling.about[0].upper()}{spelling.about[1:]}."]
    if spelling.ours:
        lines[-1] += f" Here: `obseq {spelling.ours}`." if spelling.ours != "gencode" else " Here: `gencode`."
    if spelling.differs:
        lines[-1] += f" {spelling.differs}"
    lines += ["", *(f"- `{spelling.name} {' '.join(form.places)}`" for form in spelling.forms)]
    if spelling.example:
        lines += ["", "```sh", f"obseq mmvii {spelling.example}", "```"]
    if spelling.options:
        rows = [f"| `{option.name}` | {option.about} |" for option in spelling.options]
        lines += ["", "| option | is |", "|---|---|", *rows]
    return "\n".join(lines).rstrip() + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
