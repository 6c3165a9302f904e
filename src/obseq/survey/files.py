"""What the room of formats, which stands above this one, does for networks: loaded when it is used."""

from importlib import import_module
from typing import Any


def __getattr__(name: str) -> Any:
    formats = import_module("obseq.formats")
    if name not in formats.__all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(formats, name)
