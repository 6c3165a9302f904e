"""The command `gencode`: writes the generated modules, or checks that they are what they should be."""

import argparse
import importlib.util
import sys
from collections.abc import Sequence
from pathlib import Path

from obseq.codegen import ondemand
from obseq.codegen.c99 import write_headers
from obseq.codegen.documentation import FOLDER, render_pages
from obseq.codegen.files import (
    Change,
    apply,
    changes,
    families,
    file_of,
    package_list,
    render_all,
    render_modules,
)
from obseq.codegen.modules import REPORT, Module, recorded_operations
from obseq.codegen.pipeline import shown
from obseq.errors import FormulaError, ObseqError
from obseq.formulas import REGISTRY, Formula
from obseq.formulas.families import formula as formula_named

PARTS = ("formulas", "codegen", "generated")
"""Folders at the root of a checkout of obseq."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs gencode; returns 0 done, 1 something is stale (`--check`), 2 it could not run."""
    options = _parser().parse_args(arguments)
    try:
        formulas = select(options.names)
        if options.list:
            print("\n".join(sorted(formula.name for formula in formulas)))
            return 0
        if options.stages:
            print("\n\n".join("\n".join(shown(formula)) for formula in formulas))
            return 0
        if options.c99:
            return _write_c99(formulas, options.c99)
        folder = generated_folder()
        check_place(folder, Path.cwd())
        return _run(formulas, folder, options)
    except ObseqError as error:
        print(f"gencode: {error}", file=sys.stderr)
        return 2


def select(names: Sequence[str]) -> list[Formula]:
    """The formulas with these names, those of the registry without names.

    Raises:
        FormulaError: A name means nothing; the message gives the nearest ones.
    """
    return [formula_named(name) for name in names] if names else list(REGISTRY)


def generated_folder() -> Path:
    """The folder of the installed package obseq.generated."""
    spec = importlib.util.find_spec("obseq.generated")
    if spec is None or not spec.submodule_search_locations:
        raise FormulaError("the package obseq.generated is not installed")
    return Path(next(iter(spec.submodule_search_locations))).resolve()


def checkout(generated: Path) -> Path | None:
    """The root of the project whose generated folder that is; None in an installed package."""
    root = generated.parent
    return root if (root / "pyproject.toml").is_file() else None


def check_place(generated: Path, here: Path) -> None:
    """Refuses to write or check other modules than those of the checkout that one stands in.

    Raises:
        FormulaError: The folder is in a checkout of obseq, and the obseq that runs is another one.
    """
    for root in (here, *here.parents):
        project = root / "pyproject.toml"
        if project.is_file() and all((root / name / "__init__.py").is_file() for name in PARTS):
            if not generated.is_relative_to(root.resolve()):
                raise FormulaError(
                    f"you are in the checkout {root}, but the obseq that runs has its formulas and modules "
                    f"elsewhere ({generated}); install the checkout (pip install -e {root}), or leave it"
                )
            return


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="gencode", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="formulas to write (default: all of them)")
    parser.add_argument("--check", action="store_true", help="write nothing; show what is stale and return 1")
    parser.add_argument(
        "--accept-more", action="store_true", help="write kernels that do more than REPORT.md records"
    )
    parser.add_argument("--list", action="store_true", help="list the names of the formulas")
    parser.add_argument(
        "--stages", action="store_true", help="only show what each stage of the generator makes of them"
    )
    parser.add_argument(
        "--c99", type=Path, metavar="DIR", help="only write a C99 header of each in this folder"
    )
    return parser


def _run(formulas: list[Formula], folder: Path, options: argparse.Namespace) -> int:
    registered = {formula.name for formula in REGISTRY}
    modules = render_modules(
        [formula for formula in formulas if formula.name in registered],
        _progress if sys.stderr.isatty() else None,
    )
    found = _due(folder, modules, partial=bool(options.names))
    if options.check:
        return _show(found, folder)
    if not options.accept_more and (more := _with_more_operations(folder, modules)):
        return _refuse(more)
    apply(found)
    for change in found:
        place = change.path.resolve().relative_to(folder.resolve().parent)
        print(f"{'deleted' if change.due is None else 'wrote'} {place}")
    for formula in formulas:
        if formula.name not in registered:
            print(f"wrote {ondemand.keep(formula)}")
    print(f"{len(formulas)} formulas, {len(found)} files changed in {folder}")
    return 0


def _due(folder: Path, modules: dict[str, Module], partial: bool) -> list[Change]:
    """The files that are not what they should be: of some modules, or of the whole project."""
    found = changes(folder, render_all(modules))
    if partial:
        wanted = {folder / file_of(module) for module in modules.values()}
        return [change for change in found if change.path in wanted]
    root = checkout(folder)
    return found if root is None else [*found, *_packages(root, modules), *_pages(root, modules)]


def _with_more_operations(folder: Path, modules: dict[str, Module]) -> list[str]:
    """A line for each formula whose kernels do more than the report of the folder records."""
    report = folder / REPORT
    before = recorded_operations(report.read_text("utf-8")) if report.is_file() else {}
    after = recorded_operations(render_all(modules)[REPORT])
    return [
        f"{name}: {before[name]} -> {counts} operations (value, value and Jacobian)"
        for name, counts in after.items()
        if name in before and any(now > then for now, then in zip(counts, before[name], strict=True))
    ]


def _refuse(more: list[str]) -> int:
    print("\n".join(more))
    print("gencode: kernels that do more are not written; --accept-more writes them", file=sys.stderr)
    return 1


def _write_c99(formulas: list[Formula], folder: Path) -> int:
    written = write_headers(formulas, folder)
    print(f"wrote {len(written)} C99 headers in {folder}")
    return 0


def _packages(root: Path, modules: dict[str, Module]) -> list[Change]:
    """The list of packages of the project, when it lacks a folder of modules."""
    path = root / "pyproject.toml"
    present = path.read_text("utf-8")
    due = package_list(present, families(modules))
    return [Change(path, present, due)] if due != present else []


def _pages(root: Path, modules: dict[str, Module]) -> list[Change]:
    """The pages of the documentation that are not what they should be."""
    pages = render_pages((module.formula, module.residuals) for module in modules.values())
    return changes(root / FOLDER, pages)


def _show(found: list[Change], folder: Path) -> int:
    for change in found:
        print(change.difference(), end="")
    if found:
        stale = f"{len(found)} generated files of {folder} are stale"
        print(f"gencode: {stale}; repair them with: gencode", file=sys.stderr)
        return 1
    print(f"{folder}: current")
    return 0


def _progress(name: str) -> None:
    print(f"\r\033[K{name}", end="", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
