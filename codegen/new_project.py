"""A project of formulas of one's own, as a start: what `gencode --new NAME` writes."""

import keyword
import sys
from pathlib import Path

from obseq.codegen.templating import template
from obseq.errors import FormulaError
from obseq.version import __version__
from obseq.writing import write_all

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
