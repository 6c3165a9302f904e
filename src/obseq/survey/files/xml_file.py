"""XML files as elements that know their lines; entities and external references are refused."""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING
from xml.sax import SAXException, SAXParseException
from xml.sax.handler import ContentHandler, feature_external_ges

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.printable import composed
from obseq.survey.files.text import TextFile, encoding_of, parse_number, quoted, read_bytes

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator
    from pathlib import Path
    from xml.sax.xmlreader import AttributesImpl

DEEPEST = 40
"""Levels of elements: surveys need a dozen."""


@dataclass(slots=True, eq=False)
class Element:
    """An element of a file.

    Attributes:
        file: The file.
        name: Without the prefix of its name space.
        attributes: By name, prefixes and declarations of name spaces included.
        line: From 1.
        children: Elements in it.
        text: What stands directly in it.
    """

    file: TextFile
    name: str
    attributes: dict[str, str]
    line: int
    children: list[Element] = field(default_factory=list)
    text: str = ""

    def error(self, problem: str) -> InputError:
        """An error about this element."""
        return self.file.error(self.line - 1, problem)

    def named(self, *names: str) -> Iterator[Element]:
        """Its children of some names."""
        return (child for child in self.children if child.name in names)

    def first(self, name: str) -> Element | None:
        """The first of its children of a name; None when there is none."""
        for child in self.children:
            if child.name == name:
                return child
        return None

    def get(self, name: str) -> str | None:
        """An attribute with its white space collapsed; None when there is none, or it is empty."""
        return " ".join(self.attributes.get(name, "").split()) or None

    def wanted(self, name: str) -> str:
        """An attribute that must be there.

        Raises:
            InputError: It is not.
        """
        found = self.get(name)
        if found is None:
            raise self.error(f"<{self.name}> has no {name}; it needs one")
        return found

    def number(self, name: str) -> float | None:
        """An attribute that is a finite number, if it is there."""
        text = self.get(name)
        return None if text is None else self.parsed(text, name)

    def parsed(self, text: str, what: str) -> float:
        """A finite number.

        Raises:
            InputError: It is none.
        """
        try:
            return parse_number(text)
        except ValueError as error:
            raise self.error(f"<{self.name}> {what}: {error}") from error

    def positive(self, name: str) -> float | None:
        """An attribute that is a number above zero, if it is there."""
        found = self.number(name)
        if found is not None and found <= 0.0:
            raise self.error(f"<{self.name}> {name} is {found:g}; it must be above zero")
        return found

    def allow(self, attributes: Collection[str], children: Collection[str] = ()) -> None:
        """Refuses attributes and children of other names."""
        for name in self.attributes:
            if name not in attributes and name != "xmlns" and ":" not in name:
                raise self.error(
                    f"<{self.name}> has an attribute {quoted(name)}, which is not known there (known: "
                    f"{', '.join(attributes) or 'none'})"
                )
        for child in self.children:
            if child.name not in children:
                raise child.error(
                    f"<{quoted(child.name)}> is not known in <{self.name}> (known there: "
                    f"{', '.join(children) or 'none'}); remove it, or correct its name"
                )


def read_xml(path: Path) -> Element:
    """The root element of an XML file.

    Raises:
        InputError: It cannot be read, is broken, nested too deeply, or refers to something outside.
    """
    data = read_bytes(path)
    if not data.strip():
        raise InputError(f"{path}: the file is empty")
    return xml_of(data, str(path))


def xml_of(data: bytes, name: str) -> Element:
    """The root element of what a file of this name holds.

    Raises:
        InputError: It is broken, nested too deeply, or refers to something outside.
    """
    from defusedxml.common import DefusedXmlException
    from defusedxml.sax import make_parser

    lines = data.decode(encoding_of(data), "replace").splitlines()
    file = TextFile(name, lines or [""], True, "UTF-8")
    parser = make_parser()
    parser.forbid_external = False  # a document type is named in old files: it is not loaded
    parser.setFeature(feature_external_ges, False)
    builder = _Builder(file, parser.getLineNumber)
    parser.setContentHandler(builder)
    try:
        parser.feed(data)
        parser.close()
    except DefusedXmlException as error:
        raise InputError(f"{name}: refused: XML with entities or external references ({error})") from None
    except SAXParseException as error:
        line = min(max(error.getLineNumber() or 1, 1), len(file.lines))
        raise file.error(line - 1, f"the XML is broken: {error.getMessage()}") from None
    except (SAXException, ValueError, LookupError) as error:
        raise InputError(f"{name}: the XML is broken: {error}") from None
    return builder.finished()


class _Builder(ContentHandler):
    """Makes elements of the events of a parser."""

    def __init__(self, file: TextFile, line: Callable[[], int | None]) -> None:
        super().__init__()
        self._file, self._line = file, line
        self._open: list[tuple[Element, list[str]]] = []
        self._root: Element | None = None

    def startElement(self, name: str, attrs: AttributesImpl) -> None:  # noqa: N802  (name of the interface)
        """An element begins."""
        line = min(self._line() or 1, len(self._file.lines))
        attributes = {key: composed(value) for key, value in attrs.items()}
        element = Element(self._file, name.rpartition(":")[2], attributes, line)
        if len(self._open) == DEEPEST:
            raise element.error(f"the elements are nested deeper than {DEEPEST} levels")
        if self._open:
            self._open[-1][0].children.append(element)
        else:
            self._root = element
        self._open.append((element, []))

    def endElement(self, name: str) -> None:  # noqa: N802  (name of the interface)
        """It ends."""
        element, parts = self._open.pop()
        element.text = composed("".join(parts))

    def characters(self, content: str) -> None:
        """Text stands in it."""
        if self._open:
            self._open[-1][1].append(content)

    def finished(self) -> Element:
        """The root, once everything is read."""
        if self._root is None:
            raise InputError(f"{self._file.name}: the XML holds no element")
        return self._root
