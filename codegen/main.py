"""The command `gencode`: writes the generated modules, or checks that they are what they should be."""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from obseq.codegen import ondemand
from obseq.codegen.c99 import WITH_DERIVATIVES, cpp, cuda, header
from obseq.codegen.compiler import Derived, derive
from obseq.codegen.equations.documentation import FOLDER, render_pages
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
from obseq.codegen.jax_text import jax
from obseq.codegen.modules import REPORT, Module, module_name, recorded_operations
from obseq.codegen.pipeline import shown
from obseq.codegen.project import Project, find_project, write_project
from obseq.errors import ObseqError
from obseq.formulas.base import Formula
from obseq.module_texts import OWN
from obseq.writing import write_all


class Target(NamedTuple):
    """Another language.

    Attributes:
        text: what says a formula in it.
        file: what its file is called, after the name of the formula and of its module.
        what: what the files are.
    """

    text: Callable[[Derived], str]
    file: str
    what: str


TARGETS = {
    "c99": Target(header, "{module}.h", "C99 headers"),
    "cpp": Target(cpp, f"CodeGen_c{{name}}{WITH_DERIVATIVES}.h", "C++ classes that are called as MMVII's"),
    "jax": Target(jax, "{module}.py", "JAX functions"),
    "cuda": Target(cuda, "{module}.cu", "CUDA kernels"),
}
"""Other languages, by the option that asks for them: a file for each formula."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs gencode; returns 0 done, 1 something is stale (`--check`), 2 it could not run."""
    options = _parser().parse_args(arguments)
    try:
        if options.new:
            return _new(options.new, options.project or Path.cwd())
        project = find_project(options.project, Path.cwd())
        formulas = project.select(options.names)
        if options.list:
            print("\n".join(sorted(formula.name for formula in formulas)))
            return 0
        if options.stages:
            print("\n\n".join("\n".join(shown(formula)) for formula in formulas))
            return 0
        for option, target in TARGETS.items():
            if folder := getattr(options, option):
                written = write_texts(target, formulas, folder)
                print(f"wrote {len(written)} {target.what} in {folder}")
                return 0
        print(f"reads {project}")
        return _run(project, formulas, options)
    except ObseqError as error:
        print(f"gencode: {error}", file=sys.stderr)
        return 2


def write_texts(target: Target, formulas: Sequence[Formula], folder: Path) -> list[Path]:
    """Writes a file for each formula in a folder, which is created; gives the files.

    Raises:
        FormulaError: A formula cannot be said in that language.
        InputError: The folder cannot be written.
    """
    texts = {
        folder / target.file.format(name=formula.name, module=module_name(formula.name)): target.text(
            derive(formula)
        )
        for formula in formulas
    }
    write_all(texts)
    return list(texts)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="gencode", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="formulas to write (default: all of them)")
    parser.add_argument(
        "--project", type=Path, metavar="FOLDER", help="the project of formulas (default: the one you are in)"
    )
    parser.add_argument("--new", metavar="NAME", help="make a project of formulas of your own, with a test")
    parser.add_argument("--check", action="store_true", help="write nothing; show what is stale and return 1")
    parser.add_argument(
        "--accept-more", action="store_true", help="write kernels that do more than REPORT.md records"
    )
    parser.add_argument("--list", action="store_true", help="list the names of the formulas")
    parser.add_argument(
        "--stages", action="store_true", help="only show what each stage of the generator makes of them"
    )
    for option, target in TARGETS.items():
        what = f"only write {target.what} in this folder"
        parser.add_argument(f"--{option}", type=Path, metavar="DIR", help=what)
    return parser


def _run(project: Project, formulas: list[Formula], options: argparse.Namespace) -> int:
    folder = project.generated
    registered = {formula.name for formula in project.registry}
    modules = render_modules(
        [formula for formula in formulas if formula.name in registered],
        _progress if sys.stderr.isatty() else None,
    )
    found = _due(project, modules, partial=bool(options.names))
    if options.check:
        return _show(found, folder)
    if not options.accept_more and (more := _with_more_operations(project, modules)):
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


def _new(name: str, where: Path) -> int:
    """A project with one formula, its modules written."""
    root = write_project(name, where)
    print(f"wrote the project {root}")
    return main(["--project", str(root)])


def _due(project: Project, modules: dict[str, Module], partial: bool) -> list[Change]:
    """The files that are not what they should be: of some modules, or of the whole project."""
    folder = project.generated
    found = changes(folder, render_all(modules, project.package))
    if partial:
        wanted = {folder / file_of(module) for module in modules.values()}
        return [change for change in found if change.path in wanted]
    if project.package != OWN or project.root is None:
        return found
    return [*found, *_packages(project.root, modules), *_pages(project.root, modules)]


def _with_more_operations(project: Project, modules: dict[str, Module]) -> list[str]:
    """A line for each formula of obseq whose kernels do more than the report of the folder records."""
    if project.package != OWN:
        return []
    report = project.generated / REPORT
    before = recorded_operations(report.read_text("utf-8")) if report.is_file() else {}
    after = recorded_operations(render_all(modules, project.package)[REPORT])
    return [
        f"{name}: {before[name]} -> {counts} operations (value, value and Jacobian)"
        for name, counts in after.items()
        if name in before and any(now > then for now, then in zip(counts, before[name], strict=True))
    ]


def _refuse(more: list[str]) -> int:
    print("\n".join(more))
    print("gencode: kernels that do more are not written; --accept-more writes them", file=sys.stderr)
    return 1


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
