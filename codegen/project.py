"""The packages whose formulas gencode writes: obseq's own, and anybody's that says so in its pyproject.toml.

```toml
[tool.gencode]
package = "mylib"
```

Then `mylib.formulas` has the list `REGISTRY`, and gencode keeps the folder `generated` of the package. An
entry point `obseq.formulas` of the project lets obseq find them by name once the package is installed.
"""

from __future__ import annotations

import importlib
import importlib.util
import keyword
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from obseq.codegen.templating import template
from obseq.errors import FormulaError, nearest
from obseq.formulas import find, formula
from obseq.formulas.base import Formula
from obseq.module_texts import GROUP, OWN, formula_files
from obseq.version import __version__
from obseq.writing import write_all

if TYPE_CHECKING:
    from collections.abc import Sequence

TABLE = "gencode"
SETTINGS = "pyproject.toml"


@dataclass(frozen=True)
class Project:
    """A package with formulas, and where its modules go.

    Attributes:
        package: its name.
        registry: its formulas.
        generated: the folder of its generated modules.
        root: the folder of its pyproject.toml; None for an installed package.
    """

    package: str
    registry: tuple[Formula, ...]
    generated: Path
    root: Path | None

    @property
    def sources(self) -> list[Path]:
        """The files of its formulas."""
        return formula_files(self.package)

    def select(self, names: Sequence[str]) -> list[Formula]:
        """The formulas with these names, those of the registry without names.

        Raises:
            FormulaError: A name means nothing; the message gives the nearest ones.
        """
        return [self._named(name) for name in names] if names else list(self.registry)

    def _named(self, name: str) -> Formula:
        if self.package == OWN:
            return formula(name)
        registered = {formula.name: formula for formula in self.registry}
        if name not in registered:
            raise FormulaError(f"no formula of {self.package} is named {nearest(name, list(registered))}")
        return registered[name]

    def __str__(self) -> str:
        return f"{self.package}.formulas of {self.root or self.generated.parent}"


def find_project(root: Path | None, here: Path) -> Project:
    """The project of a folder; else that which one stands in; else obseq itself.

    Raises:
        FormulaError: The folder is no project of formulas; its package cannot be imported, or is imported
            from elsewhere; or its formulas are not in order.
    """
    if root is None:
        root = next((folder for folder in (here, *here.parents) if _package_of(folder)), None)
        if root is None:
            return _project(OWN, None)
    package = _package_of(root)
    if not package:
        raise FormulaError(
            f'{root / SETTINGS} has no table [tool.{TABLE}] with package = "NAME"; '
            "`gencode --new NAME` makes a project"
        )
    return _project(package, root.resolve())


def _package_of(root: Path) -> str:
    """The package that a pyproject.toml names; empty where there is none."""
    table = _settings(root).get("tool", {}).get(TABLE, {})
    return str(table.get("package", "")) if isinstance(table, dict) else ""


def _settings(root: Path) -> dict[str, Any]:
    path = root / SETTINGS
    if not path.is_file():
        return {}
    try:
        return tomllib.loads(path.read_text("utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise FormulaError(f"{path} cannot be read: {error}") from error


def _project(package: str, root: Path | None) -> Project:
    folder = _folder(package, root)
    if root is not None and not folder.is_relative_to(root):
        raise FormulaError(
            f"you are in the project {root}, but the {package} that runs has its formulas and modules "
            f"elsewhere ({folder}); install the project (pip install -e {root}), or leave it"
        )
    if root is None:
        root = folder.parent if (folder.parent / SETTINGS).is_file() else None
    registry = _registry(package)
    if package != OWN and root is not None:
        _check_entry_point(package, root)
    return Project(package, registry, folder, root)


def _folder(package: str, root: Path | None) -> Path:
    """Where the generated modules of a package are, or will be."""
    if package != OWN and root is not None:
        sys.path[:0] = [str(root / "src" if (root / "src").is_dir() else root)]
    try:
        spec = importlib.util.find_spec(f"{package}.formulas")
    except ImportError as error:
        raise FormulaError(f"the package {package} of {root} cannot be imported: {error}") from error
    if spec is None or spec.origin is None:
        raise FormulaError(f"the package {package} of {root} has no module {package}.formulas")
    generated = importlib.util.find_spec(f"{package}.generated")
    if generated is not None and generated.submodule_search_locations:
        return Path(next(iter(generated.submodule_search_locations))).resolve()
    home = importlib.import_module(package)
    return Path(next(iter(home.__path__))).resolve() / "generated"


def _registry(package: str) -> tuple[Formula, ...]:
    """The formulas of a package, whose names are its own."""
    name = f"{package}.formulas"
    try:
        formulas = tuple(importlib.import_module(name).REGISTRY)
    except AttributeError as error:
        raise FormulaError(f"{name} has no list REGISTRY of formulas") from error
    except FormulaError:
        raise
    except Exception as error:  # whatever is wrong in a file that somebody is writing
        raise FormulaError(f"{name} cannot be imported: {type(error).__name__}: {error}") from error
    for one in formulas:
        if not isinstance(one, Formula):
            raise FormulaError(
                f"{name}.REGISTRY has {one!r}, which is no formula: list objects of its classes"
            )
        if package != OWN and find(one.name) is not None:
            raise FormulaError(f"{name}: obseq has a formula {one.name} already; give yours another name")
    return formulas


def _check_entry_point(package: str, root: Path) -> None:
    """Raises where obseq would not find the formulas of the installed package."""
    points = _settings(root).get("project", {}).get("entry-points", {}).get(GROUP, {})
    if package not in points.values():
        raise FormulaError(
            f"{root / SETTINGS} does not let obseq find the formulas of {package}; add\n"
            f'[project.entry-points."{GROUP}"]\n{package} = "{package}"'
        )


FILES = {
    "pyproject.toml": "new_pyproject.toml.jinja",
    "README.md": "new_readme.md.jinja",
    "src/{name}/__init__.py": "new_package.py.jinja",
    "src/{name}/formulas/__init__.py": "new_registry.py.jinja",
    "src/{name}/formulas/curves.py": "new_formula.py.jinja",
    "tests/test_formulas.py": "new_test.py.jinja",
}
"""Each file of the project, and its template."""


def write_project(name: str, where: Path) -> Path:
    """Writes a project named after its package in a folder; the root of the project.

    Raises:
        FormulaError: The name is no name of a package, or is taken; or a folder of that name is there.
    """
    if not name.isidentifier() or not name.isascii() or keyword.iskeyword(name) or name != name.lower():
        raise FormulaError(f"{name} is no name of a package: take lower-case letters, digits and _")
    if name == "obseq" or name in sys.stdlib_module_names:
        raise FormulaError(f"{name} is the name of another package; take one of your own")
    root = where / name
    if root.exists():
        raise FormulaError(f"{root} exists already; take another name, or another folder")
    given = {"name": name, "version": __version__}
    write_all({root / path.format(name=name): template(text).render(given) for path, text in FILES.items()})
    return root
