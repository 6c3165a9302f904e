"""Mutated files of image readers: whatever they hold, they are read or refused in words that name the file.

A failure is anything else: another error than ours, a message that cannot be written, more than `PATIENCE`
seconds. Each is printed with its kind and its seed, which makes the same files again.

    python tools/benchmarks/fuzz_blocks.py --start 0 --count 20000
"""

import random
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

from block_seeds import seeds
from command import command_line
from fuzz_readers import check_message, mutated, patience

from obseq.errors import ObseqError

PATIENCE = 20
WORDS = (
    b"nan",
    b"1e400",
    b"-1",
    b"0",
    b"",
    b"<",
    b">",
    b"&x;",
    b'"',
    b"[",
    b"{",
    b"null",
    b"1e-320",
    b"\xff",
    b"\0",
)


def broken(data: bytes, chance: random.Random) -> bytes:
    """Bytes with some of them exchanged, dropped, repeated or put in; of texts, words and lines too."""
    if chance.random() < 0.4:
        try:
            return mutated(data.decode("utf-8"), chance)
        except UnicodeDecodeError:
            pass
    found = bytearray(data)
    for _ in range(chance.randint(1, 4)):
        place = chance.randrange(len(found) + 1)
        action = chance.randrange(4)
        length = chance.choice((1, 1, 2, 8, 40))
        if action == 0:
            found[place : place + length] = b""
        elif action == 1:
            found[place:place] = chance.choice(WORDS)
        elif action == 2:
            found[place : place + length] = bytes(chance.randrange(256) for _ in range(length))
        else:
            other = chance.randrange(len(found) + 1)
            found[place:place] = found[other : other + length]
    return bytes(found)


def outcome(folder: Path, kind: str, seed: Any, number: int) -> str:
    """What a case comes to: "refused" or "read".

    Raises:
        AssertionError: the message cannot be used.
    """
    files, reader = seed
    chance = random.Random(f"{kind} {number}")
    victims = chance.sample(sorted(files), chance.randint(1, len(files)))
    for name, data in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(broken(data, chance) if name in victims else data)
    try:
        reader(folder)
    except ObseqError as error:
        check_message(str(error))
        return "refused"
    finally:
        for name in files:
            (folder / name).unlink()
    return "read"


def failure(folder: Path, kind: str, seed: Any, number: int, counts: Counter[str]) -> str | None:
    """What is wrong with a case, in a few words; None when nothing is."""
    try:
        with patience(PATIENCE):
            counts[outcome(folder, kind, seed, number)] += 1
    except Exception as error:
        counts["failed"] += 1
        where = traceback.extract_tb(error.__traceback__)[-1]
        return f"{kind}, seed {number}: {type(error).__name__}: {error} ({where.filename}:{where.lineno})"
    return None


def write_whole(files: dict[str, bytes], place: Path) -> None:
    """Writes the files of a seed as they are."""
    for name, data in files.items():
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        (place / name).write_bytes(data)


def run(start: int, count: int) -> tuple[Counter[str], list[str]]:
    """Counts and failures of so many cases, shared by all kinds in turn."""
    kinds = seeds()
    counts: Counter[str] = Counter()
    failures = []
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("error")
        for kind, seed in kinds.items():
            files, reader = seed
            place = Path(folder) / kind
            write_whole(files, place)
            reader(place)  # whole, it is read; and what is compiled is compiled
        for number in range(start, start + count):
            kind = list(kinds)[number % len(kinds)]
            found = failure(Path(folder) / kind, kind, kinds[kind], number, counts)
            failures += [found] if found else []
    return counts, failures


def main() -> int:
    """Run the cases, print failures and counts; 1 when something failed."""
    parser = command_line(__doc__)
    parser.add_argument("--start", type=int, default=0, help="first seed (%(default)s)")
    parser.add_argument("--count", type=int, default=2000, help="how many cases (%(default)s)")
    options = parser.parse_args()
    begin = time.perf_counter()
    counts, failures = run(options.start, options.count)
    for line in failures:
        print(line)
    print(f"{dict(counts)} in {time.perf_counter() - begin:.0f} s")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
