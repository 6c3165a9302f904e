"""Random networks and blocks against an independent adjuster: do all numbers agree, in how many iterations?

The referee (tests/referee) is dense, shares nothing with obseq, and has exact derivatives. Each seed is one
network: its place, systems, size, kinds of observations, points and datum are drawn. Compared are
coordinates, sigma0, covariances of all pairs of coordinates, residuals, standardised residuals, redundancy
numbers and iterations. Good is what deviates by 1e-3 standard deviations and 1e-6 of redundancies at most,
and takes at most 3 iterations more than the referee's Gauss-Newton. What the referee finds undetermined is
counted, and so are right networks in which obseq announces gross errors. Counted apart is what the referee,
asked again, finds to be no disagreement: its own minimum was a higher one, two places fit as well, or what
obseq leaves out is uncertain by a hundredth of the size of the network. Blocks of images are judged alike:
control, lengths, rigid blocks, clinometers, surveys in them, free datums. `--held` takes networks on inner
constraints some coordinates of which are held; of the others of a seed it says "undetermined".

Example:
    python tools/benchmarks/bench_independent.py --networks 3000 --json done.json
    python tools/benchmarks/bench_independent.py --seeds 57 1234
    python tools/benchmarks/bench_independent.py --blocks --networks 500
    python tools/benchmarks/bench_independent.py --held --first 20000 --networks 420
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))

from command import command_line, write_json
from referee.generated_blocks import block_case
from referee.generated_networks import case, held_case
from referee.judged import judge
from referee.judged_blocks import judge_block

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Iterable

    from referee.generated_networks import Case

Figures = dict[str, Any]
SIZES = ("coordinates", "sigma0", "covariances", "residuals", "standardised", "inner", "redundancies")


def network_figures(seed: int, folder: Path) -> Figures:
    """What is said of one network."""
    return _of_network(case(seed), folder)


def held_figures(seed: int, folder: Path) -> Figures:
    """What is said of one network on inner constraints, coordinates of which are held."""
    made = held_case(seed)
    if made is None:
        return _figures(seed, None, {"dialect": "", "place": "", "is_inner": True})
    return _of_network(made, folder)


def _of_network(made: Case, folder: Path) -> Figures:
    verdict = judge(made, folder)
    about = {"dialect": made.dialect, "place": made.place, "is_inner": made.network.inner is not None}
    return _figures(made.seed, verdict, about)


def block_figures(seed: int, folder: Path) -> Figures:
    """What is said of one block."""
    made = block_case(seed)
    verdict = judge_block(seed, made, folder)
    parts = {"survey": made.observations, "rig": made.pairs, "clinometers": made.clinometers}
    about = {"dialect": "block", "place": " ".join(name for name, part in parts.items() if part)}
    return _figures(seed, verdict, about | {"is_inner": made.inner is not None})


def _figures(seed: int, verdict: Any, about: Figures) -> Figures:
    if verdict is None:
        return {"seed": seed, "is_undetermined": True, **about}
    return asdict(verdict) | about | {"is_good": verdict.is_good}


def judged(
    figures: Callable[[int, Path], Figures], seeds: Iterable[int], done: dict[int, Figures], path: Path | None
) -> dict[int, Figures]:
    """The figures of some seeds, those that were done before as they are."""
    with tempfile.TemporaryDirectory() as folder:
        for number, seed in enumerate(seeds):
            if seed not in done:
                done[seed] = figures(seed, Path(folder))
                if done[seed].get("is_good") is False:
                    print(line(done[seed]), flush=True)
            if path and number % 100 == 99:
                write_json(path, list(done.values()))
    write_json(path, list(done.values()))
    return done


def line(found: Figures) -> str:
    """One network in words."""
    datum = "inner" if found["is_inner"] else ""
    where = f"{found['seed']:6d} {found['dialect']:6s} {found['place']:14s} {datum}"
    if found.get("is_undetermined") or found["apart"]:
        return f"{where} {found.get('apart') or 'undetermined'}"
    sizes = " ".join(f"{name[:5]} {found[name]:.0e}" for name in SIZES)
    return f"{where} {found['said'] or sizes}; iterations {found['iterations']}{found['more']:+d}"


def grouped(kept: list[Figures]) -> dict[str, list[Figures]]:
    """Networks by dialect, by what is special about their place, and by datum."""
    groups: dict[str, list[Figures]] = {"all": kept}
    for item in kept:
        groups.setdefault(item["dialect"], []).append(item)
        for word in ("pole", "survey"):
            if word in item["place"]:
                groups.setdefault(word, []).append(item)
        if item["is_inner"]:
            groups.setdefault("inner", []).append(item)
    return groups


def told(found: list[Figures]) -> None:
    """Prints rates and worst deviations."""
    determined = [item for item in found if not item.get("is_undetermined")]
    kept = [item for item in determined if not item["apart"]]
    for name, chosen in grouped(kept).items():
        print(f"{name:7s} {sum(item['is_good'] for item in chosen)} of {len(chosen)} agree")
    print(f"{len(found) - len(determined)} undetermined")
    print("apart:", {item["seed"]: item["apart"] for item in determined if item["apart"]})
    compared = [item for item in kept if not item["said"]]
    for name in SIZES:
        worst = max(compared, key=lambda item: item[name], default=None)
        if worst:
            print(f"worst {name}: {worst[name]:.1e} (seed {worst['seed']})")
    more = Counter(item["more"] for item in compared)
    print("iterations more than the referee's:", ", ".join(f"{k:+d}: {more[k]}" for k in sorted(more)))
    print("accused:", [item["seed"] for item in kept if item["accused"]])
    print("said:", Counter(item["said"].split(":")[0] for item in kept if item["said"]).most_common())


def asked() -> argparse.Namespace:
    """What the command line asks for."""
    parser = command_line(__doc__)
    parser.add_argument("--networks", type=int, default=300, help="how many seeds (default 300)")
    parser.add_argument("--blocks", action="store_true", help="blocks of images")
    parser.add_argument(
        "--held", action="store_true", help="networks with held coordinates, on inner constraints"
    )
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--seeds", type=int, nargs="+", help="these alone")
    parser.add_argument(
        "--json", type=Path, metavar="FILE", help="figures by seed; what is there is not done again"
    )
    return parser.parse_args()


def main() -> int:
    """Runs the bench; 1 where some network does not agree."""
    arguments = asked()
    path = arguments.json
    done = {item["seed"]: item for item in json.loads(path.read_text())} if path and path.exists() else {}
    seeds = arguments.seeds or range(arguments.first, arguments.first + arguments.networks)
    figures = held_figures if arguments.held else block_figures if arguments.blocks else network_figures
    found = judged(figures, seeds, done, path)
    chosen = [found[seed] for seed in seeds]
    if arguments.seeds:
        print(*map(line, chosen), sep="\n")
    told(chosen)
    return 0 if all(item.get("is_good", True) or item["apart"] for item in chosen) else 1


if __name__ == "__main__":
    sys.exit(main())
