"""How often what is planted in networks and blocks is found, alone or among few, and what that costs.

Classes: mixed networks with none to three blunders of 5 to 10,000 detectable sigmas, or of 8; sites with one
slip of each kind; blocks without error, with one or two, with exchanged images, with control in another unit;
one block, of which an image point is displaced. Each seed is adjusted clean, and with the mistake: the ratio
of CPU seconds is that of the two.

| verdict | |
|---|---|
| exact | all mistakes are told first, nothing else is |
| in a set, in a large set | each is among at most three places, or more, that nothing tells apart |
| some | only a part is named, nothing right is accused |
| and more, wrong | something right is accused: beside all mistakes, or instead |
| missed, undecided | nothing is accused: quietly, or with the word that something is wrong |
| refused, crash | an error that says nothing of them; of any other kind than those of the package |

The rates of the present version are in `diagnosis.json`: 24 seeds of each class of networks and sites from
91000 on, 60 of blocks from 92000 on; of what has no error 667 seeds of each class from 93000 on.

Example:
    python tools/benchmarks/bench_diagnosis.py --first 1000 --json tools/benchmarks/diagnosis.json
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import statistics
import sys
import tempfile
import time
import zlib
from collections import Counter
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import diagnosis_blocks as blocks
import diagnosis_networks as networks
import diagnosis_slips as slips
import diagnosis_vectors as vectors
import numpy as np
from command import command_line, write_json
from diagnosis_records import of_block, of_refusal, of_survey
from diagnosis_verdicts import RIGHT, Found, has_cause, verdict_of

from obseq.errors import ObseqError, SingularSystemError
from obseq.formats.blocks.tables import BlockFiles
from obseq.images import BundleAdjustment
from obseq.images.diagnosing.diagnosis import diagnosed
from obseq.images.diagnosing.refusals import explained
from obseq.images.output.record import record_of
from obseq.survey import Network

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from diagnosis_verdicts import Fault

    Run = tuple[Found, Any]

Random = np.random.Generator

MOST = 10_000.0
"""Detectable sigmas of a blunder."""


@dataclass
class Rates:
    """What became of the seeds of one class.

    Attributes:
        verdicts: how often each was given.
        caused: how often the cause was told as well.
        has_causes: whether causes are asked for.
        ratios: CPU seconds over those of the same without error.
        seeds: by verdict, seeds of those that are not right.
        said: by seed, the errors of crashes.
    """

    verdicts: Counter[str] = field(default_factory=Counter)
    caused: int = 0
    has_causes: bool = False
    ratios: list[float] = field(default_factory=list)
    seeds: dict[str, list[int]] = field(default_factory=dict)
    said: dict[int, str] = field(default_factory=dict)

    def add(self, seed: int, verdict: str) -> None:
        """Counts a seed."""
        self.verdicts[verdict] += 1
        if verdict not in (*RIGHT, "quiet"):
            self.seeds.setdefault(verdict, []).append(seed)

    @property
    def count(self) -> int:
        """Seeds that were tried."""
        return sum(self.verdicts.values())

    @property
    def right(self) -> int:
        """How many were right: quiet, or named alone or among few."""
        return sum(self.verdicts[name] for name in (*RIGHT, "quiet"))

    def plain(self) -> dict[str, Any]:
        """As it is written."""
        table: dict[str, Any] = {"count": self.count, "right": self.right, "verdicts": dict(self.verdicts)}
        if self.has_causes:
            table["with cause"] = self.caused
        if self.ratios:
            table["cpu"] = [round(statistics.median(self.ratios), 2), round(_ninth(self.ratios), 2)]
        return table | ({"seeds": self.seeds} if self.seeds else {})


def _ninth(values: list[float]) -> float:
    return float(np.quantile(values, 0.9))


# Surveys


def _survey(folder: Path, survey: networks.Survey) -> Run:
    """Adjusts a survey by way of its files."""
    texts = survey.texts()
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    if "site.cor" not in texts:
        return of_survey(Network.read_project([folder / name for name in texts], **survey.options))
    books = [folder / name for name in texts if name.endswith(".obs")]
    return of_survey(Network.read(books, folder / "site.cor", **survey.options))


def _spoiled(survey: networks.Survey, random: Random, adjustment: Any, count: int, most: float) -> Any:
    observations = adjustment.record().observations
    redundancies = np.array([one.redundancy or 0.0 for one in observations])
    sigmas = np.array([one.sigma for one in observations])
    if not count:
        return survey, ()
    counted = int(random.integers(2, 4)) if count > 3 else count
    return networks.blunders(survey, random, redundancies, sigmas, counted, most)


# Blocks


def _block(folder: Path, given: blocks.Block) -> Run:
    """Adjusts a block by way of its tables."""
    for name, text in given.texts().items():
        (folder / name).write_text(text, encoding="utf-8")
    files = [folder / f"{name}.csv" for name in ("cameras", "images", "measures", "control")]
    block = BundleAdjustment()
    BlockFiles(files[0], files[1], [files[2]], [files[3]], blocks.SIGMA, None).fill(block)
    poses = block.poses
    try:
        with explained(block):
            block.initialise()
            solution = block.solve()
    except ObseqError as error:
        if (told := of_refusal(error)) is None:
            raise
        return told, None
    record = record_of(solution, diagnosis=diagnosed(solution, poses))
    return of_block(record), None


# Classes


@dataclass(frozen=True)
class Class:
    """Networks of one kind with mistakes of one kind.

    Attributes:
        made: the network without error.
        planted: that with mistakes, and these; None where a seed has no place for them.
        run: adjusts one.
        has_causes: whether the cause is asked for.
    """

    made: Callable[[Random], Any]
    planted: Callable[[Any, Random, Any], tuple[Any, tuple[Fault, ...]] | None]
    run: Callable[[Path, Any], Run]
    has_causes: bool = False


def _classes() -> Iterator[tuple[str, Class]]:
    counts = {"none": (0, MOST), "one": (1, MOST), "two": (2, MOST), "three": (3, MOST)}
    for name, (count, most) in {**counts, "two or three of 8": (4, 0.0)}.items():
        yield f"mixed: {name}", Class(networks.mixed, partial(_spoiled, count=count, most=most), _survey)
    yield "site: none", Class(networks.site, lambda survey, random, clean: (survey, ()), _survey)
    for name, slip in slips.SLIPS.items():
        yield f"site: {name}", Class(networks.site, partial(_slipped, slip), _survey, has_causes=True)
    yield "vectors: none", Class(vectors.vectors, lambda survey, random, clean: (survey, ()), _survey)
    for name, slip in vectors.SLIPS.items():
        yield f"vectors: {name}", Class(vectors.vectors, partial(_slipped, slip), _survey, has_causes=True)
    many = partial(networks.site, rounds=16)
    yield "site: constant below a sigma", Class(many, partial(_slipped, slips.below_a_sigma), _survey)
    yield "block: none", Class(blocks.block, lambda given, random, clean: (given, ()), _block)
    for name, mistake in blocks.MISTAKES.items():
        made = partial(blocks.block, has_poses=True if name in blocks.NEED_POSES else None)
        yield f"block: {name}", Class(made, partial(_slipped, mistake), _block)
    yield "first block: displaced", Class(_first, partial(_slipped, blocks.displaced), _block)


def _slipped(mistake: Callable[[Any, Random], Any], given: Any, random: Random, clean: Any) -> Any:
    return mistake(given, random)


def _first(random: Random) -> blocks.Block:
    return blocks.first_block()


CLASSES = dict(_classes())


def rates(name: str, seeds: Iterable[int]) -> Rates:
    """What becomes of the seeds of a class."""
    found = Rates(has_causes=CLASSES[name].has_causes)
    with tempfile.TemporaryDirectory() as folder:
        for seed in seeds:
            _try(name, seed, Path(folder), found)
    return found


def _try(name: str, seed: int, folder: Path, found: Rates) -> None:
    own = CLASSES[name]
    random = np.random.default_rng([seed, zlib.crc32(name.encode())])
    given = own.made(random)
    try:
        clean, before = _timed(own, folder, given)
    except SingularSystemError:  # what was drawn is no network: some others are as many
        return
    planted = own.planted(given, random, clean[1])
    if planted is None:
        return
    changed, faults = planted
    try:
        run, seconds = (clean, before) if changed is given else _timed(own, folder, changed)
    except Exception as error:
        found.add(seed, "refused" if isinstance(error, ObseqError) else "crash")
        found.said[seed] = f"{type(error).__name__}: {error}"
        return
    found.add(seed, verdict_of(run[0], faults))
    found.caused += bool(faults) and has_cause(run[0], faults)
    found.ratios += [seconds / before] if faults else []


def _timed(own: Class, folder: Path, given: Any) -> tuple[Run, float]:
    start = time.process_time()
    run = own.run(folder, given)
    return run, time.process_time() - start


def main() -> int:
    """Runs the bench and prints the table."""
    parser = command_line(__doc__)
    parser.add_argument("--seeds", type=int, default=60, help="of each class")
    parser.add_argument("--first", type=int, default=0, help="the first of them")
    parser.add_argument(
        "--only", nargs="*", default=[], metavar="WORD", help="classes with a word in their name"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures as JSON")
    arguments = parser.parse_args()
    table = {}
    for name in CLASSES:
        if arguments.only and not any(word in name for word in arguments.only):
            continue
        rates(name, [arguments.first])  # compiles and loads
        found = rates(name, range(arguments.first, arguments.first + arguments.seeds))
        table[name] = found.plain()
        cpu = " ".join(f"{ratio:5.1f}" for ratio in table[name].get("cpu", ()))
        cause = f"{found.caused:4}" if found.has_causes else "    "
        print(
            f"{name:26}{found.right:4} of{found.count:4}{cause}  {cpu:12} {dict(found.verdicts)}", flush=True
        )
        for seed, said in found.said.items():
            print(f"    {seed}: {said[:200]}")
    write_json(arguments.json, table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
