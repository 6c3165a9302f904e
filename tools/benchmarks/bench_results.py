"""From files to results and page: CPU of each phase, peak memory by the operating system, sizes of files.

Each size is a process of its own, which runs `obseq adjust ... --out`. Memory is what the operating system
says of it in each phase, looked at fifty times a second, and its peak.

    python tools/benchmarks/bench_results.py --points 10000 30000 100000
    python tools/benchmarks/bench_results.py --points 30000 100000 --write     and in docs/scaling.md

With two quiet cores 100,000 points take a minute and a half.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from resource import RUSAGE_SELF, getrusage
from typing import TYPE_CHECKING, Any

from command import command_line, write_json
from scaling import PAGE, written

if TYPE_CHECKING:
    from collections.abc import Sequence

HERE = Path(__file__).resolve().parent
PER_POINT = 6
"""Observations of a point."""
FRAME = "RTL*657700*6860700*0*IGNF:LAMB93"
LOOK = 0.02


class Watch:
    """Seconds of the processor and most memory (MB) of each phase.

    Attributes:
        seconds: By phase.
        most: By phase.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.most: dict[str, float] = {}
        self._phase, self._begun = "load", time.process_time()
        threading.Thread(target=self._look, daemon=True).start()

    def progress(self, phase: str) -> None:
        """A phase begins; iterations belong to that of their name."""
        now, name = time.process_time(), str(phase).partition(":")[0]
        self.seconds[self._phase] = self.seconds.get(self._phase, 0.0) + now - self._begun
        self._phase, self._begun = name, now

    def _look(self) -> None:
        while True:
            size = int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6
            self.most[self._phase] = max(self.most.get(self._phase, 0.0), size)
            time.sleep(LOOK)


def measured(folder: Path) -> dict[str, object]:
    """The figures of the network in a folder; to be called once in a process."""
    watch = Watch()
    from obseq.cli.results import outputs_in, write
    from obseq.survey import Network

    watch.progress("read")
    network = Network.read(folder / "network.obs", folder / "network.cor", frame=FRAME, points_crs=FRAME)
    adjustment = network.adjust(progress=watch.progress)
    watch.progress("record")
    record = adjustment.record()
    del network, adjustment
    watch.progress("write")
    write(record, outputs_in(folder / "out"))
    watch.progress("end")
    sizes = {path.suffix: path.stat().st_size / 1e6 for path in sorted((folder / "out").iterdir())}
    peak = getrusage(RUSAGE_SELF).ru_maxrss / 1e3
    return {"seconds": watch.seconds, "most": watch.most, "peak": peak, "sizes": sizes}


def of_size(points: int) -> dict[str, object]:
    """The figures of a synthetic network, in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        made = [f"--points={points}", f"--observations={PER_POINT * points}", f"--out={folder}"]
        subprocess.run(
            [sys.executable, str(HERE / "make_network.py"), *made], check=True, capture_output=True
        )
        own = [sys.executable, str(HERE / "bench_results.py"), "--folder", folder]
        text = subprocess.run(own, check=True, capture_output=True, text=True).stdout
        return {"points": points, **json.loads(text)}


def told(figures: dict[str, object]) -> str:
    """The figures in lines."""
    seconds, most, sizes = figures["seconds"], figures["most"], figures["sizes"]
    assert isinstance(seconds, dict) and isinstance(most, dict) and isinstance(sizes, dict)
    whole = sum(seconds.values())
    lines = [f"{figures['points']} points: {whole:.1f} s of CPU, peak {figures['peak']:.0f} MB"]
    lines += [f"  {name:<28}{value:8.2f} s {most.get(name, 0.0):8.0f} MB" for name, value in seconds.items()]
    share = (seconds["record"] + seconds["write"]) / whole
    files = ", ".join(f"{suffix} {size:.1f} MB" for suffix, size in sizes.items())
    return "\n".join([*lines, f"  writing is {100.0 * share:.0f} % of it; {files}"])


def laws(found: Sequence[dict[str, Any]]) -> str:
    """Seconds and memory of each phase at all sizes; bytes a point, from the first size to the last."""
    sizes = [f"{one['points']:,}" for one in found]
    head = ["phase", *(f"{size}: CPU s" for size in sizes), *(f"{size}: MB" for size in sizes), "kB a point"]
    lines = [head, ["---"] * len(head)]
    whole = [
        {name: sum(one["seconds"].values()) if name else one["peak"] for name in (1, 0)} for one in found
    ]
    first, last = found[0], found[-1]
    more = (last["points"] - first["points"]) / 1e3
    for name in last["seconds"]:
        seconds, most = ([one[key].get(name, 0.0) for one in found] for key in ("seconds", "most"))
        law = f"{(most[-1] - most[0]) / more:.1f}"
        lines.append([name, *(f"{s:.1f}" for s in seconds), *(f"{m:,.0f}" for m in most), law])
    law = f"{(last['peak'] - first['peak']) / more:.1f}"
    lines.append(["all", *(f"{one[1]:.1f}" for one in whole), *(f"{one[0]:,.0f}" for one in whole), law])
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def main() -> None:
    """Prints the figures of each size."""
    options = command_line(__doc__)
    options.add_argument("--points", type=int, nargs="+", default=[10_000, 30_000])
    options.add_argument("--write", action="store_true", help="write the table in docs/scaling.md")
    options.add_argument("--json", type=Path, help="also the figures")
    options.add_argument("--folder", type=Path, help="measure the network in a folder (what a process runs)")
    given = options.parse_args()
    if given.folder:
        print(json.dumps(measured(given.folder)))
        return
    found = [of_size(points) for points in given.points]
    print("\n\n".join(map(told, found)))
    if given.write:
        page = written(PAGE.read_text("utf-8"), "results", laws(found), Path(__file__).name)
        PAGE.write_text(page, "utf-8")
    write_json(given.json, found)


if __name__ == "__main__":
    main()
