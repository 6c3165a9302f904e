"""Mutated files of other programs (Comp3D, STAR*NET...): refused in words, or a result that can be trusted.

As `fuzz_readers.py`, for whatever `obseq adjust FILE` reads. Each case changes one file of a data set of
`../shared/data`, or of a format in `samples`, in a copy of its folder: words, lines or bytes.

    python tools/benchmarks/fuzz_projects.py --start 0 --count 20000 --adjust 0.02
"""

import logging
import random
import shutil
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import fuzz_readers as readers
from command import command_line
from field_books import FORMATS as FIELD_BOOKS
from field_books import write

from obseq.errors import ObseqError
from obseq.survey import Network

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
SAMPLES = Path(__file__).resolve().parent / "samples"
"""Small networks, one in each folder: Comp3D, Gama, DNA, DynaML, SINEX, STAR*NET, LandXML, SNAP, tables."""

SIGMAS = ["distance=3mm", "direction=5sec", "zenith=5sec", "azimuth=5sec", "height=2mm", "height-per-km=1mm"]
"""Standard deviations for files that have none."""

FOLDERS = ("comp3d-*", "gama-*", "dynadjust-*")
MAIN = (".comp", ".gkf", ".stn", ".snx", ".dat", ".xml", ".csv", ".snp")
"""Suffixes of the files that are given to the reader."""
TOGETHER = {".stn": (".stn", ".msr"), ".csv": (".csv", ".obs.csv")}
"""Suffixes of the files that are given together, by the first."""

LARGEST = 100_000
"""Bytes of a project beyond which it is no seed: mutations are many, and small files are quick."""


class Seed:
    """A project in a folder of its own.

    Attributes:
        folder: a copy of its files.
        paths: those that are given to the reader.
        sigmas: standard deviations that are given besides.
        points_crs: coordinate system that is given besides.
        texts: what each file held, by its path.
    """

    def __init__(self, main: Path, folder: Path) -> None:
        self.folder = folder
        shutil.copytree(main.parent, folder)
        main = folder / main.name
        found = TOGETHER.get(main.suffix, (main.suffix,))
        self.paths = [main.with_suffix(suffix) for suffix in found]
        self.sigmas = SIGMAS if main.stem in {"starnet", "landxml", "book"} else []
        self.points_crs = "EPSG:2154" if main.stem == "starnet-gnss" else None
        files = [main] if main.suffix == ".gkf" else [path for path in folder.rglob("*") if is_text(path)]
        self.texts = {path: path.read_bytes().decode("latin-1") for path in sorted(files)}

    def mutate(self, chance: random.Random) -> Path:
        """Changes one of the files, and returns it."""
        path = chance.choice(list(self.texts))
        path.write_bytes(readers.mutated(self.texts[path], chance))
        return path

    def restore(self, path: Path) -> None:
        """Writes a file as it was."""
        path.write_bytes(self.texts[path].encode("latin-1"))


def is_text(path: Path) -> bool:
    """Whether a file of a data set is one that a reader reads as text."""
    others = {".json", ".md", ".txt", ".gsb", ".py"}
    return path.is_file() and path.suffix not in others and path.stat().st_size > 0


def is_main(path: Path) -> bool:
    """Whether a file is the first one that is given to the reader."""
    return path.suffix in MAIN and not path.name.endswith(".obs.csv")


def field_books(folder: Path) -> list[Path]:
    """The simulated job as a field book of each format, in a folder of its own."""
    with tempfile.TemporaryDirectory() as written:
        write(Path(written))
        found = []
        for name in FIELD_BOOKS:
            (folder / name).mkdir(parents=True)
            made = shutil.copy(Path(written) / name, folder / name / f"book{Path(name).suffix}")
            found.append(Path(made))
    return found


def seeds(folder: Path, only: str = "*") -> list[Seed]:
    """The small projects of the data sets, the samples and the field books, copied to a folder."""
    mains = [path for name in FOLDERS for path in sorted(DATA.glob(f"{name}/*")) if is_main(path)]
    mains += [path for path in sorted(SAMPLES.glob("*/*")) if is_main(path) and path.stem == path.parent.name]
    mains += field_books(folder / "books")
    chosen = [main for main in mains if main.match(only)]
    found = [Seed(main, folder / str(number)) for number, main in enumerate(chosen)]
    return [seed for seed in found if sum(map(len, seed.texts.values())) <= LARGEST]


def outcome(seed: Seed, chance: random.Random, adjusts: float) -> str:
    """What a case comes to: "refused", "read", or "adjusted".

    Raises:
        AssertionError: the result cannot be trusted.
    """
    try:
        network = Network.read_project(
            seed.paths, encoding="latin-1", sigmas=seed.sigmas, points_crs=seed.points_crs
        )
    except ObseqError as error:
        readers.check_message(str(error))
        return "refused"
    return "read" if chance.random() >= adjusts else readers.adjusted(network)


def failure(found: list[Seed], number: int, adjusts: float, counts: Counter[str]) -> str | None:
    """What is wrong with a case, in a few lines; None when nothing is."""
    chance = random.Random(number)
    seed = chance.choice(found)
    path = seed.mutate(chance)
    said = readers.judged(
        f"seed {number} ({seed.paths[0].name})", lambda: outcome(seed, chance, adjusts), counts
    )
    seed.restore(path)
    return said


def main() -> int:
    """Run the cases, print failures and counts; 1 when something failed."""
    parser = command_line(__doc__)
    parser.add_argument("--start", type=int, default=0, help="first seed (%(default)s)")
    parser.add_argument("--count", type=int, default=2000, help="how many cases (%(default)s)")
    parser.add_argument("--adjust", type=float, default=0.1, help="share of networks to adjust (%(default)s)")
    parser.add_argument("--only", default="*", help="projects whose file has a name like this (%(default)s)")
    options = parser.parse_args()
    counts: Counter[str] = Counter()
    logging.disable(logging.WARNING)  # gross errors are announced, and mutations are little else
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        found = seeds(Path(folder), options.only)
        for number in range(options.start, options.start + options.count):
            if said := failure(found, number, options.adjust, counts):
                print(said, flush=True)
    print(f"{len(found)} projects: {dict(counts)} in {time.perf_counter() - begin:.0f} s")
    return 1 if counts["failed"] else 0


if __name__ == "__main__":
    sys.exit(main())
