"""XML, zipped or not, with limits that count before it is parsed."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING

from dicedesign.errors import MeshFileError

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

MAX_XML_BYTES = 1 << 28
"""Limit of an XML file, 256 MiB, which takes ten times as much memory."""

MAX_TAGS = 1 << 25
"""Limit of the tags of an XML file, 33 million; an element takes 100 bytes."""

MAX_RATIO = 100
"""Limit of unpacked bytes per byte of a file, above `SMALL_UNPACKED`; meshes have 5 to 30."""

SMALL_UNPACKED = 1 << 25
"""Unpacked bytes that any file may have: 32 MiB."""


def max_unpacked(size: int, most: int) -> int:
    """Limit of the unpacked bytes of a file of a size in bytes, `most` for large ones."""
    return min(most, max(SMALL_UNPACKED, MAX_RATIO * size))


def xml_root(data: bytes, max_tags: int = MAX_TAGS) -> Element:
    """Root element of an XML file. Raises ParseError (a SyntaxError), ValueError or LookupError
    for what is no XML, for too many tags, and for a document type, whose entities could fill the
    memory."""
    # Few files are XML.
    from xml.etree import ElementTree

    class Builder(ElementTree.TreeBuilder):
        def doctype(self, *_: object) -> None:
            raise ElementTree.ParseError("it has a document type")

    if data.count(b"<") > max_tags:
        raise ElementTree.ParseError(f"it has more than {max_tags} tags")
    return ElementTree.fromstring(data, ElementTree.XMLParser(target=Builder()))


def scene_root(data: bytes, path: Path, endings: tuple[str, ...]) -> Element:
    """Root of an XML file, or of the first file with one of the endings in a zip archive, without
    namespaces. Raises MeshFileError if it is too large, or another exception for what it is not."""
    limit, size = MAX_XML_BYTES, len(data)
    if data[:2] == b"PK":
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            limit = max_unpacked(size, limit)
            member = next(each for each in archive.infolist() if each.filename.endswith(endings))
            # What is unpacked ends there, whatever follows.
            size = member.file_size
            data = archive.read(member) if size <= limit else b""
    if size > limit:
        raise MeshFileError(
            f"{path}: expected at most {limit >> 20} MiB of XML, got {size >> 20}; export it as "
            "STL or PLY"
        )
    root = xml_root(data)
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
    return root
