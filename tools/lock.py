"""Write the pinned versions in requirements/, one file per level, the same on every supported Python.

Run it with the oldest supported Python, in an environment with the test requirements (it asks that
interpreter's pip what it would install), read the difference, run the tests, commit. The files are what
tools/quickstart, tools/test and .ci/run install. Each pin has the hashes of the wheels of all supported
Pythons and platforms, so that no other file is ever installed.
"""

import itertools
import json
import re
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from packaging.markers import Marker

ROOT = Path(__file__).resolve().parents[1]
LEVELS = {"run": "install and run", "test": "test", "dev": "lint and type-check", "site": "make the site of"}
PYTHONS = ("3.11", "3.12", "3.13")
PLATFORMS = {
    "linux x86_64": (
        "manylinux_2_28_x86_64",
        "manylinux_2_27_x86_64",
        "manylinux_2_17_x86_64",
        "manylinux2014_x86_64",
    ),
    "linux aarch64": (
        "manylinux_2_28_aarch64",
        "manylinux_2_27_aarch64",
        "manylinux_2_17_aarch64",
        "manylinux2014_aarch64",
    ),
    "darwin arm64": ("macosx_14_0_arm64", "macosx_12_0_arm64", "macosx_11_0_arm64", "macosx_11_0_universal2"),
}
"""By system and machine, the platform tags of wheels that install there."""

HEADER = """\
# To {purpose} obseq: exact versions, the same on Python 3.11 to 3.13, with the hashes of their
# wheels for Linux (x86-64 and aarch64) and macOS (arm64). Written by tools/lock.py.
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


def report_of(arguments: Iterable[str]) -> list[dict[str, Any]]:
    """What pip would install for these arguments."""
    options = ["--dry-run", "--ignore-installed", "--quiet", "--report", "-"]
    command = [sys.executable, "-m", "pip", "install", *options, *arguments]
    report = subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True).stdout
    installed: list[dict[str, Any]] = json.loads(report)["install"]
    return installed


def resolve(requirements: list[str]) -> dict[str, str]:
    """Name and version of everything pip would install for these requirements, dependencies included."""
    pins = (item["metadata"] for item in report_of(requirements))
    return {normalised(pin["name"]): pin["version"] for pin in pins}


def markers_of(requirements: list[str]) -> dict[str, str]:
    """The environment markers of the requirements that have one: a pin holds where its requirement does."""
    pairs = [requirement.partition(";")[::2] for requirement in requirements]
    return {normalised(re.split(r"[^\w.-]", text)[0]): mark.strip() for text, mark in pairs if mark}


def hashes_of(pins: Mapping[str, str], markers: Mapping[str, str]) -> dict[str, set[str]]:
    """The hashes of the wheels of each pin, on all supported Pythons and platforms."""
    found: dict[str, set[str]] = {name: set() for name in pins}
    for python, platform in itertools.product(PYTHONS, PLATFORMS):
        wanted = [
            f"{name}=={version}"
            for name, version in pins.items()
            if name not in markers or Marker(markers[name]).evaluate(environment(platform))
        ]
        for item in report_of([*options_of(python, platform), *wanted]):
            hashes = item["download_info"]["archive_info"]["hashes"]
            found[normalised(item["metadata"]["name"])].add(hashes["sha256"])
    return found


def environment(platform: str) -> dict[str, str]:
    """What markers see on a platform."""
    system, machine = platform.split()
    return {"sys_platform": system, "platform_machine": machine}


def options_of(python: str, platform: str) -> list[str]:
    """Options of pip for the wheels of another Python and platform."""
    tags = itertools.chain.from_iterable(("--platform", tag) for tag in PLATFORMS[platform])
    target = [
        "--target",
        tempfile.gettempdir(),
        "--no-deps",
        "--only-binary=:all:",
        "--python-version",
        python,
    ]
    return [*target, *tags]


def pinned(name: str, version: str, marker: str, hashes: Iterable[str]) -> str:
    """The lines of one pin."""
    first = f"{name}=={version}" + (f" ; {marker}" if marker else "")
    return " \\\n".join([first, *(f"    --hash=sha256:{digest}" for digest in sorted(hashes))]) + "\n"


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
        markers, added = (
            markers_of(requirements),
            {name: pins[name] for name in sorted(pins.keys() - held.keys())},
        )
        hashes = hashes_of(added, markers)
        lines = [
            pinned(name, version, markers.get(name, ""), hashes[name]) for name, version in added.items()
        ]
        text = HEADER.format(purpose=purpose) + below + "".join(lines)
        (ROOT / "requirements" / f"{level}.txt").write_text(text, encoding="utf-8")
        held, below = pins, f"-r {level}.txt\n"


if __name__ == "__main__":
    main()
