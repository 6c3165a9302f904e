"""Text inside HTML and SVG."""

from html import escape

from obseq.printable import printable_line


def escaped(text: str) -> str:
    """The text as content or attribute of an element: printable, with nothing that HTML would obey."""
    return escape(printable_line(text))
