"""Which module has the kernels of a formula: obseq's own index, and those of other packages.

Another package says that it has formulas by an entry point of the group `obseq.formulas`, whose value is its
name. Its modules are in its folder `generated`, written by gencode. Entry points are looked up when a name is
not one of obseq's own.
"""

from __future__ import annotations

import functools
import importlib
import logging
from types import ModuleType
from typing import NamedTuple

from obseq.errors import FormulaError
from obseq.module_texts import GROUP, OWN

LOGGER = logging.getLogger(__name__)


class Place(NamedTuple):
    """Where the kernels of a formula are: the package, and the full name of the module."""

    package: str
    module: str


def place(name: str) -> Place | None:
    """Where the kernels of a formula are; None where no package has them."""
    return own().get(name) or registered().get(name)


@functools.cache
def own() -> dict[str, Place]:
    """The formulas of obseq."""
    return _places(OWN)


@functools.cache
def registered() -> dict[str, Place]:
    """The formulas of other packages.

    Raises:
        FormulaError: Two packages have a formula of the same name.
    """
    from importlib.metadata import entry_points

    found: dict[str, Place] = {}
    for package in sorted({point.value for point in entry_points(group=GROUP)}):
        try:
            places = _places(package)
        except ImportError as error:
            LOGGER.warning(
                "the formulas of %s cannot be loaded (%s); run gencode in its project", package, error
            )
            continue
        for name in places.keys() & {**own(), **found}:
            other = {**own(), **found}[name].package
            raise FormulaError(f"{other} and {package} both have a formula {name}: rename or remove one")
        found |= places
    return found


def index_of(package: str) -> ModuleType:
    """The index of the generated modules of a package."""
    return importlib.import_module(f"{package}.generated.index")


def _places(package: str) -> dict[str, Place]:
    modules = index_of(package).MODULES
    return {name: Place(package, f"{package}.generated.{module}") for name, module in modules.items()}
