"""Makes `tests/data`, the excerpts of outside values that the tests need, from the folder of real data.

Where they come from, and under which licences, stands in `tests/data/README.md`.

Example:
    python tools/excerpts.py ../shared/data
"""

import argparse
import json
import shutil
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path
from typing import Any

EXCERPTS = Path(__file__).parents[1] / "tests" / "data"
POINTS = 2
"""Points of each formula whose values are kept."""

WHOLE = ("mmvii-topomini", "mmvii-topo-bench")
WITHOUT_SCRIPTS = "field-cases"
PROJECTS = ("comp3d-simple2d", "comp3d-weights")
NETWORKS = {
    "gama-textbook-1d": ("Baumann_Height_fix", "Ghilani12_6_Height_fix", "Niemeier_Height_fix1"),
    "gama-textbook-2d": (
        "Benning83_DistanceDirection_fix",
        "Ghilani15_4_Angle_fix",
        "Ghilani16_2_DistanceAngleAzimuth_fix",
        "LotherStrehle_Direction3",
        "StrangBorre_Distance_fix",
        "StrangBorre_Distance_free",
    ),
    "gama-textbook-3d": ("Caspary", "Wolf_3D_Distance_fix"),
}
NAMESPACE = "http://www.gnu.org/software/gama/gama-local"
KEPT = (
    *("file", "equations", "unknowns", "dof", "datum_defect", "sigma_apr", "sigma0", "m0", "points"),
    "published_krumm",
)
"""What is kept of the expected results of a network."""


def main() -> int:
    """Writes all the excerpts."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data", type=Path, help="the folder of real data")
    source = parser.parse_args().data
    write(source, EXCERPTS)
    return 0


def write(source: Path, target: Path) -> None:
    """Writes the excerpts of one folder of real data into another."""
    _formulas(source / "mmvii-check-values", target / "mmvii-check-values")
    _copy(source / "nist-strd-dev", target / "nist-strd-dev", ("*.dat", "expected.json"))
    for name in WHOLE:
        _copy(source / name, target / name, ("*.obs", "*.cor", "*.txt", "expected.json"))
    for folder in sorted(path for path in (source / WITHOUT_SCRIPTS).iterdir() if path.is_dir()):
        _copy(folder, target / WITHOUT_SCRIPTS / folder.name, ("*.obs", "*.cor"))
    for name in PROJECTS:
        _copy(source / name, target / name, ("*.obs", "*.cor", "*.comp", "expected.json"))
    for name, networks in NETWORKS.items():
        _networks(source / name, target / name, networks)


def _formulas(source: Path, target: Path) -> None:
    """The names of all the formulas; of those with values, a few points of each, a formula per line."""
    _copy(source, target, ("names.json",))
    records = json.loads((source / "check-values.json").read_text("utf-8"))
    lines = [json.dumps(record | {"points": record["points"][:POINTS]}) for record in records]
    (target / "check-values.json").write_text("[\n" + ",\n".join(lines) + "\n]\n", "utf-8")


def _copy(source: Path, target: Path, patterns: Sequence[str]) -> None:
    for path in sorted(path for pattern in patterns for path in source.glob(pattern)):
        target.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, target / path.name)


def _networks(source: Path, target: Path, names: Sequence[str]) -> None:
    """The measured numbers of some networks, and the expected results."""
    target.mkdir(parents=True, exist_ok=True)
    expected: dict[str, Any] = json.loads((source / "expected.json").read_text("utf-8"))["networks"]
    kept = {name: {key: expected[name][key] for key in KEPT} for name in names}
    (target / "expected.json").write_text(json.dumps({"networks": kept}, indent=1) + "\n", "utf-8")
    for name in names:
        file = Path(expected[name]["file"])
        _network(source / file, target / file)
        _printed((source / file).with_suffix(".adj"), (target / file).with_suffix(".adj"))


def _network(source: Path, target: Path) -> None:
    """A network with its points and observations alone, without the words of the file."""
    ElementTree.register_namespace("", NAMESPACE)
    root = ElementTree.parse(source).getroot()
    for network in root:
        for child in list(network):
            if child.tag == f"{{{NAMESPACE}}}description":
                network.remove(child)
    ElementTree.indent(root, " ")
    target.write_text(ElementTree.tostring(root, "unicode") + "\n", "utf-8")


def _printed(source: Path, target: Path) -> None:
    """The adjusted coordinates and precisions that a textbook prints, if it does: the numbers alone."""
    if source.exists():
        lines = (line.split("#")[0].split() for line in source.read_text("utf-8").splitlines())
        target.write_text("".join(f"{' '.join(words)}\n" for words in lines if words), "utf-8")


if __name__ == "__main__":
    raise SystemExit(main())
