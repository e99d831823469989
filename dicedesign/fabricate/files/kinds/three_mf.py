"""3MF: the printers' own format, with names, colours and facts.

Source: 3MF Core Specification 1.3 (3MF Consortium, 2021); materials are its `basematerials`.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from html import escape as escaped
from typing import Final

from dicedesign.fabricate.files.file_format import FILE_FORMATS, Contents, FileFormat, Part
from dicedesign.fabricate.files.rows import rows

__all__ = ["three_mf"]

EARLIEST: Final = (1980, 1, 1, 0, 0, 0)
"""Time of all parts of a ZIP archive, the first that it can hold: the same solid is the same file
at any time."""

PACKAGES: Final = "http://schemas.openxmlformats.org/package/2006"
"""Start of the namespaces of the packages that 3MF files are."""

PRINTING: Final = "http://schemas.microsoft.com/3dmanufacturing"
"""Start of the namespaces of 3MF."""

OWN: Final = "urn:dicedesign:die"
"""Namespace of facts that 3MF has no name for."""

KNOWN_FACTS: Final = frozenset({"Application", "Description"})
"""Facts that it has a name for, beside the title."""

MODEL: Final = "3D/3dmodel.model"
"""Part of a 3MF file that holds the solid."""

TYPES: Final = (
    f'<Types xmlns="{PACKAGES}/content-types">'
    f'<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships'
    '+xml"/><Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-'
    '3dmodel+xml"/></Types>'
)

RELATIONS: Final = (
    f'<Relationships xmlns="{PACKAGES}/relationships">'
    f'<Relationship Target="/{MODEL}" Id="solid" Type="{PRINTING}/2013/01/3dmodel"/>'
    "</Relationships>"
)

MATERIALS: Final = 1
"""Number of the list of materials; objects are counted from the next on."""


def three_mf(contents: Contents) -> bytes:
    """Contents as a 3MF file: an object for each part, the colours of its triangles, and one thing
    to print that holds them all."""
    import zipfile

    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in (
            ("[Content_Types].xml", TYPES),
            ("_rels/.rels", RELATIONS),
            (MODEL, _model(contents)),
        ):
            part = zipfile.ZipInfo(name, EARLIEST)
            part.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(part, f'<?xml version="1.0" encoding="UTF-8"?>\n{text}')
    return file.getvalue()


def _escape(text: str) -> str:
    """A text within XML. References by numbers, as of an apostrophe, are more than lib3mf reads."""
    return escaped(text, quote=False).replace('"', "&quot;")


def _model(contents: Contents) -> str:
    groups = [group for part in contents.parts for group in part.groups()]
    materials = list(dict.fromkeys((name, color) for name, color, _ in groups))
    bases = "".join(
        f'<base name="{_escape(name)}" displaycolor="{_escape(color.upper())}"/>'
        for name, color in materials
    )
    numbers = range(MATERIALS + 1, MATERIALS + 1 + len(contents.parts))
    objects = "".join(
        _object(part, number, materials)
        for part, number in zip(contents.parts, numbers, strict=True)
    )
    thing = numbers[-1]
    if len(contents.parts) > 1:
        thing += 1
        components = "".join(f'<component objectid="{number}"/>' for number in numbers)
        objects += (
            f'<object id="{thing}" type="model" name="{_escape(contents.title)}"><components>'
            f"{components}</components></object>"
        )
    return (
        f'<model unit="millimeter" xml:lang="en-US" xmlns="{PRINTING}/core/2015/02" '
        f'xmlns:die="{OWN}">{_metadata(contents)}<resources><basematerials id="{MATERIALS}">'
        f'{bases}</basematerials>{objects}</resources><build><item objectid="{thing}"/></build>'
        "</model>"
    )


def _metadata(contents: Contents) -> str:
    facts = {"Title": contents.title}
    for name, text in contents.facts.items():
        facts[name if name in KNOWN_FACTS else f"die:{name}"] = text
    return "".join(
        f'<metadata name="{name}" preserve="1">{_escape(text)}</metadata>'
        for name, text in facts.items()
    )


def _object(part: Part, number: int, materials: Sequence[tuple[str, str]]) -> str:
    """An object with a material, and the others of its triangles."""
    own, *others = [
        (materials.index((name, color)), triangles) for name, color, triangles in part.groups()
    ]
    faces = rows('<triangle v1="{}" v2="{}" v3="{}"/>', own[1])
    for material, triangles in others:
        form = f'<triangle v1="{{}}" v2="{{}}" v3="{{}}" pid="{MATERIALS}" p1="{material}"/>'
        faces += rows(form, triangles)
    corners = rows('<vertex x="{!r}" y="{!r}" z="{!r}"/>', part.points)
    return (
        f'<object id="{number}" type="model" name="{_escape(part.name)}" pid="{MATERIALS}" '
        f'pindex="{own[0]}"><mesh><vertices>{corners}</vertices><triangles>{faces}</triangles>'
        "</mesh></object>"
    )


FILE_FORMATS.register(
    FileFormat(
        name="3mf",
        line="3MF, the printers' own format, with labels in a colour of their own",
        rank=20,
        unit="mm",
        upward="z",
        precision="float64",
        carries="name, parts, colours, target, odds, recipe, checksum",
        write=three_mf,
    )
)
