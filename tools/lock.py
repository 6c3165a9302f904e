"""Write the pinned versions in requirements/, one file per level, the same on every supported Python.

Run it with the oldest supported Python (it asks that interpreter's pip what it would install), read the
difference, run the tests, commit. The files are what tools/quickstart, tools/test and .ci/run install.
"""

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
LEVELS = {"run": "install and run", "test": "test", "dev": "lint and type-check"}
HEADER = """\
# To {purpose} obseq: exact versions, the same on Python 3.11 to 3.13. Written by tools/lock.py.
"""


def requirements_of(level: str, project: dict[str, Any]) -> list[str]:
    """The requirements of a level as pyproject.toml states them, references to our own extras resolved."""
    if level == "run":
        return list(project["dependencies"])
    found: list[str] = []
    for requirement in project["optional-dependencies"][level]:
        own = re.fullmatch(r"obseq\[(\w+)\]", requirement)
        found += requirements_of(own.group(1), project) if own else [requirement]
    return found if level == "gencode" else requirements_of("run", project) + found


def normalised(name: str) -> str:
    """The name as package indexes compare it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def resolve(requirements: list[str]) -> dict[str, str]:
    """Name and version of everything pip would install for these requirements, dependencies included."""
    options = ["--dry-run", "--ignore-installed", "--quiet", "--report", "-"]
    command = [sys.executable, "-m", "pip", "install", *options, *requirements]
    report = subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True).stdout
    pins = (item["metadata"] for item in json.loads(report)["install"])
    return {normalised(pin["name"]): pin["version"] for pin in pins}


def markers_of(requirements: list[str]) -> dict[str, str]:
    """The environment markers of the requirements that have one: a pin holds where its requirement does."""
    pairs = [requirement.partition(";")[::2] for requirement in requirements]
    return {normalised(re.split(r"[^\w.-]", text)[0]): f" ; {mark.strip()}" for text, mark in pairs if mark}


def main() -> None:
    """Resolve each level with the versions of the level below held, and write its file."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    project = settings["project"]
    project["dependencies"] += settings["build-system"]["requires"]
    held: dict[str, str] = {}
    below = ""
    for level, purpose in LEVELS.items():
        requirements = requirements_of(level, project)
        pins = resolve(requirements + [f"{name}=={version}" for name, version in held.items()])
        markers = markers_of(requirements)
        lines = [f"{name}=={pins[name]}{markers.get(name, '')}" for name in sorted(pins.keys() - held.keys())]
        text = HEADER.format(purpose=purpose) + below + "".join(f"{line}\n" for line in lines)
        (ROOT / "requirements" / f"{level}.txt").write_text(text, encoding="utf-8")
        held, below = pins, f"-r {level}.txt\n"


if __name__ == "__main__":
    main()
