"""Write the reference pages of `obseq.survey` and `obseq.images`: `python tools/reference.py`.

The pages are checked by the tests, so that they say what the code says.
"""

import dataclasses
import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import obseq.formats.tables.in_memory as tables
import obseq.images
import obseq.survey
from obseq.records.table import Table

DOCS = Path(__file__).resolve().parents[1] / "docs"
METHODS = {"Network", "Adjustment", "BundleAdjustment", "BundleSolution", "Table"}
"""Classes whose methods are listed too."""


def pages() -> dict[Path, str]:
    """The texts of the pages."""
    made = {f"tables.{name}": getattr(tables, name) for name in ("points_of", "observations_of")}
    return {
        DOCS / "reference-survey.md": page(obseq.survey, "Metres and radians", made | {"Table": Table}),
        DOCS / "reference-images.md": page(
            obseq.images, "Pixels, any one length unit for the world, and radians", {"Table": Table}
        ),
    }


def page(room: ModuleType, units: str, others: dict[str, Any]) -> str:
    """The text of the page of a room, with things of other places."""
    parts = [
        f"# The Python interface of `{room.__name__}`",
        "<!-- Written by tools/reference.py from the docstrings. -->",
        f"{units}. Every name is imported from `{room.__name__}` unless another place is given. (Reference.)",
    ]
    found = {name: getattr(room, name) for name in sorted(room.__all__)}
    for name, what in (found | others).items():
        parts += entry(name, what, 2)
    return "\n\n".join(parts) + "\n"


def entry(name: str, what: Any, depth: int) -> Iterator[str]:
    """A heading, the signature and the docstring of a class or function; its methods if they are wanted."""
    if not callable(what):
        return
    yield f"{'#' * depth} `{name}`"
    yield f"```text\n{_signature(name, what)}\n```"
    yield _text(inspect.getdoc(what) or "")
    if name in METHODS:
        for method, found in inspect.getmembers(what, _is_listed):
            if not method.startswith("_") and _is_ours(what, method):
                yield from entry(f"{name}.{method}", getattr(found, "fget", found), depth + 1)


def _is_ours(what: type, method: str) -> bool:
    """Whether a class of ours says what a method is."""
    return any(method in vars(kind) and kind.__module__.startswith("obseq.") for kind in what.__mro__)


def _is_listed(member: Any) -> bool:
    return inspect.isfunction(member) or inspect.ismethod(member) or isinstance(member, property)


def _signature(name: str, what: Any) -> str:
    """The signature on as many lines as it has arguments; fields of dataclasses one a line."""
    if dataclasses.is_dataclass(what):
        fields = (f"    {field.name}: {field.type}" for field in dataclasses.fields(what))
        return "\n".join([name, *fields])
    try:
        found = inspect.signature(what)
    except (TypeError, ValueError):
        return name
    arguments = ",\n    ".join(_argument(item) for item in found.parameters.values() if item.name != "self")
    returned = "" if found.return_annotation is found.empty else f" -> {found.return_annotation}"
    return f"{name}({arguments and chr(10) + '    ' + arguments + chr(10)}){returned}"


def _argument(item: inspect.Parameter) -> str:
    text = item.name if item.annotation is item.empty else f"{item.name}: {item.annotation}"
    if item.default is item.empty:
        return text
    return (
        f"{text} = {item.default!r}"
        if isinstance(item.default, str | int | float | None)
        else f"{text} = ..."
    )


def _text(docstring: str) -> str:
    """A docstring as text; its sections stand as they are written."""
    parts = re.split(r"\n\n(?=(?:Args|Attributes|Returns|Raises|Example|Examples):\n)", docstring)
    body = [f"```text\n{part}\n```" if re.match(r"\w+:\n", part) else part for part in parts]
    return "\n\n".join(body)


if __name__ == "__main__":
    for path, text in pages().items():
        path.write_text(text, encoding="utf-8")
