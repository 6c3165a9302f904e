"""Mutated survey files: whatever they hold, they are refused in words or give a result that can be trusted.

A failure is anything else: another error than ours, more than `PATIENCE` seconds of computation, a number
that is not finite where the result says one, "converged" with precisions that are undefined. Each failure
is printed with its seed, which makes the same files again.

    python tools/benchmarks/fuzz_readers.py --start 0 --count 20000 --adjust 0.2
"""

import argparse
import hashlib
import logging
import math
import pickle
import random
import re
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from obseq.errors import ObseqError
from obseq.records.adjustment import AdjustmentRecord
from obseq.report.adjusted import outcome as told_of
from obseq.report.page import page
from obseq.report.result_file import to_json
from obseq.report.summary import listing, summary
from obseq.survey import Network, PointFileOptions

PATIENCE = 30
READABLE = 11
"""A seed whose network is adjusted."""
FRAMES = (None, "Local", "RTL*2.4*48.8*0*EPSG:4326", "RTL*0*48.8*0*+proj=latlong +datum=WGS84")
SIZES = ("x", "y", "z")
_OUTCOMES: dict[bytes, str] = {}
"""What adjustments came to, by all that a network is: many mutations change nothing that is read."""

OBS = """* a network
#FIX
5 A B 100 0.001
#VERT
7 A B 0 0.001
6 A P 98.5 0.001
3 A P 55.2 0.002
5 A P -40.62 0.001
5 A Q -61 0.001
7 P A 12 0.001
5 P B 77 0.001
5 P C 230 0.001
6 P C 101 0.001
4 A Q 0.25 0.001
3 Q A 20 0.01 * remark
3 Q B 90 0.01
#BASC
14 R A 10 0.01
15 R A 20 0.01
16 R A 1 0.01
14 R B 110 0.01
15 R B 20 0.01
16 R B -1 0.01
14 R C 50 0.01
15 R C 110 0.01
16 R C 2 0.01
#NEW
5 P Q 3 -0.001
"""
CONSISTENT = """7 A B 100 0.001
3 A P 50 0.002
5 A P 40.9666 0.001
6 A P 100 0.001
3 B P 76.1577 0.002
3 C P 51.9615 0.002
4 A P 0 0.002
3 A Q 70.7107 0.002
3 B Q 70.7107 0.002
3 C Q 41.2311 0.002
4 B Q 1 0.002
6 A Q 99.1 0.001
"""
COR = """* points
1 A 0 0 10 0.001 0.001 0.001
1 B 100 0 12 0.001
1 C 40 90 15 0 0 -1 remark
0 D 5 5 5
"""
PLAIN = (
    "#VERT #BASC #FIX #NEW 5 7 3 4 6 14 16 11 A B P -1 0 1 2 100 200 300 0.5 0.0 -0.0 * # , 1e9 -400 400 nan "
    "inf 1e-320 1e-13 1e-9 1e8 0x10 1_0 \u00e9 \u0663 \ufeff \u202e \x1b[2J"
)
WORDS = (*PLAIN.split(), "\x0b", "9" * 400, "x" * 300)


def mutated(text: str, chance: random.Random) -> bytes:
    """The text with a few words, lines or bytes exchanged, repeated, dropped or invented."""
    lines = text.split("\n")
    for _ in range(chance.randint(1, 6)):
        row = chance.randrange(len(lines))
        lines[row] = " ".join(_mutated_line(lines, row, chance))
    data = bytearray("\n".join(lines).encode())
    if data and chance.random() < 0.2:
        data[chance.randrange(len(data))] = chance.randrange(256)
    if data and chance.random() < 0.02:
        del data[chance.randrange(len(data)) :]
    return bytes(data)


def _mutated_line(lines: list[str], row: int, chance: random.Random) -> list[str]:
    words, action = lines[row].split(" "), chance.randrange(7)
    if action == 0:
        words[chance.randrange(len(words))] = chance.choice(WORDS)
    elif action == 1:
        words.insert(chance.randrange(len(words) + 1), chance.choice(WORDS))
    elif action == 2:
        words.pop(chance.randrange(len(words)))
    elif action == 3:
        lines.insert(chance.randrange(len(lines)), lines[row])
    elif action == 4:
        words = []
    elif action == 5:
        words[-1] = lines[chance.randrange(len(lines))].split(" ")[-1]
    else:
        _change_digit(words, chance)
    return words


def _change_digit(words: list[str], chance: random.Random) -> None:
    k = chance.randrange(len(words))
    digits = [place for place, c in enumerate(words[k]) if c.isdigit()]
    if digits:
        place = chance.choice(digits)
        words[k] = words[k][:place] + chance.choice("0123456789.-e") + words[k][place + 1 :]


def rewrite(path: Path, data: bytes) -> None:
    """Writes a file that may be there already, as a new one: to overwrite it waits for the disk."""
    path.unlink(missing_ok=True)
    path.write_bytes(data)


def write_case(folder: Path, seed: int) -> random.Random:
    """Write the files of one case, `n.obs` and `n.cor`; what follows of its chance is for its options."""
    chance = random.Random(seed)
    obs, cor = chance.choice((OBS, CONSISTENT)), COR
    rewrite(folder / "n.obs", mutated(obs, chance) if chance.random() < 0.8 else obs.encode())
    rewrite(folder / "n.cor", mutated(cor, chance) if chance.random() < 0.5 else cor.encode())
    return chance


def outcome(folder: Path, seed: int, adjusts: float) -> str:
    """What a case comes to: "refused", "read", or "adjusted".

    Args:
        folder: where its files are written.
        seed: of the case.
        adjusts: share of the networks that are adjusted, not only read.

    Raises:
        AssertionError: the result cannot be trusted.
    """
    chance = write_case(folder, seed)
    options = {"frame": chance.choice(FRAMES), "point_sigma": chance.choice((None, 0.01, 1.0))}
    if chance.random() < 0.1:
        options |= {"point_format": chance.choice(("ANXYZBla", "ANXYZ", "A N X Y Z Sx Sy Sz"))}
        options |= {"point_options": PointFileOptions(comment="*")}
    try:
        network = Network.read(folder / "n.obs", folder / "n.cor", **options)
    except ObseqError as error:
        check_message(str(error))
        return "refused"
    return "read" if chance.random() >= adjusts else adjusted(network)


def adjusted(network: Network) -> str:
    """What an adjustment comes to: "refused" or "adjusted"; looked at once where all is the same.

    Raises:
        AssertionError: the result cannot be trusted.
    """
    key = hashlib.blake2b(pickle.dumps(replace(network, phases={}))).digest()
    if key not in _OUTCOMES:
        _OUTCOMES[key] = _looked_at(network)
    return _OUTCOMES[key]


def _looked_at(network: Network) -> str:
    try:
        record = network.adjust().record()
    except ObseqError as error:
        check_message(str(error))
        return "refused"
    check_result(record)
    return "adjusted"


def check_message(text: str) -> None:
    """A message can be written anywhere, and read by a person."""
    text.encode("utf-8")
    assert 0 < len(text) < 20_000, f"a message of {len(text)} characters"


def check_result(record: AdjustmentRecord) -> None:
    """Numbers are finite, and precisions are defined where the result says that it converged.

    A coordinate that nobody gave and nothing observes is unknown, and so is its precision.
    """
    for point in record.points:
        known = [axis for axis in SIZES if getattr(point, axis) is not None]
        assert known, f"nothing of {point.name} is known"
        for name in (*known, *(f"crs_{axis}" for axis in SIZES if len(known) == len(SIZES))):
            value = getattr(point, name)
            assert value is not None and math.isfinite(value), f"{name} of {point.name} is {value}"
        for axis in SIZES if record.converged else ():
            sigma = getattr(point, f"s{axis}")
            if axis in known:
                assert sigma is not None and math.isfinite(sigma), f"precision of {point.name} is {sigma}"
            else:
                assert sigma is None, f"precision of {point.name}, which is unknown, is {sigma}"
    for row in record.observations:
        assert not row.active or row.residual is not None, f"no residual of {row.type} line {row.line}"
    if record.converged and record.redundancy > 0:
        assert record.sigma0 is not None, "converged without sigma0"
    assert record.redundancy >= 0, f"redundancy {record.redundancy}"
    told = told_of(record)
    written = {"listing": listing(told), "summary": summary(told), "page": page(record)}
    for name, text in (written | {"result file": to_json(record)}).items():
        assert text.replace("\n", "").isprintable(), f"{name}: unprintable"
        shown = re.sub("<script.*?</script>", "", text, flags=re.DOTALL)
        found = "nan" in shown.replace(" nan ", " ").lower().split()
        assert not found or has_nan(record), f"{name}: nan"


def has_nan(record: AdjustmentRecord) -> bool:
    """Whether some name is "nan", as mutations make it."""
    names = [point.name for point in record.points] + [item.name for item in record.left_out]
    return any("nan" in name.lower() for name in names)


@contextmanager
def patience(seconds: int) -> Iterator[None]:
    """Raises TimeoutError in a block that computes for longer, whatever else the machine does."""

    def stop(*_: object) -> None:
        raise TimeoutError(f"more than {seconds} seconds")

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def judged(name: str, work: Callable[[], str], counts: Counter[str]) -> str | None:
    """Counts what a case comes to; what is wrong with it, in a few lines, None when nothing is."""
    try:
        with patience(PATIENCE):
            counts[work()] += 1
    except Exception as error:
        counts["failed"] += 1
        where = traceback.extract_tb(error.__traceback__)[-1]
        return f"{name}: {type(error).__name__}: {error} ({where.filename}:{where.lineno})"
    return None


def failure(folder: Path, seed: int, adjusts: float, counts: Counter[str]) -> str | None:
    """What is wrong with a case, in a few lines; None when nothing is."""
    return judged(f"seed {seed}", lambda: outcome(folder, seed, adjusts), counts)


def asked() -> argparse.Namespace:
    """What the command line asks for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--start", type=int, default=0, help="first seed (%(default)s)")
    parser.add_argument("--count", type=int, default=2000, help="how many cases (%(default)s)")
    parser.add_argument("--adjust", type=float, default=1.0, help="share of networks to adjust (%(default)s)")
    return parser.parse_args()


def main() -> int:
    """Run the cases, print failures and counts; 1 when something failed."""
    options = asked()
    counts: Counter[str] = Counter()
    logging.disable(logging.WARNING)  # gross errors are announced, and mutations are little else
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        outcome(Path(folder), READABLE, 1.0)  # compiles what is not compiled yet, without a limit of time
        for seed in range(options.start, options.start + options.count):
            if found := failure(Path(folder), seed, options.adjust, counts):
                print(found, flush=True)
    print(f"{dict(counts)} in {time.perf_counter() - begin:.0f} s")
    return 1 if counts["failed"] else 0


if __name__ == "__main__":
    sys.exit(main())
