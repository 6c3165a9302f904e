"""XML files as elements that know their lines; entities and external references are refused."""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING, NoReturn
from xml.parsers import expat

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.printable import composed
from obseq.reading.text import TextFile, encoding_of, parse_number, quoted, read_bytes

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator
    from pathlib import Path

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

    def problem(self, words: str) -> InputError:
        """An error about this element, which it names."""
        return self.error(f"<{self.name}>: {words}")

    @property
    def plain(self) -> str:
        """What stands directly in it, without white space around it."""
        return self.text.strip()

    def named(self, *names: str) -> Iterator[Element]:
        """Its children of some names."""
        return (child for child in self.children if child.name in names)

    def first(self, name: str) -> Element | None:
        """The first of its children of a name; None when there is none."""
        for child in self.children:
            if child.name == name:
                return child
        return None

    def inside(self, name: str) -> Element:
        """The first of its children of a name, which must be there.

        Raises:
            InputError: It is not.
        """
        found = self.first(name)
        if found is None:
            raise self.problem(f"{name} is missing")
        return found

    def content(self, name: str, default: str | None = None) -> str:
        """What stands in its first child of a name, without white space around it.

        Raises:
            InputError: Nothing does, and there is no default.
        """
        found = self.first(name)
        text = found.plain if found is not None else ""
        if not text and default is None:
            raise self.problem(f"{name} is missing")
        return text or default or ""

    def numeric(self, name: str, default: float | None = None) -> float:
        """The finite number in its first child of a name; the default where nothing is in it.

        Raises:
            InputError: It is none, or nothing is there and there is no default.
        """
        text = self.content(name, None if default is None else "")
        if not text and default is not None:
            return default
        return (self.first(name) or self).parsed(text, name)

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

    lines = data.decode(encoding_of(data), "replace").splitlines()
    file = TextFile(name, lines or [""], True, "UTF-8")
    parser = expat.ParserCreate()
    builder = _Builder(file, parser)
    try:
        parser.Parse(data, False)
        parser.Parse(b"", True)
    except DefusedXmlException as error:
        raise InputError(f"{name}: refused: XML with entities or external references ({error})") from None
    except expat.ExpatError as error:
        line = min(max(error.lineno, 1), len(file.lines))
        raise file.error(line - 1, f"the XML is broken: {expat.ErrorString(error.code)}") from None
    except (ValueError, LookupError) as error:
        raise InputError(f"{name}: the XML is broken: {error}") from None
    return builder.finished()


class _Builder:
    """Makes elements of the events of a parser."""

    def __init__(self, file: TextFile, parser: expat.XMLParserType) -> None:
        self._file, self._parser = file, parser
        self._open: list[tuple[Element, list[str]]] = []
        self._root: Element | None = None
        parser.buffer_text = True
        parser.StartElementHandler, parser.EndElementHandler = self._begin, self._end
        parser.CharacterDataHandler = self._hold
        parser.EntityDeclHandler = parser.UnparsedEntityDeclHandler = _refuse_entity
        parser.ExternalEntityRefHandler = _pass_over  # a document type is named in old files
        parser.SetParamEntityParsing(expat.XML_PARAM_ENTITY_PARSING_UNLESS_STANDALONE)

    def _begin(self, name: str, given: dict[str, str]) -> None:
        """An element begins."""
        line = min(self._parser.CurrentLineNumber or 1, len(self._file.lines))
        for key, value in given.items():
            if not value.isascii():
                given[key] = composed(value)
        element = Element(self._file, name.rpartition(":")[2], given, line)
        if len(self._open) == DEEPEST:
            raise element.error(f"the elements are nested deeper than {DEEPEST} levels")
        if self._open:
            self._open[-1][0].children.append(element)
        else:
            self._root = element
        self._open.append((element, []))

    def _end(self, _: str) -> None:
        """It ends."""
        element, parts = self._open.pop()
        if parts:
            element.text = composed("".join(parts))

    def _hold(self, content: str) -> None:
        """Text stands in it."""
        if self._open:
            self._open[-1][1].append(content)

    def finished(self) -> Element:
        """The root, once everything is read; not kept here."""
        root, self._root = self._root, None
        if root is None:
            raise InputError(f"{self._file.name}: the XML holds no element")
        return root


def _refuse_entity(name: str, *declared: object) -> NoReturn:
    """An entity is declared: what it stands for can fill the memory."""
    from defusedxml.common import EntitiesForbidden

    value, base, system, public, notation = (None, *declared)[-5:]
    raise EntitiesForbidden(name, value, base, system, public, notation)


def _pass_over(*_: object) -> int:
    """What is outside of the file is not loaded."""
    return 1
