"""MMVII's serialised trees, in both spellings: XML and JSON to the same Python values, and back.

A tree is made of mappings (tags in order), lists (XML's ``el``), strings, and tuples: a bare number is a
tuple of one, a point one of two or three, a pair of names one of two strings. What a file holds that its
reader does not know stays in the tree: a file that is read and written loses nothing but its comments.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias, TypeGuard

from obseq.errors import InputError
from obseq.reading.json_text import parsed_json
from obseq.reading.text import read_bytes

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

Number: TypeAlias = "int | float"
Tree: TypeAlias = "dict[str, Tree] | list[Tree] | str | tuple[Number, ...] | tuple[str, ...]"

HEADER = '<?xml version="1.0" encoding="UTF-8" standalone="yes" ?>\n'
KIND, VERSION = "MMVII_Serialization", "0.0.0"
ENDINGS = (".xml", ".json")
LARGEST = 512 * 2**20
"""Bytes of the largest file that is read: a project's measures take a thousandth of it."""
DEEPEST = 64
"""Levels of the deepest tree that is read."""
INDENT = "   "
OPTIONAL = ("__Opt__", "Opt:")
"""What marks a field that may be missing, today and in older files."""
_COMMENT = re.compile(r"<!--comment\d+-->")
_PAIR, _KEY = "Pair", "K"
_LISTED = frozenset(("el", _PAIR))
"""Tags of the parts of a list, in XML."""
_MOST = sys.float_info.max
"""Numbers fit in double precision, though whole ones may be of any size."""
_NEXT_TEXT = re.compile(r'(?<!\\)"\s+"')
"""Between the texts of a pair of names."""


def read_tree(path: str | Path) -> dict[str, Tree]:
    """What stands under ``Data`` in a file, XML or JSON by its first character.

    Raises:
        InputError: absent, too large, broken, hostile (entities), or not MMVII's serialisation.
    """
    place = Path(path)
    data = _bytes(place)
    if data.lstrip()[:1] == b"{":
        return _envelope(place, _from_json(place, data))
    return _envelope(place, _from_xml(place, data))


def file_in(folder: str | Path, stem: str) -> Path | None:
    """The file of a name in a folder, XML or JSON; None where there is none."""
    paths = (Path(folder) / f"{stem}{ending}" for ending in ENDINGS)
    return next((path for path in paths if path.is_file()), None)


def files_in(folder: Path, prefix: str) -> list[Path]:
    """The files of a folder whose names begin so, XML or JSON, by name."""
    return sorted(path for path in folder.glob(f"{prefix}*") if path.suffix in ENDINGS)


def tree_text(name: str, content: Tree, *, as_json: bool = False) -> str:
    """A file that holds one named value, with 17 significant digits (the original keeps 15 decimals)."""
    return data_text({name: content}, as_json=as_json)


def data_text(data: dict[str, Tree], *, as_json: bool = False) -> str:
    """A file of what stands under ``Data``: several values without a name for the whole, as in blocks."""
    if as_json:
        whole = {"Type": KIND, "Version": VERSION, "Data": _jsonable(data)}
        return json.dumps(whole, indent=3, ensure_ascii=False) + "\n"
    inner = "".join(_xml(name, content, 2) for name, content in data.items())
    return (
        f'{HEADER}<Root>\n{INDENT}<Type>"{KIND}"</Type>\n{INDENT}<Version>"{VERSION}"</Version>\n'
        f"{INDENT}<Data>\n{inner}{INDENT}</Data>\n</Root>\n"
    )


class Reader:
    """The fields of a mapping, asked for by name, with errors that name the file and the field.

    Args:
        tree: the mapping.
        where: what messages begin with.
    """

    def __init__(self, tree: Tree, where: str) -> None:
        if not isinstance(tree, dict):
            raise InputError(f"{where}: holds a value where fields are expected")
        self._tree, self.where = tree, where

    @property
    def tree(self) -> Tree:
        """The mapping itself."""
        return self._tree

    def has(self, name: str) -> bool:
        """Whether the field is there, under its name or as optional."""
        return self._key(name) is not None

    def _key(self, name: str) -> str | None:
        if name in self._tree:
            return name
        return next((key for mark in OPTIONAL if (key := f"{mark}{name}") in self._tree), None)

    def value(self, name: str) -> Tree:
        """The field, whatever it is."""
        key = self._key(name)
        if key is None:
            raise InputError(f"{self.where}: {name} is missing")
        return self._tree[key]

    def text(self, name: str, default: str | None = None) -> str:
        """A string."""
        if default is not None and not self.has(name):
            return default
        found = self.value(name)
        if found == [] or found == {}:
            return ""
        if not isinstance(found, str):
            raise InputError(f"{self.where}: {name} should be a text in quotes")
        return found

    def numbers(self, name: str, count: int | None = None) -> tuple[Number, ...]:
        """Numbers, as many as wanted."""
        found = self.value(name)
        if not _are_numbers(found) or len(found) != (len(found) if count is None else count):
            raise InputError(f"{self.where}: {name} should be {count or 'some'} numbers")
        return found

    def series(self, name: str) -> tuple[Number, ...]:
        """Numbers of a vector, which XML writes as a list and JSON as a row."""
        found = self.value(name)
        parts = found if isinstance(found, list) else [found]
        numbers = tuple(number for part in parts if _are_numbers(part) for number in part)
        if any(not isinstance(part, tuple) for part in parts) or not numbers:
            raise InputError(f"{self.where}: {name} should be a list of numbers")
        return numbers

    def number(self, name: str) -> Number:
        """One number."""
        return self.numbers(name, 1)[0]

    def integer(self, name: str, default: int | None = None) -> int:
        """One whole number."""
        if default is not None and not self.has(name):
            return default
        found = self.number(name)
        if found != int(found):
            raise InputError(f"{self.where}: {name} should be a whole number, not {found}")
        return int(found)

    def list(self, name: str) -> list[Tree]:
        """A list; empty where the tag is."""
        found = self.value(name)
        if found in ({}, ()):
            return []
        if not isinstance(found, list):
            raise InputError(f"{self.where}: {name} should be a list")
        return found

    def fields(self, name: str) -> Reader:
        """The fields of a mapping within."""
        return Reader(self.value(name), f"{self.where}: {name}")

    def mapping(self, name: str) -> dict[str, Tree]:
        """A mapping as it is; empty where the tag is."""
        found = self.value(name)
        if found in ([], ()):
            return {}
        if not isinstance(found, dict):
            raise InputError(f"{self.where}: {name} should hold fields")
        return found


def _are_numbers(value: Tree) -> TypeGuard[tuple[Number, ...]]:
    """Whether a value is a tuple of numbers: one of texts has nothing else either."""
    return isinstance(value, tuple) and not (value and isinstance(value[0], str))


def pairs(values: list[Tree], where: str) -> list[tuple[Tree, Tree]]:
    """Keys and values of a map, which both spellings write as a list of pairs."""
    found = []
    for value in values:
        if not (isinstance(value, dict) and {"K", "V"} <= value.keys()):
            raise InputError(f"{where}: a pair needs K and V")
        found.append((value["K"], value["V"]))
    return found


def merged(old: Tree, new: Tree) -> Tree:
    """The new tree, and what the old one has besides: fields that nobody here knows stay where they were.

    An optional field is the same however it is marked; it is marked as in the new tree.
    """
    if not (isinstance(old, dict) and isinstance(new, dict)):
        return new
    names = {bare(key): key for key in new}
    found = {names.get(bare(key), key): value for key, value in old.items()}
    kept = {key: merged(value, new[key]) if key in new else value for key, value in found.items()}
    return {**kept, **{key: value for key, value in new.items() if key not in kept}}


def bare(key: str) -> str:
    """The name of a field without the mark of those that may be missing."""
    for mark in OPTIONAL:
        key = key.removeprefix(mark)
    return key


def _bytes(path: Path) -> bytes:
    data = read_bytes(path, LARGEST)
    if not data.strip():
        raise InputError(f"{path}: the file is empty")
    return data


def _envelope(path: Path, whole: Tree) -> dict[str, Tree]:
    if not isinstance(whole, dict) or whole.get("Type") != KIND or not isinstance(whole.get("Data"), dict):
        raise InputError(f"{path}: is not a file of MMVII (no Type {KIND!r} with Data)")
    data = whole["Data"]
    assert isinstance(data, dict)
    return data


def _from_xml(path: Path, data: bytes) -> Tree:
    # MMVII of 2023 writes the name ISO8859-1, which expat does not know, for ISO-8859-1
    root = root_of(path, data.replace(b'encoding="ISO8859-1"', b'encoding="ISO-8859-1"', 1))
    return _element(root, str(path), 0)


def _element(node: Element, where: str, depth: int) -> Tree:
    if depth > DEEPEST:
        raise InputError(f"{where}: is nested deeper than {DEEPEST} levels")
    if not len(node):
        return _leaf(node, where)
    if node[0].tag in _LISTED and all(child.tag in _LISTED for child in node):
        return [_element(child, where, depth + 1) for child in node]
    found: dict[str, Tree] = {}
    for child in node:
        if child.tag in found:
            raise InputError(f"{where}: {child.tag} stands twice in {node.tag}")
        found[child.tag] = _element(child, where, depth + 1)
    return found


def _leaf(node: Element, where: str) -> Tree:
    """A quoted text, several of them, numbers, or nothing."""
    bare = (node.text or "").strip()
    if not bare:
        return []
    if bare[0] != '"':
        return tuple([_number(word, node, where) for word in bare.split()])
    if len(bare) < 2 or bare[-1] != '"':
        raise InputError(f"{where}: {node.tag}: the quotes of {bare[:40]!r} are not closed")
    if '"' not in bare[1:-1]:
        return bare[1:-1]
    texts = tuple(part.replace('\\"', '"') for part in _NEXT_TEXT.split(bare[1:-1]))
    return texts if len(texts) > 1 else texts[0]


def _number(word: str, node: Element, where: str) -> Number:
    try:
        value: Number = int(word) if word.lstrip("+-").isdecimal() else float(word)
    except ValueError:
        if (lowered := word.lower()) in ("true", "false"):
            return int(lowered == "true")
        raise InputError(
            f"{where}: {node.tag}: {word[:40]!r} is not a number (texts stand in quotes)"
        ) from None
    if not abs(value) <= _MOST:
        raise InputError(f"{where}: {node.tag}: {word[:40]!r} is not a finite number")
    return value


def _from_json(path: Path, data: bytes) -> Tree:
    try:
        whole = parsed_json(data.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: the JSON is broken: {error}") from None
    return _plain(whole, str(path), 0)


def _plain(value: object, where: str, depth: int) -> Tree:
    if depth > DEEPEST:
        raise InputError(f"{where}: is nested deeper than {DEEPEST} levels")
    if isinstance(value, str):
        return value
    if isinstance(value, int | float):
        return (_finite(value, where),)
    if isinstance(value, list):
        if value and all(isinstance(part, int | float) for part in value):
            return tuple(_finite(part, where) for part in value)
        return [_plain(part, where, depth + 1) for part in value]
    if isinstance(value, dict):
        items = {key: part for key, part in value.items() if not _COMMENT.fullmatch(key)}
        return {key: _plain_field(key, part, where, depth + 1) for key, part in items.items()}
    raise InputError(f"{where}: a null has no meaning here")


def _finite(value: Number, where: str) -> Number:
    if not abs(value) <= _MOST:
        raise InputError(f"{where}: a number above 1.8e308 is not a finite number here")
    return int(value) if isinstance(value, bool) else value


def _plain_field(name: str, value: object, where: str, depth: int) -> Tree:
    """A value under its name: the key of a map may be a pair of names, which is no list."""
    if name == _KEY and isinstance(value, list) and value and all(isinstance(one, str) for one in value):
        return tuple(value)
    return _plain(value, where, depth)


def _xml(name: str, value: Tree, level: int) -> str:
    margin = INDENT * level
    if isinstance(value, str | tuple):
        words = map(_word, (value,) if isinstance(value, str) else value)
        return f"{margin}<{name}>{' '.join(words)}</{name}>\n"
    if not value:
        return f"{margin}<{name}></{name}>\n"
    if isinstance(value, list):
        inner = "".join(_xml(_PAIR if _is_pair(part) else "el", part, level + 1) for part in value)
    else:
        inner = "".join(_xml(key, part, level + 1) for key, part in value.items())
    return f"{margin}<{name}>\n{inner}{margin}</{name}>\n"


def _word(value: str | Number) -> str:
    """A text in its quotes, or a number."""
    if not isinstance(value, str):
        return repr(value)
    quoted = value.replace('"', '\\"')
    return f'"{_escaped(quoted)}"'


def _is_pair(value: Tree) -> bool:
    return isinstance(value, dict) and list(value) == ["K", "V"]


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def _jsonable(value: Tree) -> object:
    if isinstance(value, tuple):
        return value[0] if len(value) == 1 else list(value)
    if isinstance(value, list):
        return [_jsonable(part) for part in value]
    if isinstance(value, dict):
        return {key: _jsonable(part) for key, part in value.items()}
    return value


DECLARING = b"<!DOCTYPE"
"""What entities are declared in: so written in every encoding that is read, but those with zero bytes."""


def root_of(path: Path, data: bytes) -> Element:
    """The root of the file that holds `data`.

    Entities, which can make a small file a huge one, take a declaration. A file without any is read by the
    standard library, ten times as fast as by the parser that looks for them.

    Raises:
        InputError: it has entities or external references, or is no XML.
    """
    from xml.etree.ElementTree import ParseError, fromstring

    try:
        return _without_entities(path, data) if DECLARING in data or b"\0" in data else fromstring(data)
    except (ParseError, ValueError, LookupError) as error:
        raise InputError(f"{path}: the XML is broken: {error}") from None


def _without_entities(path: Path, data: bytes) -> Element:
    from defusedxml.common import DefusedXmlException
    from defusedxml.ElementTree import fromstring

    try:
        root: Element = fromstring(data)
    except DefusedXmlException as error:
        raise InputError(f"{path}: refused: XML with entities or external references ({error})") from None
    return root
