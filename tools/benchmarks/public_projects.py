"""Public projects of others, unedited: adjusted where they are at hand, against published or kept figures.

python tools/benchmarks/public_projects.py ROOT [--only NAME ...]

ROOT holds repositories as ROOT/OWNER/NAME. The list is `public_projects.json`: files, how they are read, the
figures, and whose they are. "published" is the listing of the program that the project was made with;
"kept" is what came out here when it was first read, so that a change is seen.
"""

import argparse
import json
import logging
import shutil
import sys
import tempfile
from pathlib import Path

from obseq.errors import ObseqError
from obseq.survey import Datum, Network

LIST = Path(__file__).with_suffix(".json")
KEPT = 1e-6
"""Relative difference of a figure of ours; of a published one half a unit of its last digit is allowed."""


def adjusted(root: Path, project: dict[str, object]) -> dict[str, float]:
    """Observations, redundancy and sigma0 of a project."""
    options = dict(project.get("options", {}))  # type: ignore[call-overload]
    datum = options.pop("datum", None)
    folder = root / str(project["repository"])
    paths = [folder / name for name in project["files"]]  # type: ignore[attr-defined]
    points = [folder / name for name in options.pop("point_files", [])]
    with tempfile.TemporaryDirectory() as copies:
        if suffix := str(project.get("as", "")):  # files that were renamed where they lie
            for number, path in enumerate(paths):
                paths[number] = Path(shutil.copy(path, Path(copies) / f"{path.stem}{suffix}"))
        if worth := str(project.get("worth", "")):  # what the listing says of instruments
            options["stochastic"] = Path(copies) / "worth.toml"
            options["stochastic"].write_text(worth, encoding="utf-8")
        network = Network.read_project(paths, point_files=points, **options)
    if project.get("reads"):
        return {"observations": len(network.book.observations)}
    record = (network.adjust(datum=Datum(datum)) if datum else network.adjust()).record()
    found = {"observations": len(network.book.observations), "redundancy": record.redundancy}
    return found if record.sigma0 is None else {**found, "sigma0": record.sigma0}


def differences(found: dict[str, float], project: dict[str, object]) -> list[str]:
    """What is not as it should be, in words."""
    wrong = []
    for kind, figures in (("published", project.get("published", {})), ("kept", project.get("kept", {}))):
        for name, value in figures.items():  # type: ignore[attr-defined]
            digits = len(str(value).partition(".")[2])
            allowed = 0.51 * 10.0**-digits if kind == "published" else KEPT * abs(value)
            if abs(found[name] - value) > allowed:
                wrong.append(f"{name} {found[name]:.7g}, {kind} {value}")
    return wrong


def main() -> int:
    """Prints a line for each project; 1 when a figure differs, or a project that is at hand is not read."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("root", type=Path, help="where the repositories lie")
    parser.add_argument("--only", nargs="+", default=[], help="these projects (all)")
    parser.add_argument("--keep", action="store_true", help="write the figures of this run into the list")
    options = parser.parse_args()
    logging.disable(logging.WARNING)
    projects = json.loads(LIST.read_text("utf-8"))
    failures = 0
    for project in projects:
        name = project["name"]
        if options.only and name not in options.only:
            continue
        if not all((options.root / project["repository"] / file).exists() for file in project["files"]):
            print(f"{name:34} not at hand")
            continue
        try:
            found = adjusted(options.root, project)
        except ObseqError as error:
            failures += 1
            print(f"{name:34} FAILED: {str(error)[:200]}")
            continue
        wrong = differences(found, project)
        failures += bool(wrong)
        shown = " ".join(f"{key} {value:.7g}" for key, value in found.items())
        print(f"{name:34} {shown} {'DIFFERS: ' + '; '.join(wrong) if wrong else ''}", flush=True)
        if options.keep:
            project["kept"] = found
    if options.keep:
        LIST.write_text(json.dumps(projects, indent=1) + "\n", encoding="utf-8")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
