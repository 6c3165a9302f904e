"""The packages of an installation: their versions, and those that it may lack, with how to get them."""

import importlib.util
import os
import sys
from functools import cache

from obseq.errors import MissingPackageError

GENERATOR = ("sympy", "jinja2")
"""What the equations and the generator of kernels need; the extra that brings them is `gencode`."""


def version(package: str) -> str:
    """The version of an installed package, by the name of the folder that says what was installed.

    `importlib.metadata`, which knows the rarer ways to install, takes longer to import than a network to be
    adjusted.

    Raises:
        PackageNotFoundError: it is not installed.
    """
    return _installed().get(package) or importlib.import_module("importlib.metadata").version(package)


@cache
def _installed() -> dict[str, str]:
    """Versions of the packages beside which a folder `NAME-VERSION.dist-info` lies, the first on the path."""
    found: dict[str, str] = {}
    for folder in sys.path:
        for entry in os.listdir(folder) if os.path.isdir(folder) else ():  # noqa: PTH112, PTH208
            name, _, version = entry.removesuffix(".dist-info").rpartition("-")
            if name and entry.endswith(".dist-info"):
                found.setdefault(name.lower(), version)
    return found


def missing(*packages: str) -> list[str]:
    """Those that are not installed."""
    return [package for package in packages if importlib.util.find_spec(package) is None]


def require(purpose: str, extra: str, *packages: str) -> None:
    """Does nothing where all the packages are installed.

    Args:
        purpose: What needs them, the subject of the sentence.
        extra: The extra of obseq that brings them.
        packages: Their names.

    Raises:
        MissingPackageError: Some are not installed.
    """
    if absent := missing(*packages):
        names = " and ".join(absent)
        raise MissingPackageError(
            f"{purpose} needs {names}; install with: pip install 'obseq[{extra}]' "
            f"(in a checkout: pip install -e '.[{extra}]')"
        )
