"""XML files as elements that know their lines; entities and external references are refused."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import NoReturn
from xml.parsers import expat

from obseq.errors import InputError
from obseq.printable import composed
from obseq.reading.text import TextFile, encoding_of, parse_number, quoted, read_bytes
from obseq.stopwatch import Tally

DEEPEST = 40
"""Levels of elements: surveys need a dozen."""
PIECE = 1 << 16
"""Bytes of a file that are parsed at once, where elements are taken one by one."""
NOTHING: Mapping[str, str] = MappingProxyType({})
"""Attributes of most elements."""


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

    __slots__ = ("attributes", "children", "file", "line", "name", "text")

    def __init__(self, file: TextFile, name: str, attributes: Mapping[str, str], line: int) -> None:
        """An element without anything in it yet."""
        self.file, self.name, self.attributes, self.line = file, name, attributes, line
        self.children: Sequence[Element] = ()
        self.text = ""

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
        text = found.text.strip() if found is not None else ""
        if not text and default is None:
            raise self.problem(f"{name} is missing")
        return text or default or ""

    def numeric(self, name: str, default: float | None = None) -> float:
        """The finite number in its first child of a name; the default where nothing is in it.

        Raises:
            InputError: It is none, or nothing is there and there is no default.
        """
        found = self.first(name)
        text = found.text.strip() if found is not None else ""
        if found is not None and text:
            return found.parsed(text, name)
        if default is None:
            raise self.problem(f"{name} is missing")
        return default

    def get(self, name: str) -> str | None:
        """An attribute with its white space collapsed; None when there is none, or it is empty."""
        text = self.attributes.get(name)
        return None if text is None else " ".join(text.split()) or None

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
    return xml_of(read_bytes(path), str(path))


def xml_of(data: bytes, name: str) -> Element:
    """The root element of what a file of this name holds.

    Raises:
        InputError: It is broken, nested too deeply, or refers to something outside.
    """
    builder = _Builder(data, name)
    builder.feed(data)
    return builder.finished()


def children_of(path: Path) -> Iterator[tuple[Element, Element]]:
    """The root element, as far as it was read, with each of its children, which it does not keep.

    So a file of many records takes the memory of one.

    Raises:
        InputError: As of `read_xml`; what stands before a place that is broken comes out first.
    """
    data = read_bytes(path)
    builder = _Builder(data, str(path))
    for start in range(0, len(data), PIECE):
        builder.feed(data[start : start + PIECE])
        yield from builder.taken()
    builder.finished()


class _Builder:
    """Makes elements of the events of a parser."""

    def __init__(self, data: bytes, name: str) -> None:
        if not data.strip():
            raise InputError(f"{name}: the file is empty")
        lines = data.decode(encoding_of(data), "replace").splitlines()
        self._file = TextFile(name, lines or [""], True, "UTF-8")
        self._tally = Tally(f"read {name}: line", len(lines))
        self._open: list[tuple[Element, list[Element], list[str]]] = []
        self._root: Element | None = None
        self._inside: list[Element] = []
        self._parser = parser = expat.ParserCreate()
        parser.buffer_text = True
        parser.StartElementHandler, parser.EndElementHandler = self._begin, self._end
        parser.CharacterDataHandler = self._hold
        parser.EntityDeclHandler = parser.UnparsedEntityDeclHandler = _refuse_entity
        parser.ExternalEntityRefHandler = _pass_over  # a document type is named in old files
        parser.SetParamEntityParsing(expat.XML_PARAM_ENTITY_PARSING_UNLESS_STANDALONE)

    def feed(self, data: bytes, is_last: bool = False) -> None:
        """Takes a part of the file."""
        from defusedxml.common import DefusedXmlException

        try:
            self._parser.Parse(data, is_last)
        except DefusedXmlException as error:
            raise InputError(
                f"{self._file.name}: refused: XML with entities or external references ({error})"
            ) from None
        except expat.ExpatError as error:
            line = min(max(error.lineno, 1), len(self._file.lines))
            problem = f"the XML is broken: {expat.ErrorString(error.code)}"
            raise self._file.error(line - 1, problem) from None
        except (ValueError, LookupError) as error:
            raise InputError(f"{self._file.name}: the XML is broken: {error}") from None

    def taken(self) -> Iterator[tuple[Element, Element]]:
        """The root with what stands in it so far, and is no longer kept."""
        if self._root is not None:
            root, children = self._root, self._inside
            yield from ((root, child) for child in children)
            children.clear()

    def _begin(self, name: str, given: dict[str, str]) -> None:
        for key, value in given.items():
            if not value.isascii():
                given[key] = composed(value)
        line = min(self._parser.CurrentLineNumber, len(self._file.lines))
        if self._tally.is_due:
            self._tally.tell(line)
        own = name.rpartition(":")[2] if ":" in name else name
        element, children = Element(self._file, own, given or NOTHING, line), list[Element]()
        if not self._open:
            self._root, self._inside = element, children
        elif len(self._open) == DEEPEST:
            raise element.error(f"the elements are nested deeper than {DEEPEST} levels")
        self._open.append((element, children, []))

    def _end(self, _: str) -> None:
        element, children, texts = self._open.pop()
        if children:
            element.children = children
        if texts:
            element.text = composed("".join(texts))
        if self._open:
            self._open[-1][1].append(element)

    def _hold(self, content: str) -> None:
        if self._open:
            self._open[-1][2].append(content)

    def finished(self) -> Element:
        """The root, once everything is read; not kept here."""
        self.feed(b"", True)
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
