"""Packages that an installation may lack: what needs them says how to get them."""

import importlib.util

from obseq.errors import MissingPackageError

GENERATOR = ("sympy", "jinja2")
"""What the equations and the generator of kernels need; the extra that brings them is `gencode`."""


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
        raise MissingPackageError(f"{purpose} needs {names}; install with: pip install 'obseq[{extra}]'")
