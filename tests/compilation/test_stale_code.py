"""No stale machine code: a change of anything that a compiled function calls is seen, with a warm cache.

A copy of the package computes with one loop of each compiled room; then a constant is flipped in a
helper that the loop calls, in another file, and the loop must compute with the new one. The cache is that of
the user: after a first run of these tests it holds the code of both, as they must be kept apart.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
IGNORED = shutil.ignore_patterns("formulas", "codegen", "generated")

KERNEL_MODULES = tuple((ROOT / "generated").rglob("dir_equi_rect.py"))
KERNELS = """
import obseq
print(obseq.calculator("Dir_EquiRect").values([[0.5, 0.25, 0.25]], [[]]))
"""
LOOPS = """
import numpy as np
from obseq.kernels.layout import STRIDE
from obseq.leastsquares.loops.accumulation import gather_rows
tile = np.zeros(4 * STRIDE)
gather_rows(tile, 0, 4, np.arange(128.0), np.arange(0, 128, 4, dtype=np.uint32), 0)
print(tile.reshape(4, STRIDE)[:, :3])
"""
SPARSE = """
import numpy as np
from obseq.leastsquares.sparse import multiply
result = np.zeros((1, 2))
multiply(np.ones(1), np.zeros(1, np.int32), np.array([0, 1]), np.array([[3.0, 5.0]]), result)
print(result)
"""
SOLVERS = """
import numpy as np
from obseq.leastsquares.solvers.blas import routine_addresses
from obseq.leastsquares.solvers.numeric import factor_panel
panel = np.zeros(1)
factor_panel(panel, 0, 1, 1, np.zeros(1), np.zeros(1), 0, 1e-10, routine_addresses())
print(panel)
"""
STEPS = """
import numpy as np
from obseq.leastsquares.assembly.small_loops import MatrixRoom, Outcome, find_step
from obseq.leastsquares.loops.loop_arguments import Present, PriorArrays, UnknownPlaces
zero, one = np.zeros(1, np.int64), np.ones(1, np.int64)
room = MatrixRoom(zero, np.zeros((0, 4), np.int64), zero, np.zeros(1), np.zeros(1))
places = UnknownPlaces(zero, one, zero, zero, one, np.array([0, 1]))
priors = PriorArrays(zero, zero, np.array([3.0]), np.ones(1), zero)
found = Outcome(np.zeros(1), np.zeros((1, 1)), np.zeros(1), np.zeros(1), np.zeros(2))
present = Present(np.array([1.0, 0, 0, 0, 0]), np.zeros(4))
given = *room, *places, *priors, *present, zero, np.array([1e-10]), np.zeros(1)
find_step.builtin(np.array([4.0]), *given, *found)
print(found.step)
"""
TILES = """
import numpy as np
from obseq.kernels.layout import STRIDE
from obseq.kernels.tiles import fill_lanes
tiles = np.zeros(4 * STRIDE)
fill_lanes(tiles, 0, np.arange(128.0).reshape(32, 4), 0, 0)
print(tiles.reshape(4, STRIDE)[:, :3])
"""
LAYERS = """
import numpy as np
from obseq.targets.drawing.painting import Figure
from obseq.targets.drawing.rendering import Region, layers
figure = Figure(1.2, 2.0, 2.5, 0.0, True, True, False, False, True, 0.0, 0.0, 0.0, 0.0, 0.1)
region = Region(2.5, np.inf, False, 2.5, -2.5, 2.5, 9.0, 9.0, 9.0)
shares = np.empty((4 + 6, 12, 12))
layers(figure, 4, region, np.array([5.5, 5.5, 2.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0]), 2, shares)
print(shares.sum(axis=(1, 2)).tolist())
"""
SPOTS = """
import numpy as np
from obseq.targets.finding.light_spots import stand_out
rows, columns = np.mgrid[0:24.0, 0:24.0]
image, levels = np.exp(-((columns - 11.3) ** 2 + (rows - 12.6) ** 2) / 18.0), np.empty((1, 2))
stand_out(image, np.array([[11.3, 12.6, 4.0, 0.5, 3.0, 40.0]]), levels)
print(levels)
"""


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("copy")
    shutil.copytree(ROOT / "src" / "obseq", place / "obseq", ignore=IGNORED)
    for path in [
        ROOT / "generated" / "index.py",
        *(ROOT / "generated").rglob("__init__.py"),
        *KERNEL_MODULES,
    ]:
        target = place / "obseq" / path.relative_to(ROOT)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, target)
    return place


LENDER = """
import os, sys, numpy
for line in sys.stdin:
    program, output = line.rstrip("\\n").split("\\t")
    child = os.fork()
    if not child:
        for stream in (1, 2):
            os.dup2(os.open(output, os.O_WRONLY | os.O_CREAT | os.O_APPEND), stream)
        exec(compile(open(program).read(), program, "exec"), {})
        sys.exit()
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""
"""A process that has loaded NumPy, nothing of ours; it runs each program in a copy of itself."""


@pytest.fixture(scope="module")
def lender(copy: Path) -> Iterator[subprocess.Popen[str]]:
    """Waits for programs that import the copy; Python's own files of what changes in it are not kept."""
    environment = os.environ | {"PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1"}
    command, pipe = [sys.executable, "-c", LENDER], subprocess.PIPE
    with subprocess.Popen(command, env=environment, stdin=pipe, stdout=pipe, text=True) as process:
        yield process


def printed(lender: subprocess.Popen[str], copy: Path, *scripts: str) -> list[str]:
    """What each script prints, one after the other in a process that imports the copy."""
    assert lender.stdin is not None and lender.stdout is not None
    check = f"import obseq\nassert obseq.__file__.startswith({str(copy)!r})\n"
    program, output = copy / "program.py", copy / "output"
    program.write_text(check + f"print({BETWEEN!r}, end='')\n".join(scripts), encoding="utf-8")
    output.unlink(missing_ok=True)
    print(program, output, sep="\t", file=lender.stdin, flush=True)
    status = lender.stdout.readline()
    text = output.read_text(encoding="utf-8")
    assert status == "0\n", text
    return text.split(BETWEEN)


BETWEEN = "next script\n"
WITHOUT_COMPILER = "import sys\nsys.modules['numba'] = None\n"
TURNED = "(builder, a, b, [0, 4, 2, 6])", "(builder, a, b, [4, 0, 6, 2])"
CASES = {
    "leastsquares": (
        SPARSE,
        "leastsquares/sparse.py",
        "+= value * other[column, k]",
        "-= value * other[column, k]",
    ),
    "generated": (
        KERNELS,
        "kernels/functions.py",
        "HALF_PI_TAIL = 1.57",
        "HALF_PI_TAIL = 2.57",
    ),
    "kernels": (TILES, "kernels/vector_instructions.py", *TURNED),
    "leastsquares/assembly": (
        STEPS,
        "leastsquares/solvers/dense_loops.py",
        "x[right, j] = y / panels",
        "x[right, j] = 2.0 * y / panels",
    ),
    "leastsquares/loops": (LOOPS, "kernels/vector_instructions.py", *TURNED),
    "leastsquares/solvers": (
        SOLVERS,
        "leastsquares/solvers/dense_loops.py",
        "> 0.0 else 1.0",
        "> 0.0 else 2.0",
    ),
    "targets/drawing": (
        LAYERS,
        "targets/drawing/painting.py",
        "return min(math.floor(place), bits - 1)",
        "return max(min(math.floor(place), bits - 1) - 1, 0)",
    ),
    "targets/finding": (
        SPOTS,
        "targets/finding/detection.py",
        "(1.0 - y) * upper + y * lower",
        "(2.0 - y) * upper + y * lower",
    ),
}
"""Of each room with compiled functions: what it computes, a helper in another file, and a change in it."""


def test_every_compiled_room_has_a_case() -> None:
    package = ROOT / "src" / "obseq"
    with_loops = [path for path in package.rglob("*.py") if "\n@compiled" in path.read_text(encoding="utf-8")]
    rooms = {path.relative_to(package).parent.as_posix() for path in with_loops}
    assert {"generated"} | rooms - {"compilation"} == CASES.keys()


@pytest.mark.slow  # eight programs; at first two compilations of each loop
def test_a_change_in_what_is_called_is_seen(copy: Path, lender: subprocess.Popen[str]) -> None:
    """One change after the other is seen; what was compiled before is as good when all is as it was."""
    everything = [script for script, *_ in CASES.values()]
    first = printed(lender, copy, *everything)
    for place, (script, file, before, after) in enumerate(CASES.values()):
        path = copy / "obseq" / file
        text = path.read_text(encoding="utf-8")
        assert before in text
        path.write_text(text.replace(before, after), encoding="utf-8")
        assert printed(lender, copy, script) != [first[place]], file
        path.write_text(text, encoding="utf-8")
    assert printed(lender, copy, WITHOUT_COMPILER, *everything)[1:] == first
