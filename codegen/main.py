"""The command `gencode`: writes the generated modules, or checks that they are what they should be."""

import argparse
import difflib
import importlib.util
import sys
from collections.abc import Sequence
from pathlib import Path

from obseq.codegen.files import Change, apply, changes, render_all
from obseq.errors import FormulaError, ObseqError
from obseq.formulas import REGISTRY, Formula


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs gencode; returns 0 done, 1 something is stale (`--check`), 2 it could not run."""
    options = _parser().parse_args(arguments)
    try:
        formulas = select(options.names)
        if options.list:
            print("\n".join(sorted(formula.name for formula in formulas)))  # noqa: T201
            return 0
        return _run(formulas, generated_folder(), options.check, partial=bool(options.names))
    except ObseqError as error:
        print(f"gencode: {error}", file=sys.stderr)  # noqa: T201
        return 2


def select(names: Sequence[str]) -> list[Formula]:
    """The formulas of the registry with these names, all of them without names.

    Raises:
        FormulaError: A name is not in the registry; the message gives the nearest ones.
    """
    registry = {formula.name: formula for formula in REGISTRY}
    for name in names:
        if name not in registry:
            near = ", ".join(difflib.get_close_matches(name, registry, n=4, cutoff=0.5)) or "none"
            raise FormulaError(f"no formula is named {name!r}; nearest names: {near} (gencode --list gives all)")
    return [registry[name] for name in names] if names else list(REGISTRY)


def generated_folder() -> Path:
    """The folder of the installed package obseq.generated."""
    spec = importlib.util.find_spec("obseq.generated")
    if spec is None or not spec.submodule_search_locations:
        raise FormulaError("the package obseq.generated is not installed")
    return Path(next(iter(spec.submodule_search_locations)))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="gencode", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="formulas to write (default: all of them)")
    parser.add_argument("--check", action="store_true", help="write nothing; show what is stale and return 1")
    parser.add_argument("--list", action="store_true", help="list the names of the formulas")
    return parser


def _run(formulas: list[Formula], folder: Path, check: bool, partial: bool) -> int:
    texts = render_all(formulas, _progress if sys.stderr.isatty() else None)
    found = changes(folder, texts)
    if partial:
        wanted = {name for name in texts if name not in ("index.py", "REPORT.md")}
        found = [change for change in found if change.path.name in wanted]
    if check:
        return _show(found)
    apply(found)
    for change in found:
        print(f"{'deleted' if change.due is None else 'wrote'} {change.path.name}")  # noqa: T201
    print(f"{len(formulas)} formulas, {len(found)} files changed")  # noqa: T201
    return 0


def _show(found: list[Change]) -> int:
    for change in found:
        print(change.difference(), end="")  # noqa: T201
    if found:
        print(f"gencode: {len(found)} generated files are stale; repair them with: gencode", file=sys.stderr)  # noqa: T201
    return 1 if found else 0


def _progress(name: str) -> None:
    print(f"\r\033[K{name}", end="", file=sys.stderr, flush=True)  # noqa: T201


if __name__ == "__main__":
    sys.exit(main())
