"""The command `gencode`: writes the generated modules, or checks that they are what they should be."""

import argparse
import importlib.util
import sys
from collections.abc import Sequence
from pathlib import Path

from obseq.codegen import ondemand
from obseq.codegen.c99 import write_headers
from obseq.codegen.documentation import FOLDER, render_pages
from obseq.codegen.files import Change, apply, changes, render_all, render_modules
from obseq.codegen.modules import Module
from obseq.errors import FormulaError, ObseqError
from obseq.formulas import REGISTRY, Formula, families


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs gencode; returns 0 done, 1 something is stale (`--check`), 2 it could not run."""
    options = _parser().parse_args(arguments)
    try:
        formulas = select(options.names)
        if options.list:
            print("\n".join(sorted(formula.name for formula in formulas)))
            return 0
        if options.c99:
            return _write_c99(formulas, options.c99)
        return _run(formulas, generated_folder(), options.check, partial=bool(options.names))
    except ObseqError as error:
        print(f"gencode: {error}", file=sys.stderr)
        return 2


def select(names: Sequence[str]) -> list[Formula]:
    """The formulas with these names, those of the registry without names.

    Raises:
        FormulaError: A name means nothing; the message gives the nearest ones.
    """
    return [families.formula(name) for name in names] if names else list(REGISTRY)


def generated_folder() -> Path:
    """The folder of the installed package obseq.generated."""
    spec = importlib.util.find_spec("obseq.generated")
    if spec is None or not spec.submodule_search_locations:
        raise FormulaError("the package obseq.generated is not installed")
    return Path(next(iter(spec.submodule_search_locations)))


def documentation_folder(generated: Path) -> Path | None:
    """The folder of the pages on formulas beside the generated folder of a checkout; None elsewhere."""
    root = generated.resolve().parent
    return root / FOLDER if (root / "pyproject.toml").is_file() else None


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="gencode", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="formulas to write (default: all of them)")
    parser.add_argument("--check", action="store_true", help="write nothing; show what is stale and return 1")
    parser.add_argument("--list", action="store_true", help="list the names of the formulas")
    parser.add_argument(
        "--c99", type=Path, metavar="DIR", help="only write a C99 header of each in this folder"
    )
    return parser


def _run(formulas: list[Formula], folder: Path, check: bool, partial: bool) -> int:
    registered = {formula.name for formula in REGISTRY}
    modules = render_modules(
        [formula for formula in formulas if formula.name in registered],
        _progress if sys.stderr.isatty() else None,
    )
    found = changes(folder, render_all(modules))
    if partial:
        wanted = {f"{name}.py" for name in modules}
        found = [change for change in found if change.path.name in wanted]
    else:
        found += _pages(modules, documentation_folder(folder))
    if check:
        return _show(found)
    apply(found)
    for change in found:
        print(f"{'deleted' if change.due is None else 'wrote'} {change.path.name}")
    for formula in formulas:
        if formula.name not in registered:
            print(f"wrote {ondemand.keep(formula)}")
    print(f"{len(formulas)} formulas, {len(found)} files changed")
    return 0


def _write_c99(formulas: list[Formula], folder: Path) -> int:
    written = write_headers(formulas, folder)
    print(f"wrote {len(written)} C99 headers in {folder}")
    return 0


def _pages(modules: dict[str, Module], folder: Path | None) -> list[Change]:
    """The pages of the documentation that are not what they should be, in a checkout."""
    if folder is None:
        return []
    return changes(folder, render_pages((module.formula, module.residuals) for module in modules.values()))


def _show(found: list[Change]) -> int:
    for change in found:
        print(change.difference(), end="")
    if found:
        print(f"gencode: {len(found)} generated files are stale; repair them with: gencode", file=sys.stderr)
    return 1 if found else 0


def _progress(name: str) -> None:
    print(f"\r\033[K{name}", end="", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
