"""`obseq versions`: what to say when reporting a problem."""

import argparse
import os
import platform
import sys
from collections.abc import Iterator
from importlib import metadata

from obseq.cli.parsing import Commands, add_command

PACKAGES = ("numpy", "scipy", "numba", "llvmlite", "pyproj", "pymetis", "sympy", "jinja2")


def register(commands: Commands) -> None:
    """Add the command to the parser."""
    add_command(commands, "versions", run, "show the versions of obseq and of what it uses, for bug reports")


def run(arguments: argparse.Namespace) -> int:
    """Print one line per component."""
    for name, version in components():
        print(f"{name:<12} {version}")
    return 0


def components() -> Iterator[tuple[str, str]]:
    """Name and version of everything that matters."""
    import pyproj

    yield "obseq", _version("obseq")
    yield "python", sys.version.split()[0]
    yield (
        "system",
        f"{platform.system()} {platform.release()} {platform.machine()}, {os.cpu_count()} processors",
    )
    for package in PACKAGES:
        yield package, _version(package)
    yield "machine code", machine_code()
    yield "PROJ", f"{pyproj.proj_version_str}, data in {pyproj.datadir.get_data_dir()}"


def machine_code() -> str:
    """Where compiled loops and kernels come from."""
    from obseq.compilation import cache, objects

    kind = objects.level()
    if kind != objects.NONE:
        return f"compiled ahead of time for {kind}; by numba what that has not, kept in {cache.user_folder()}"
    return f"compiled by numba at the first use, kept in {cache.user_folder()}"


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"
