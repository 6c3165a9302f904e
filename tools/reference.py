"""Write the reference page of `obseq.survey` from its docstrings: `python tools/reference.py`.

The page is checked by the tests, so that it says what the code says.
"""

import dataclasses
import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import obseq.formats.tables.in_memory as tables
import obseq.survey

PAGE = Path(__file__).resolve().parents[1] / "docs" / "reference-survey.md"
METHODS = {"Network", "Adjustment"}
"""Classes whose methods are listed too."""


def page() -> str:
    """The text of the page."""
    parts = [
        "# The Python interface of `obseq.survey`",
        "<!-- Written by tools/reference.py from the docstrings. -->",
        "Metres and radians. Every name is imported from `obseq.survey` unless another place is given. "
        "(Reference.)",
    ]
    for name in sorted(obseq.survey.__all__):
        parts += entry(name, getattr(obseq.survey, name), 2)
    for name in ("points_of", "observations_of"):
        parts += entry(f"tables.{name}", getattr(tables, name), 2)
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
            if method in vars(what) and not method.startswith("_"):
                yield from entry(f"{name}.{method}", getattr(found, "fget", found), depth + 1)


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
    PAGE.write_text(page(), encoding="utf-8")
