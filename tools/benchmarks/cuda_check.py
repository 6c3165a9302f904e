"""Runs the CUDA text of formulas on a device, and compares it with the kernels of numba.

Here, where obseq and nvcc are:

    python tools/benchmarks/cuda_check.py --prepare FOLDER

There, where a device is, with the folder and this file; it takes Python and the driver alone:

    python3 cuda_check.py --run FOLDER

Inputs and expected results are files of float64; kernels are PTX, which the driver compiles. The exit code
is 1 where a result differs by more than rounding.
"""

import argparse
import array
import ctypes
import json
import sys
from pathlib import Path
from time import perf_counter

NAMES = (
    "Dist3D",
    "TopoHz",
    "TopoDH",
    "TopoSubFrame",
    "Dir_FE_EquiDist",
    "EqLidarImCensus",
    "BlocRigid_RE",
    "EqColinearityCamPPC_Stenope_Dist_Rad3_Dec1_XY1",
)
ROWS = 1 << 18
DRAWN = 1 << 12
"""Rows that differ; they are repeated."""

RESIDUALS, JACOBIAN = 1e-12, 1e-9
"""Largest differences, relative to the size of inputs and of the row of the Jacobian."""

PTX_VERSION = ".version 7.0"
"""What the text of PTX asks of a driver: these kernels need nothing newer."""

THREADS = 256
REPEATS = 20


def prepare(folder: Path) -> None:
    """Writes the kernels, inputs, expected results and a list of them."""
    import re
    import shutil
    import subprocess

    import numpy as np

    from obseq.codegen.c99 import cuda
    from obseq.codegen.compiler import derive
    from obseq.codegen.modules import module_name
    from obseq.formulas import formula
    from obseq.kernels import calculator, derivatives

    folder.mkdir(parents=True, exist_ok=True)
    listed = []
    for name in NAMES:
        ours, identifier = calculator(name), module_name(name)
        source, ptx = folder / f"{identifier}.cu", folder / f"{identifier}.ptx"
        source.write_text(cuda(derive(formula(name))), "utf-8")
        subprocess.run([str(shutil.which("nvcc")), "-ptx", "-arch=compute_80", source, "-o", ptx], check=True)
        ptx.write_text(re.sub(r"\.version \d+\.\d+", PTX_VERSION, ptx.read_text("utf-8")), "utf-8")
        drawn = derivatives.draw(ours.kernel, DRAWN, np.random.default_rng(4))
        ours.values_and_jacobian(*drawn)  # loads it
        start = perf_counter()
        values, jacobian = ours.values_and_jacobian(*drawn)
        seconds = perf_counter() - start
        parts = {"unknowns": drawn[0], "observations": drawn[1], "residuals": values}
        parts["jacobian"] = jacobian.reshape(DRAWN, -1)
        for part, table in parts.items():
            np.ascontiguousarray(table.T).tofile(folder / f"{identifier}.{part}")
        sizes = {part: table.shape[1] for part, table in parts.items()}
        listed.append({"name": identifier, "seconds_here": seconds, **sizes})
    (folder / "list.json").write_text(json.dumps(listed, indent=1), "utf-8")


class Device:
    """The first device, by the driver."""

    def __init__(self) -> None:
        self.driver = ctypes.CDLL("libcuda.so.1")
        self.call("cuInit", 0)
        device, self.context = ctypes.c_int(), ctypes.c_void_p()
        self.call("cuDeviceGet", ctypes.byref(device), 0)
        name = ctypes.create_string_buffer(100)
        self.call("cuDeviceGetName", name, 100, device)
        self.name = name.value.decode()
        self.call("cuDevicePrimaryCtxRetain", ctypes.byref(self.context), device)
        self.call("cuCtxSetCurrent", self.context)

    def call(self, function: str, *arguments: object) -> None:
        """A call of the driver; what fails ends the program."""
        if code := getattr(self.driver, function)(*arguments):
            sys.exit(f"{function} failed with code {code}")

    def upload(self, numbers: array.array) -> ctypes.c_void_p:
        """A copy of numbers in the memory of the device."""
        place, (start, length) = ctypes.c_void_p(), numbers.buffer_info()
        size = max(length, 1) * numbers.itemsize
        self.call("cuMemAlloc_v2", ctypes.byref(place), ctypes.c_size_t(size))
        self.call(
            "cuMemcpyHtoD_v2", place, ctypes.c_void_p(start), ctypes.c_size_t(length * numbers.itemsize)
        )
        return place

    def download(self, place: ctypes.c_void_p, count: int) -> array.array:
        """Numbers from the memory of the device."""
        numbers = array.array("d", bytes(8 * count))
        start, _ = numbers.buffer_info()
        self.call("cuMemcpyDtoH_v2", ctypes.c_void_p(start), place, ctypes.c_size_t(8 * count))
        return numbers

    def function(self, ptx: bytes, name: str) -> ctypes.c_void_p:
        """A kernel of a text of PTX."""
        module, found = ctypes.c_void_p(), ctypes.c_void_p()
        self.call("cuModuleLoadData", ctypes.byref(module), ctypes.c_char_p(ptx))
        self.call("cuModuleGetFunction", ctypes.byref(found), module, name.encode())
        return found

    def launch(self, function: ctypes.c_void_p, places: list[ctypes.c_void_p], n: int) -> float:
        """Runs a kernel on n rows, several times; seconds of one time."""
        values = [*places, ctypes.c_longlong(n)]
        pointers = (ctypes.c_void_p * len(values))(*(ctypes.addressof(value) for value in values))
        grid = (n + THREADS - 1) // THREADS
        spent = []
        for _ in range(REPEATS):
            start = perf_counter()
            self.call("cuLaunchKernel", function, grid, 1, 1, THREADS, 1, 1, 0, None, pointers, None)
            self.call("cuCtxSynchronize")
            spent.append(perf_counter() - start)
        return min(spent)


def run(folder: Path) -> int:
    """Runs all kernels of a folder; 1 where one differs."""
    device = Device()
    print(f"{device.name}, {ROWS} rows")
    print(f"{'formula':<50} {'residuals':>10} {'Jacobian':>10} {'ns a row':>9} {'numba, one thread':>18}")
    bad = 0
    for entry in json.loads((folder / "list.json").read_text("utf-8")):
        name = entry["name"]
        given = [repeated(read(folder, name, part), entry[part]) for part in ("unknowns", "observations")]
        results = [array.array("d", bytes(8 * entry[part] * ROWS)) for part in ("residuals", "jacobian")]
        places = [device.upload(part) for part in (*given, *results)]
        function = device.function((folder / f"{name}.ptx").read_bytes() + b"\0", f"obseq_{name}")
        seconds = device.launch(function, places, ROWS)
        residuals = device.download(places[2], entry["residuals"] * ROWS)
        jacobian = device.download(places[3], entry["jacobian"] * ROWS)
        inputs = [0.0, *read(folder, name, "unknowns"), *read(folder, name, "observations")]
        size = 1.0 + max(map(abs, inputs))
        expected = read(folder, name, "residuals")
        off = worst(residuals, expected, entry["residuals"], [max(size, row) for row in sizes_of(expected)])
        expected = read(folder, name, "jacobian")
        largest = [row or 1.0 for row in sizes_of(expected)]
        turned = worst(jacobian, expected, entry["jacobian"], largest)
        mark = "" if off < RESIDUALS and turned < JACOBIAN else "  DIFFERS"
        bad += bool(mark)
        here = 1e9 * entry["seconds_here"] / DRAWN
        print(f"{name:<50} {off:>10.1e} {turned:>10.1e} {1e9 * seconds / ROWS:>9.2f} {here:>18.1f}{mark}")
    return 1 if bad else 0


def sizes_of(numbers: array.array) -> list[float]:
    """The largest number of each row, its size; 0 where none is a number."""
    rows = (numbers[row::DRAWN] for row in range(DRAWN))
    return [max((abs(value) for value in row if value == value), default=0.0) for row in rows]


def read(folder: Path, name: str, part: str) -> array.array:
    """The numbers of a file, column by column."""
    numbers = array.array("d")
    numbers.frombytes((folder / f"{name}.{part}").read_bytes())
    return numbers


def repeated(numbers: array.array, columns: int) -> array.array:
    """Columns of `ROWS` rows, in which those drawn come again."""
    whole = array.array("d")
    for k in range(columns):
        whole.extend(numbers[k * DRAWN : (k + 1) * DRAWN] * (ROWS // DRAWN))
    return whole


def worst(found: array.array, expected: array.array, columns: int, sizes: list[float]) -> float:
    """The largest difference over the size of its row; all rows that came again must be the same bits."""
    largest = 0.0
    for k in range(columns):
        first = found[k * ROWS : k * ROWS + DRAWN]
        if found[k * ROWS : (k + 1) * ROWS].tobytes() != first.tobytes() * (ROWS // DRAWN):
            return float("inf")
        for row, (a, b) in enumerate(zip(first, expected[k * DRAWN : (k + 1) * DRAWN], strict=True)):
            if a == a or b == b:  # where one of both is a number
                largest = max(largest, abs(a - b) / sizes[row] if a == a and b == b else float("inf"))
    return largest


def main() -> int:
    """Prepares or runs."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--prepare", type=Path, metavar="FOLDER")
    parser.add_argument("--run", type=Path, metavar="FOLDER")
    options = parser.parse_args()
    if options.prepare:
        prepare(options.prepare)
    return run(options.run) if options.run else 0


if __name__ == "__main__":
    sys.exit(main())
