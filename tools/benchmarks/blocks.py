"""Systems in blocks beside one machine: processor, memory, disk, equality, and what is larger on paper.

    python tools/benchmarks/blocks.py                             all tables, on the screen
    python tools/benchmarks/blocks.py --write                     and in docs/scaling.md, between its marks
    python tools/benchmarks/blocks.py --points 10000 --images 100 --kill

Each run is a process of its own; its peak of memory is that of the operating system. With two workers of
Dask, `--kill` kills one of them in each phase, and the process that asked, which is taken up. A network is
that of `bench_network.py`. An image block has 80 % of overlap along and 60 % across, tie points in up to five
images, one self-calibrating camera.
"""

from __future__ import annotations

import json
import math
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from bal import camera_kernel, projected
from bench_network import survey
from command import command_line
from scaling import written

from obseq.geometry import exponential
from obseq.leastsquares import Blocks, LeastSquares, reliability
from obseq.leastsquares.analysis import Analyses
from obseq.leastsquares.blocks.partition import ROOM, Tree
from obseq.leastsquares.sparse import Sparse
from obseq.leastsquares.statistics.final_state import final_state

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

PAGE = Path(__file__).resolve().parents[2] / "docs" / "scaling.md"
POINTS, IMAGES = (10_000, 100_000), (100, 400)
WAYS = ("at once", "8 parts", "2 workers")
KILLED, STOPPED, RESUMED = "2 workers, killed", "2 workers, client killed", "2 workers, resumed"
HEIGHT, BASE, STRIP, HALF, RAYS, TIED = 1000.0, 200.0, 400.0, 500.0, 5, 250
PAPER = {"survey": (1_000_000, 10_000_000), "flight": (10_000, 100_000)}

CONTROLLED = 0.01
"""Redundancy from which on tests are compared: below, its rounding is that of the test."""

Figures = dict[str, Any]


def flight(n_images: int) -> LeastSquares:
    """A block of images over flat ground; one point in fifty is known to two centimetres."""
    rng, side = np.random.default_rng(0), math.ceil(math.sqrt(n_images))
    along, across = np.divmod(np.arange(n_images), side)
    centres = np.column_stack([along * BASE, across * STRIP, np.full(n_images, HEIGHT)])
    turns = rng.normal(0.0, 0.02, (n_images, 3))
    shifts = -np.einsum("nij,nj->ni", exponential(turns), centres)
    cameras = np.column_stack([turns, shifts, np.tile([1000.0, -0.02, 0.005], (n_images, 1))])
    top = centres[:, :2].max(axis=0)
    ground = np.column_stack(
        [rng.uniform(0.0, top, (TIED * n_images, 2)), rng.uniform(0, 80, TIED * n_images)]
    )
    image, point = _seen(ground, side, n_images, rng)
    pixels = projected(cameras[image], ground[point]) + rng.normal(0.0, 0.5, (len(point), 2))
    return _block(cameras, ground, image, point, pixels, rng)


def _seen(
    ground: np.ndarray, side: int, n_images: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Image and point of each measure: up to five of the images that see a point."""
    reach = int(HALF / BASE)
    first = np.rint(ground[:, 0] / BASE).astype(int), np.rint(ground[:, 1] / STRIP).astype(int)
    steps = np.array([(a, b) for a in range(-reach, reach + 1) for b in (-1, 0, 1)])
    chosen = np.argsort(rng.random((len(ground), len(steps))), axis=1)[:, : RAYS + 2]
    rows, columns = first[0][:, None] + steps[chosen, 0], first[1][:, None] + steps[chosen, 1]
    image = rows * side + columns
    there = (rows >= 0) & (columns >= 0) & (columns < side) & (image < n_images)
    point = np.broadcast_to(np.arange(len(ground))[:, None], image.shape)
    return image[there], point[there]


def _block(*given: Any) -> LeastSquares:
    """The system of cameras, ground, and measures."""
    cameras, ground, image, point, pixels, rng = given
    system = LeastSquares()
    names = [f"image {k}" for k in range(len(cameras))]
    start = cameras[:, :3] + rng.normal(0.0, 1e-4, (len(cameras), 3))
    turns = system.add_rotations(names, exponential(start).transpose(0, 2, 1))
    shifts = system.add_points([f"{name} T" for name in names], cameras[:, 3:6])
    interior = system.add_vectors(["camera"], cameras[:1, 6:] + [[1.0, 0.0, 0.0]], ["f", "k1", "k2"])
    points = system.add_points([f"P{k}" for k in range(len(ground))], ground)
    system.freeze(points[np.bincount(point, minlength=len(ground)) < 2])
    known = np.arange(0, len(ground), 50)
    system.add_prior(points[known], ground[known] + rng.normal(0.0, 0.02, (len(known), 3)), 0.02)
    blocks = {"rotation": turns[image], "translation": shifts[image], "point": points[point]}
    system.add(camera_kernel(), blocks | {"interior": np.repeat(interior, len(image))}, pixels, 0.5)
    return system


MADE = {"survey": lambda size: survey(size, 1), "flight": flight}


def killing(blocks: Blocks) -> None:
    """From now on a worker is killed that has begun with the first task of each phase."""
    workers, left = blocks.run._workers, {"prepare", "eliminate", "reduce", "expand", "invert"}
    submit = workers.submit

    def begun(function: Any, *arguments: Any) -> Any:
        future = submit(function, *arguments)
        if arguments[1].__name__ in left:
            left.remove(arguments[1].__name__)
            (process, *_) = workers._client.run(os.getpid, on_error="ignore").values() or (None,)
            if process is not None:
                print(f"{arguments[1].__name__}: a worker is killed", file=sys.stderr, flush=True)
                os.kill(process, signal.SIGKILL)
        return future

    workers.submit = begun  # type: ignore[method-assign]


def stopping(blocks: Blocks) -> None:
    """This process is killed when it has given away the first of the last tasks."""
    workers = blocks.run._workers
    submit = workers.submit

    def begun(function: Any, *arguments: Any) -> Any:
        if arguments[1].__name__ == "invert":
            os.kill(os.getpid(), signal.SIGKILL)
        return submit(function, *arguments)

    workers.submit = begun  # type: ignore[method-assign]


FAULTS = {KILLED: killing, STOPPED: stopping}


def alone(kind: str, size: int, way: str, file: Path) -> Figures:
    """One run: its figures; what it found goes into a file."""
    told: list[str] = []
    system, blocks = MADE[kind](size), None
    if way != "at once":
        count = int(way.split()[0])
        who = {"client": count} if "workers" in way else {"parts": count}
        work = file.parent if way in (STOPPED, RESUMED) else None
        blocks = Blocks(**who, work=work, resume=way == RESUMED, tell=told.append)
    if blocks is not None and way in FAULTS:
        FAULTS[way](blocks)
    system._analyses = Analyses(system.problem, blocks or "auto", 1)
    start, wall = spent(), time.perf_counter()
    result = system.solve(covariance=True)
    figures = {"cpu": spent() - start, "wall": time.perf_counter() - wall}
    quality = reliability(system, result)
    found = [result.state.values, result.cofactors.variances()]
    found += [
        np.concatenate([getattr(one, name).ravel() for one in quality.all]) for name in ("redundancy", "w")
    ]
    figures |= {"peak": peak(), "told": told, "iterations": len(result.iterations)}
    np.savez(file, *found, _last_places(system, result, quality))
    if blocks is not None:
        blocks.close()
    return figures


def _last_places(system: LeastSquares, result: Any, quality: Any) -> np.ndarray:
    """How far each test moves when all unknowns do, by one unit in their last place."""
    state, batches = final_state(system, result), system.problem.batches
    unit = np.spacing(np.abs(result.state.values))[state.equations.free.scalars]
    moved = []
    for batch in batches:
        rows = state.cluster_rows(batch)
        moved.append(Sparse(np.abs(rows.values), rows.columns, rows.starts, len(unit)) @ unit)
    shares = [np.sqrt(np.maximum(one.redundancy.ravel(), CONTROLLED)) for one in quality.all]
    return np.concatenate([one / share for one, share in zip(moved, shares, strict=False)])


def spent() -> float:
    """Seconds of the processor, of children that have ended too."""
    own, others = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return own.ru_utime + own.ru_stime + others.ru_utime + others.ru_stime


def peak() -> float:
    """MB of this process at most."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def run(kind: str, size: int, way: str, file: Path) -> Figures:
    """`alone`, in a process of its own; of what is resumed one before it is killed."""
    command = [sys.executable, __file__, "--alone", kind, str(size), way, str(file)]
    if way == RESUMED:
        stopped = subprocess.run([*command[:5], STOPPED, str(file)], check=False).returncode
        assert stopped == -signal.SIGKILL, stopped
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    found: Figures = json.loads(done.stdout.splitlines()[-1])
    return found


def apart(first: Path, second: Path) -> str:
    """Largest differences of unknowns, variances (a share), redundancies, tests; the unit of the last."""
    one, other = np.load(first), np.load(second)
    values, variances, redundancies, tests, units = ((one[key], other[key]) for key in one.files)
    free = variances[0] > 0.0
    share = np.abs(variances[1][free] / variances[0][free] - 1.0).max()
    seen = redundancies[0] > CONTROLLED
    tests = tests[0][seen], tests[1][seen]
    sizes = [np.nanmax(np.abs(a - b)) for a, b in (values, redundancies, tests)]
    return " ".join(f"{size:.0e}" for size in (sizes[0], share, *sizes[1:], units[0].max()))


def measured(kind: str, sizes: Sequence[int], ways: Sequence[str]) -> tuple[str, dict[int, Figures]]:
    """The table of a kind; of each size, the figures of the last way in parts."""
    runs: dict[int, Figures] = {}
    apart_of = "unknowns, variances, redundancies, tests apart; unit of the tests"
    head = [kind, "way", "CPU s", "times", "peak MB", apart_of]
    lines = [head, ["---"] * len(head)]
    for size in sizes:
        with tempfile.TemporaryDirectory() as folder:
            files = [Path(folder) / f"{k}.npz" for k in range(len(ways))]
            figures = [run(kind, size, way, file) for way, file in zip(ways, files, strict=True)]
            for way, one, file in zip(ways, figures, files, strict=True):
                if way.endswith("parts"):
                    runs[size] = one
                times = one["cpu"] / figures[0]["cpu"]
                differences = "" if way == ways[0] else apart(files[0], file)
                cells = [
                    f"{size:,}",
                    way,
                    f"{one['cpu']:.1f}",
                    f"{times:.1f}",
                    f"{one['peak']:,.0f}",
                    differences,
                ]
                lines.append(cells)
                print(*cells, *one["told"], sep=" | ", file=sys.stderr, flush=True)
    return table(lines), runs


def table(lines: Sequence[Sequence[str]]) -> str:
    """A table in Markdown."""
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def laws(kind: str, runs: dict[int, Figures]) -> dict[str, tuple[float, float]]:
    """Of what a tree and a run say of a size: value at the largest one, and exponent; of a separator 0.5."""
    first, last = min(runs), max(runs)
    found = [forecast(kind, size) | {"cpu": runs[size]["cpu"]} for size in (first, last)]
    powers = {key: math.log(found[1][key] / found[0][key]) / math.log(last / first) for key in found[0]}
    return {key: (found[1][key], power) for key, power in (powers | {"root": 0.5}).items()}


def head_of(size: int, runs: dict[int, Figures]) -> float:
    """MB of the process that asks: so many for each point or image, from the smallest run to the largest."""
    first, last = min(runs), max(runs)
    slope = (runs[last]["peak"] - runs[first]["peak"]) / (last - first)
    return float(runs[last]["peak"] + slope * (size - last))


def forecast(kind: str, size: int) -> dict[str, float]:
    """Bytes of matrix and factor, unknowns that go up to the last part, operations: by symbolic analysis."""
    pattern = MADE[kind](size).equations().pattern
    tree = Tree(pattern)
    parts = tree.parts(tree.factor / 8)
    root = max(len(part.outer) for part in parts.parts)
    return {
        "matrix": 8.0 * pattern.nnz,
        "factor": float(tree.factor),
        "root": float(root),
        "flops": tree.operations,
    }


def on_paper(kinds: dict[str, dict[int, Figures]]) -> str:
    """What larger systems take, by laws from the smallest to the largest size that was run."""
    head = ["", "matrix GB", "factor GB", "root", "10^12 operations", "parts of 8 GB"]
    head += ["CPU h", "disk GB an iteration", "head GB"]
    lines = [head, ["---"] * len(head)]
    for kind, runs in kinds.items():
        found, last = laws(kind, runs), max(runs)
        for size in (last, *PAPER[kind]):
            of = {key: value * (size / last) ** power for key, (value, power) in found.items()}
            matrix, factor = of["matrix"] / 1e9, of["factor"] / 1e9
            parts = max(1, math.ceil(ROOM * factor / 8.0))
            through = 2.0 * matrix + 3.0 * factor
            numbers = (matrix, factor, of["root"], of["flops"] / 1e12, parts, of["cpu"] / 3600.0, through)
            cells = [f"{number:,.3g}" for number in (*numbers, head_of(size, runs) / 1e3)]
            lines.append([f"{kind} {size:,}", *cells])
    return table(lines)


def arguments() -> argparse.Namespace:
    """What the command line asks for."""
    parser = command_line(__doc__)
    parser.add_argument("--points", type=int, nargs="*", default=POINTS)
    parser.add_argument("--images", type=int, nargs="*", default=IMAGES)
    parser.add_argument("--ways", nargs="+", default=WAYS)
    parser.add_argument(
        "--kill", action="store_true", help="also with workers, and a client, that are killed"
    )
    parser.add_argument("--write", action="store_true", help="write the tables in docs/scaling.md")
    parser.add_argument("--alone", nargs=4, metavar=("KIND", "SIZE", "WAY", "FILE"))
    return parser.parse_args()


def main() -> None:
    """Measures, prints, writes."""
    options = arguments()
    if options.alone:
        kind, size, way, file = options.alone
        print(json.dumps(alone(kind, int(size), way, Path(file))))
        return
    ways = [*options.ways, *([KILLED, RESUMED] if options.kill else [])]
    kinds = {"survey": sorted(options.points), "flight": sorted(options.images)}
    kinds = {kind: sizes for kind, sizes in kinds.items() if sizes}
    found = {kind: measured(kind, sizes, ways) for kind, sizes in kinds.items()}
    tables = {"blocks": "\n\n".join(text for text, _ in found.values())}
    if laws_of := {kind: runs for kind, (_, runs) in found.items() if len(runs) > 1}:
        tables["paper"] = on_paper(laws_of)
    page = PAGE.read_text("utf-8")
    for name, text in tables.items():
        print(text, flush=True)
        page = written(page, name, text, Path(__file__).name) if options.write else page
    PAGE.write_text(page, "utf-8")


if __name__ == "__main__":
    main()
