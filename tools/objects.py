"""Machine code ahead of time: every compiled loop and kernel as one shared library per kind of processor.

    python tools/objects.py --list                 every loop with its signature
    python tools/objects.py --wheel DIR            a platform wheel: the pure one, with the libraries in it
    python tools/objects.py --into DIR             the libraries alone

`--formulas` and `--modules` limit kernels and loops, for trials. A C compiler links the objects that numba's
LLVM writes; nothing of either is needed where the wheel is installed. The whole takes some minutes at first;
later, what changed since: objects are kept in the user's cache.
"""

import argparse
import base64
import functools
import hashlib
import importlib
import os
import platform
import subprocess
import sys
import sysconfig
import tempfile
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from obseq.compilation import Loop, cache, objects
from obseq.compilation.digests import DIGITS
from obseq.compilation.routines import Routine
from obseq.kernels import formula_names, load
from obseq.kernels.loading import routine

ROOT = Path(__file__).resolve().parents[1]
LOOPS = {
    "obseq.kernels.tiles": ("call_kernel", "evaluate_jacobian", "evaluate_rows", "evaluate_values"),
    "obseq.leastsquares.assembly.small_loops": ("find_step",),
    "obseq.leastsquares.loops.accumulation": ("assemble", "evaluate"),
    "obseq.leastsquares.loops.block_places": ("list_pairs", "place_blocks"),
    "obseq.leastsquares.loops.blocks_to_matrix": (
        "add_diagonal_blocks",
        "add_pairs",
        "add_priors",
        "pattern_rows",
    ),
    "obseq.leastsquares.loops.leverages": ("leverages",),
    "obseq.leastsquares.loops.neighbours": (
        "join_bodies",
        "list_neighbours",
        "place_bodies",
        "write_links",
    ),
    "obseq.leastsquares.loops.schur_complement": (
        "eliminate",
        "substitute_back",
        "subtract_sums",
    ),
    "obseq.leastsquares.loops.sorting": ("count_numbers", "number_pairs", "put_in_order"),
    "obseq.leastsquares.loops.shares": ("add_copies", "divert"),
    "obseq.leastsquares.sparse": ("count_products", "multiply", "multiply_rows", "write_products"),
    "obseq.leastsquares.solvers.dense_loops": (
        "factor_columns",
        "invert_small",
        "solve_columns",
    ),
    "obseq.leastsquares.solvers.graph": (
        "count_edges",
        "peel_leaves_and_chains",
        "sum_keys",
        "write_edges",
        "write_edges_left",
    ),
    "obseq.leastsquares.solvers.inverse": ("invert_nodes",),
    "obseq.leastsquares.solvers.minimum_degree": ("eliminate_least",),
    "obseq.leastsquares.solvers.numeric": ("factor_nodes", "factor_panel"),
    "obseq.leastsquares.solvers.schedule": ("assign_tasks", "place_fronts", "place_updates"),
    "obseq.leastsquares.solvers.substitution": (
        "quadratic_forms",
        "substitute_backward",
        "substitute_forward",
    ),
    "obseq.leastsquares.solvers.symbolic": (
        "climb_rows",
        "place_entries",
        "place_rows",
        "sort_entries",
        "turn_entries",
        "write_rows",
    ),
    "obseq.leastsquares.solvers.elimination_tree": (
        "count_rows",
        "find_parents",
        "gather_vertices",
        "visit_children_first",
    ),
    "obseq.targets.finding.detection": (
        "discs",
        "halved",
        "saddle_strength",
        "saddles",
        "smooth",
    ),
    "obseq.targets.finding.light_spots": ("above_mean", "spots", "stand_out"),
    "obseq.targets.finding.spot_edges": ("edge_ellipses", "light_share", "ring_bits"),
    "obseq.targets.drawing.painting": ("bit_sums", "paint", "paint_places", "smooth_table"),
    "obseq.targets.drawing.rendering": (
        "blur_layers",
        "layers",
        "normal_equations",
        "observe",
        "render",
        "spread",
    ),
}
"""Every loop that Python calls; the others are parts of them."""

KERNELS = ("value", "value_and_jacobian")
FROM_C = frozenset({"atan2", "memcpy", "memmove", "memset", "sincos"})
"""What objects may need from the C library of Linux: nothing that allocates, raises or calls Python."""


def loops(modules: Iterable[str] = tuple(LOOPS)) -> Iterator[Loop]:
    """Every loop of some modules that Python calls."""
    for module in modules:
        yield from (getattr(importlib.import_module(module), name) for name in LOOPS[module])


@dataclass(frozen=True)
class Choice:
    """What is compiled.

    Attributes:
        modules: modules of loops.
        formulas: formulas whose kernels are compiled.
        levels: kinds of processors.
    """

    modules: tuple[str, ...]
    formulas: tuple[str, ...]
    levels: tuple[str, ...]

    def routines(self) -> list[Routine]:
        """The loops and kernels, each once."""
        found = [loop.routine for loop in loops(self.modules)]
        found += [routine(load(name).module, kernel) for name in self.formulas for kernel in KERNELS]
        return list({each.symbol: each for each in found}.values())


def emit(choice: Choice, part: int, parts: int, folder: Path) -> None:
    """Writes the objects of one part of the routines, a folder for each kind of processor."""
    for each in choice.routines()[part::parts]:
        for level, code in made(each, choice.levels).items():
            (folder / level / f"{each.symbol}.o").write_bytes(code)


def made(each: Routine, levels: Sequence[str]) -> dict[str, bytes]:
    """Objects of a routine for kinds of processors: those of the user's cache, the others compiled."""
    names = {level: f"{each.symbol}-{level}-{compiler_digest()}" for level in levels}
    found = {level: code for level, name in names.items() if (code := cache.read(name)) is not None}
    if lacking := [level for level in levels if level not in found]:
        from obseq.compilation import numba_compiler

        new = numba_compiler.compile_for(each.function, each.signature, each.symbol, lacking)
        for level, code in new.items():
            cache.write(names[level], code)
        found |= new
    return found


@functools.cache
def compiler_digest() -> str:
    """Digest of the files that compile: with others of them, objects are others too."""
    files = sorted(Path(objects.__file__).parent.glob("*.py"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()[:DIGITS]


def build(choice: Choice, target: Path, jobs: int) -> list[Path]:
    """Makes the library for each kind of processor, in a folder."""
    target.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for level in choice.levels:
            (folder / level).mkdir()
        with ProcessPoolExecutor(jobs) as pool:
            for work in [pool.submit(emit, choice, part, jobs, folder) for part in range(jobs)]:
                work.result()
        return [link(folder / level, target / objects.path_of(level).name) for level in choice.levels]


def link(folder: Path, library: Path) -> Path:
    """Links the objects of a folder.

    Raises:
        RuntimeError: an object needs something that the run time does not have.
    """
    listed = folder / "inputs"
    listed.write_text("\n".join(str(path) for path in sorted(folder.glob("*.o"))), encoding="utf-8")
    options = ["-shared", "-s", "-nostartfiles", "-o", str(library), f"@{listed}", "-lm"]
    command = [os.environ.get("CC", "cc"), *options]
    subprocess.run(command, check=True)
    if foreign := needed(library) - FROM_C:
        raise RuntimeError(f"{library} needs {', '.join(sorted(foreign))}: a loop allocates or raises")
    return library


def needed(library: Path) -> set[str]:
    """What a library takes from others."""
    command = ["nm", "--dynamic", "--undefined-only", str(library)]
    listed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return {line.split()[-1].split("@")[0] for line in listed.splitlines() if line.split()[-2] == "U"}


def pure_wheel(folder: Path) -> Path:
    """Builds the wheel without objects."""
    options = ["--no-isolation", "--skip-dependency-check", "--wheel", "-o", str(folder), str(ROOT)]
    subprocess.run([sys.executable, "-m", "build", *options], check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    return wheel


def with_objects(wheel: Path, libraries: Sequence[Path], folder: Path) -> Path:
    """The platform wheel: the files of a pure one, and the libraries."""
    tag = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    target = folder / wheel.name.replace("-any.whl", f"-{tag}.whl")
    with zipfile.ZipFile(wheel) as source, zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as result:
        record = []
        for item in source.infolist():
            content = source.read(item)
            if item.filename.endswith(".dist-info/WHEEL"):
                content = content.replace(b"-none-any", f"-none-{tag}".encode())
                content = content.replace(b"Root-Is-Purelib: true", b"Root-Is-Purelib: false")
            if item.filename.endswith(".dist-info/RECORD"):
                place = item.filename
                continue
            result.writestr(item, content)
            record.append(line_of(item.filename, content))
        for library in libraries:
            name = f"obseq/compilation/objects/{library.name}"
            result.writestr(name, library.read_bytes())
            record.append(line_of(name, library.read_bytes()))
        result.writestr(place, "\n".join([*record, f"{place},,", ""]))
    return target


def line_of(name: str, content: bytes) -> str:
    """A line of a wheel's record."""
    digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
    return f"{name},sha256={digest},{len(content)}"


def main() -> int:
    """Reads the command line; lists the loops, or builds."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--list", action="store_true", help="print every loop with its signature")
    parser.add_argument("--into", type=Path, metavar="DIR", help="write the libraries into this folder")
    parser.add_argument("--wheel", type=Path, metavar="DIR", help="write a platform wheel into this folder")
    parser.add_argument("--formulas", nargs="*", metavar="NAME", help="kernels of these formulas only")
    parser.add_argument("--modules", nargs="*", metavar="NAME", help="loops of these modules only")
    parser.add_argument("--levels", nargs="+", metavar="LEVEL", help="kinds of processors (all)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    arguments = parser.parse_args()
    if arguments.list:
        for loop in loops():
            print(f"{loop.python.__module__}.{loop.name}{loop.routine.signature}")
        return 0
    levels = arguments.levels or list(objects.LEVELS.get(platform.machine(), {}))
    if not levels or not (arguments.into or arguments.wheel):
        parser.error("say --list, --into or --wheel; on a machine that objects can be made for")
    formulas = formula_names() if arguments.formulas is None else arguments.formulas
    modules = LOOPS if arguments.modules is None else arguments.modules
    choice = Choice(tuple(modules), tuple(formulas), tuple(levels))
    with tempfile.TemporaryDirectory() as temporary:
        libraries = build(choice, arguments.into or Path(temporary) / "objects", arguments.jobs)
        for library in libraries:
            print(f"{library.name}: {library.stat().st_size} bytes")
        if arguments.wheel:
            arguments.wheel.mkdir(parents=True, exist_ok=True)
            print(with_objects(pure_wheel(Path(temporary)), libraries, arguments.wheel))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
