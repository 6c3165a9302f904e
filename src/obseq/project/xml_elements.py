"""The elements of an XML file that anybody may have written."""

from __future__ import annotations

from typing import TYPE_CHECKING

from obseq.errors import InputError

if TYPE_CHECKING:
    from pathlib import Path
    from xml.etree.ElementTree import Element

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
