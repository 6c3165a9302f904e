"""What readers of XML ask of an element: what stands in its children, with errors that have its line."""

from __future__ import annotations

from typing import TYPE_CHECKING

from obseq.reading.xml import Element, read_xml, xml_of

if TYPE_CHECKING:
    from obseq.errors import InputError

__all__ = ["Element", "child", "content", "number", "problem", "read_xml", "text", "xml_of"]


def problem(element: Element, words: str) -> InputError:
    """An error about an element."""
    return element.error(f"<{element.name}>: {words}")


def child(element: Element, name: str) -> Element | None:
    """The first child of a name."""
    return next(element.named(name), None)


def text(element: Element) -> str:
    """What stands directly in it, without white space around it."""
    return element.text.strip()


def content(element: Element, name: str, default: str | None = None) -> str:
    """The text of the first child of a name.

    Raises:
        InputError: there is none, and no default.
    """
    found = child(element, name)
    if found is not None and text(found):
        return text(found)
    if default is None:
        raise problem(element, f"{name} is missing")
    return default


def number(element: Element, name: str, default: float | None = None) -> float:
    """The finite number in the first child of a name."""
    found = child(element, name)
    if default is not None and (found is None or not text(found)):
        return default
    return (found or element).parsed(content(element, name), name)
