"""Documents of Agisoft Metashape and PhotoScan: where their chunks are, and the fields of their elements."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from obseq.errors import InputError
from obseq.reading.xml import Element, read_xml, xml_of

LARGEST = 1 << 30
"""Bytes of the largest document that is taken out of a project."""


def read_document(path: Path) -> Element:
    """The document of an XML, of a project with its folder (`.psx`), or of one in an archive (`.psz`)."""
    if path.suffix.lower() == ".psz":
        root = xml_of(member(path), f"{path}:doc.xml")
        for chunk in (item for item in (root, *items(root, "chunks", "chunk")) if item.children):
            for frame in items(chunk, "frames", "frame"):
                _note_archive(frame, path)
        return root
    return _archived(path) if path.suffix.lower() == ".psx" else read_xml(path)


def _note_archive(frame: Element, archive: Path) -> None:
    """Says of the tie points of a frame in which archive their files are."""
    for cloud in frame.named("point_cloud"):
        _set_archive(cloud, archive)


def _set_archive(cloud: Element, archive: Path) -> None:
    cloud.attributes = {**cloud.attributes, "archive": str(archive)}


def _archived(path: Path) -> Element:
    """The document of a project whose chunks are in files beside it."""
    root = read_xml(path)
    inside = root.attributes.get("path", "").replace("{projectname}", path.stem)
    archive = path.parent / inside
    if not inside or not archive.is_file():
        raise root.problem(f"the files of the project ({inside or 'no path'}) are not beside it")
    document = xml_of(member(archive), f"{archive}:doc.xml")
    places = [item.attributes.get("path", "") for item in items(document, "chunks", "chunk")]
    chunks = [_beside(archive.parent, place) for place in places]
    for chunk, place in zip(chunks, places, strict=True):
        _put_frames(chunk, (archive.parent / place).parent)
    whole = Element(root.file, "document", {}, root.line)
    whole.children = chunks
    return whole


def _beside(folder: Path, name: str) -> Element:
    """The document of an archive beside another one."""
    found = (folder / name).resolve()
    if not name or not found.is_relative_to(folder.resolve()):
        raise InputError(f"{folder}: {name or 'no path'} is not in the folder of the project")
    return xml_of(member(found), f"{found}:doc.xml")


def _put_frames(chunk: Element, folder: Path) -> None:
    """Puts frames, and their tie points, which are in archives of their own, in their places."""
    for frame in items(chunk, "frames", "frame"):
        if name := frame.attributes.get("path"):
            frame.children = [*frame.children, *_beside(folder, name).children]
        for cloud in frame.named("point_cloud"):
            if name and (inside := cloud.attributes.get("path")):
                archive = (folder / name).parent / inside
                cloud.children = [*cloud.children, *_beside((folder / name).parent, inside).children]
                _set_archive(cloud, archive)


def member(archive: Path, name: str = "doc.xml") -> bytes:
    """A file of an archive.

    Raises:
        InputError: It is not in it, or cannot be taken out.
    """
    try:
        with zipfile.ZipFile(archive) as opened:
            if opened.getinfo(name).file_size > LARGEST:
                raise InputError(f"{archive}: {name} is larger than {LARGEST >> 20} MiB")
            return opened.read(name)
    except (OSError, KeyError, zipfile.BadZipFile, NotImplementedError, RuntimeError) as error:
        raise InputError(f"{archive}: {name} cannot be taken out ({error})") from None


def chunk_of(root: Element, wanted: str | None) -> Element:
    """The chunk that is wanted, or the only one."""
    found = [root] if root.name == "chunk" else [item for item in root.children if item.name == "chunk"]
    found += items(root, "chunks", "chunk")
    labels = [item.attributes.get("label", "") for item in found]
    if not found:
        raise root.problem("there is no chunk: export cameras (XML) or markers from Metashape")
    if wanted is None and len(found) > 1:
        raise root.problem(f"there are {len(found)} chunks: choose one of {', '.join(labels)}")
    if wanted is not None and wanted not in labels:
        raise root.problem(f"there is no chunk {wanted!r}, but {', '.join(labels)}")
    return found[labels.index(wanted)] if wanted is not None else found[0]


def items(root: Element, folder: str, tag: str) -> Iterator[Element]:
    """The elements of a list, groups of it included."""
    for holder in (item for item in root.children if item.name == folder):
        for item in holder.children:
            if item.name == tag:
                yield item
            elif item.name == "group":
                yield from item.named(tag)


def label_of(element: Element) -> str:
    """What a thing is called."""
    label = element.attributes.get("label", "")
    if not label:
        raise element.problem("it has no label")
    return label


def floats(element: Element, text: str, count: int) -> list[float]:
    """So many finite numbers of a text."""
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != count or not np.isfinite(values).all():
        raise element.problem(f"{count} finite numbers are expected, not {text[:60]!r}")
    return values


def number_of(element: Element, name: str, default: float | None = None) -> float:
    """The number of an attribute."""
    if default is not None and name not in element.attributes:
        return default
    return floats(element, element.attributes.get(name, ""), 1)[0]


def is_enabled(element: Element) -> bool:
    """Whether a thing is switched on, as it is unless it says otherwise."""
    return element.attributes.get("enabled", "true").lower() in ("true", "1")
