"""What may import what: the table that tests/test_architecture.py holds, drawn in docs/architecture.md.

Run it to write the page anew after a change of the table.
"""

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "src" / "obseq"
PAGE = ROOT / "docs" / "architecture.md"
BESIDE = ("formulas", "codegen", "generated")
"""Rooms whose folders stand beside `src`."""

FILES = (
    "arguments",
    "arrays",
    "cached",
    "boundary",
    "dataclass",
    "errors",
    "graphs",
    "module_texts",
    "packages",
    "pools",
    "printable",
    "spreadsheets",
    "stopwatch",
    "version",
    "writing",
)
"""Single files beside the rooms, for everybody; they import each other and nothing else."""

ARROWS: dict[str, tuple[str, ...]] = {
    "compilation": (),
    "records": (),
    "geometry": (),
    "crs": ("geometry",),
    "formulas": (),
    "report": ("records", "reading"),
    "reading": (),
    "codegen": ("formulas", "kernels"),
    "generated": ("kernels",),
    "kernels": ("compilation",),
    "leastsquares": ("kernels", "compilation", "geometry"),
    "diagnosis": ("leastsquares",),
    "survey": ("diagnosis", "leastsquares", "kernels", "geometry", "crs", "records", "report"),
    "images": (
        "diagnosis",
        "leastsquares",
        "kernels",
        "geometry",
        "crs",
        "survey",
        "records",
        "report",
        "reading",
    ),
    "formats": ("survey", "images", "kernels", "geometry", "crs", "records", "reading"),
    "joint": ("images", "survey", "diagnosis", "records", "report", "leastsquares", "kernels", "crs"),
    "project": ("formats", "images", "survey", "geometry", "crs", "reading"),
    "targets": ("images", "project", "kernels", "compilation", "leastsquares", "geometry", "reading"),
    "cli": (
        "reading",
        "targets",
        "report",
        "diagnosis",
        "records",
        "formats",
        "survey",
        "images",
        "project",
        "leastsquares",
        "kernels",
        "compilation",
        "crs",
        "codegen",
    ),
}
"""Each room and what it may import, type-only imports included. Codegen and the generated modules take the
layout and the functions of kernels alone; kernels load a generated module by name, when it is asked for, and
`survey/files` what reads and writes files."""

INSIDE: dict[str, dict[str, tuple[str, ...]]] = {
    "codegen": {
        "c_text": (),
        "dependencies": (),
        "exact": (),
        "templating": (),
        "operators": ("c_text",),
        "project": ("templating",),
        "equations": ("operators", "templating"),
        "graphs": ("operators",),
        "compiler": ("graphs",),
        "printing": ("graphs", "operators"),
        "kernel_text": ("printing", "compiler", "graphs"),
        "modules": ("kernel_text", "compiler", "equations", "templating", "dependencies"),
        "c99": ("modules", "printing", "compiler", "operators", "templating", "c_text"),
        "jax_text": ("modules", "printing", "compiler", "operators", "c_text"),
        "pipeline": ("modules", "kernel_text", "compiler"),
        "files": ("pipeline", "modules", "templating"),
        "ondemand": ("pipeline", "compiler"),
        "main": (
            "ondemand",
            "files",
            "pipeline",
            "jax_text",
            "c99",
            "modules",
            "compiler",
            "equations",
            "project",
        ),
    },
    "report": {
        "result_columns": (),
        "saving": (),
        "tables": (),
        "worst_test": (),
        "basis": ("tables",),
        "drawings": ("tables",),
        "head": ("tables",),
        "result_file": ("result_columns",),
        "said": ("tables",),
        "verdict": ("worst_test",),
        "findings": ("verdict", "said", "head", "tables"),
        "writer": ("said", "tables"),
        "part": ("findings", "drawings", "tables"),
        "summary": ("writer", "said", "head", "tables"),
        "adjusted": ("summary", "part", "findings", "verdict", "said", "head", "basis", "tables"),
        "notebook": ("adjusted", "summary", "writer", "drawings", "tables"),
        "page": ("adjusted", "part", "head", "drawings", "tables"),
        "compared": ("page", "summary", "writer", "said", "head", "tables"),
        "formats": ("page", "adjusted", "summary", "result_file", "result_columns"),
        "planned": ("page", "adjusted", "summary", "findings", "said", "head", "tables"),
    },
    "leastsquares": {
        "loops": (),
        "solvers": (),
        "sparse": ("loops", "solvers"),
        "blocks": ("solvers",),
        "problem": ("sparse",),
        "diagnosis": ("problem", "solvers"),
        "assembly": ("diagnosis", "loops", "problem", "sparse", "solvers"),
        "solution": ("problem", "sparse", "solvers"),
        "iterations": ("solution", "assembly", "diagnosis", "problem", "solvers"),
        "analysis": ("iterations", "solution", "assembly", "diagnosis", "problem", "blocks", "solvers"),
        "system": ("analysis", "blocks", "iterations", "solution", "assembly", "problem"),
        "statistics": ("system", "solution", "assembly", "loops", "problem", "sparse", "solvers"),
    },
    "survey": {
        "kinds": (),
        "points": (),
        "point_file_options": (),
        "files": (),
        "model": ("points", "kinds"),
        "checks": ("model", "kinds"),
        "sights": ("model", "kinds"),
        "initial": ("sights", "model", "kinds"),
        "equations": ("initial", "model", "kinds"),
        "adjustment": ("equations", "initial", "model", "kinds"),
        "causes": ("adjustment", "equations", "initial", "model", "points", "kinds"),
        "diagnosing": ("causes", "adjustment", "equations", "initial", "model", "points", "kinds"),
        "assembling": ("adjustment", "equations", "initial", "model", "files"),
        "by_name": ("adjustment", "equations", "model", "kinds"),
        "edited": ("by_name", "diagnosing", "model"),
        "fieldwork": ("diagnosing", "causes", "adjustment", "equations", "initial", "sights", "model"),
        "grid_bearings": ("fieldwork", "adjustment", "equations", "model", "kinds"),
        "network": (
            "assembling",
            "by_name",
            "edited",
            "fieldwork",
            "diagnosing",
            "adjustment",
            "equations",
            "initial",
            "checks",
            "model",
            "files",
            "point_file_options",
        ),
        "epochs": ("adjustment", "equations", "initial", "sights", "model"),
        "planning": ("network", "adjustment", "equations", "initial", "sights", "model", "kinds"),
        "maps": (),
        "drawings": ("maps",),
    },
    "images": {
        "model": (),
        "names": (),
        "measures": ("names",),
        "camera": ("names", "model"),
        "poses": ("camera", "names"),
        "control": ("names",),
        "measure_checks": ("camera", "measures", "names"),
        "parts": ("poses", "measures"),
        "rigid": ("poses", "names"),
        "references": ("control", "names"),
        "block": (
            "references",
            "rigid",
            "parts",
            "measure_checks",
            "control",
            "poses",
            "camera",
            "measures",
            "names",
        ),
        "initial": ("block", "measure_checks", "control", "poses", "camera", "measures", "names"),
        "adjustment": (
            "initial",
            "block",
            "references",
            "rigid",
            "parts",
            "control",
            "poses",
            "camera",
            "measures",
            "names",
        ),
        "aerial": ("initial",),
        "causes": ("adjustment", "initial", "parts", "control", "poses", "camera", "measures", "names"),
        "epipolar": ("aerial", "camera"),
        "diagnosing": ("causes", "adjustment", "initial", "control", "poses", "measures", "names"),
        "placing": ("diagnosing", "adjustment", "initial", "poses", "measures"),
        "output": ("diagnosing", "causes", "adjustment", "block", "camera"),
        "adjusted": ("output", "adjustment"),
        "edited": ("adjusted", "diagnosing", "adjustment", "parts"),
        "bundle": ("edited", "placing", "adjustment"),
        "satellite": ("output", "aerial", "adjustment", "control", "measures", "names"),
        "uncalibrated": ("bundle", "initial", "control", "poses", "camera", "measures", "names"),
    },
    "formats": {
        "columns": (),
        "default_sigmas": (),
        "stochastic": ("default_sigmas",),
        "once": (),
        "project": ("stochastic",),
        "catalogue": (),
        "levelled_points": (),
        "includes": ("once",),
        "obs": ("catalogue", "columns", "once", "project"),
        "tables": ("columns", "default_sigmas", "levelled_points", "project"),
        "comp3d": ("obs", "columns", "includes", "levelled_points", "project"),
        "gama": ("columns", "levelled_points", "project"),
        "dynadjust": ("columns", "includes", "project"),
        "sinex": ("dynadjust", "columns", "project"),
        "gvx": ("dynadjust", "project"),
        "snap": ("dynadjust", "includes", "project"),
        "starnet": ("columns", "default_sigmas", "includes", "levelled_points", "project", "stochastic"),
        "landxml": ("fieldbooks", "project"),
        "fieldbooks": ("columns", "default_sigmas", "levelled_points", "project", "stochastic"),
        "registry": ("catalogue", "once", "project"),
        "vertical_factors": (),
        "networks": (
            *("registry", "obs", "default_sigmas", "levelled_points", "once", "project", "stochastic"),
            "vertical_factors",
        ),
        "point_files": ("obs",),
        "conversion": ("point_files", "obs", "tables", "gama", "dynadjust", "sinex"),
        "camera_terms": (),
        "fitted": (),
        "blocks": (),
        "opk": (),
        "aicon": ("blocks", "fitted"),
        "colmap": ("blocks", "camera_terms", "fitted"),
        "calibrations": ("colmap",),
        "opensfm": ("blocks", "camera_terms", "fitted"),
        "rpc": ("blocks",),
        "nvm": ("blocks",),
        "pix4d": ("blocks",),
        "openmvg": ("blocks",),
        "meshroom": ("blocks",),
        "metashape": ("blocks", "camera_terms", "fitted"),
        "bal": ("camera_terms",),
        "bundler": ("bal", "blocks"),
        "dbat": ("blocks",),
        "photomodeler": ("blocks", "dbat"),
    },
}
"""The same for the rooms, and single files, inside a room."""

PATH = """\
1. `formats/obs`: a line of an OBS file becomes a row of a field book, with its file and line.
2. `survey/model`: rows are columns of numbers; stations and rounds are found from their order.
3. `survey/initial`: points without coordinates and unknown orientations get their first values.
4. `survey/equations`: rows of one kind become a batch of one formula, in metres and radians.
5. `leastsquares/problem`: the batch is checked once, and copied into the padded rows of tiles.
6. `leastsquares/assembly` and `loops`: tile by tile, the `generated` kernel gives residuals and derivatives,
   which are weighted and added to the normal equations; the Jacobian never goes to memory.
7. `leastsquares/solvers`: a sparse Cholesky factorisation gives the step; `iterations` decide when to stop.
8. `leastsquares/solution`: residuals at the solution, and the inverse on the pattern of the matrix.
9. `leastsquares/statistics`: redundancy, tests and the effect of a blunder for each observation.
10. `survey/adjustment` writes the record of the result; `report` makes text, JSON and pages from it alone.
"""


def folder_of(room: str) -> Path:
    """Where a room is."""
    return ROOT / room if room in BESIDE else PACKAGE / room


def modules_of(room: str) -> list[Path]:
    """The Python files of a room."""
    return sorted(folder_of(room).rglob("*.py"))


def purpose(place: Path) -> str:
    """First sentence of what a room or a file says of itself."""
    path = file if (file := place.with_suffix(".py")).is_file() else place / "__init__.py"
    line = (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").splitlines()[0]
    return line.rstrip(".")


def floors(arrows: dict[str, tuple[str, ...]]) -> dict[str, int]:
    """Floor of each room: one above the highest of those that it imports.

    Raises:
        ValueError: rooms import one another in a circle.
    """
    found: dict[str, int] = {}
    while len(found) < len(arrows):
        ready = [room for room in arrows if room not in found and found.keys() >= set(arrows[room])]
        if not ready:
            raise ValueError(f"a circle among {sorted(arrows.keys() - found.keys())}")
        found |= {room: 1 + max((found[other] for other in arrows[room]), default=-1) for room in ready}
    return found


def drawing(arrows: dict[str, tuple[str, ...]], folder: Path | None) -> str:
    """Rooms from the top down, what each is for and what it may import."""
    floor = floors(arrows)
    lines = ["| floor | room | what it is for | may import |", "|---|---|---|---|"]
    for room in sorted(arrows, key=lambda room: (-floor[room], room)):
        place = folder_of(room) if folder is None else folder / room
        below = ", ".join(sorted(arrows[room])) or "-"
        lines.append(f"| {floor[room]} | `{room}` | {purpose(place)} | {below} |")
    return "\n".join(lines) + "\n"


def page() -> str:
    """The text of docs/architecture.md."""
    parts = [
        "# Rooms, and what may import what\n",
        "<!-- Written by tools/architecture.py from the table that tests/test_architecture.py holds. -->\n",
        "Imports go downwards only, those for types included: there is no circle, between rooms or between "
        "files. `import obseq` loads none of it.\n",
        drawing(ARROWS, None),
        "For all rooms, single files:\n",
        "".join(f"- `{name}`: {purpose(PACKAGE / name)}\n" for name in FILES),
    ]
    for room, arrows in INSIDE.items():
        parts += [f"## Inside `{room}`\n", drawing(arrows, folder_of(room))]
    parts += ["## The path of one observation\n", PATH]
    return "\n".join(parts)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
