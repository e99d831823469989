"""Build of the documentation site: pages of the repository's top level and pictures become part of
it, and sections of docstrings become lists."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import griffe
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[1]

TOP_LEVEL = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
}
"""Pages outside of docs/, and where the site has them."""

PICTURES = "outputs/gallery"

LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)#\s]+)(#[^)]*)?\)")

SECTION = re.compile(
    r"^(\w[\w ]*)\n-{3,}\n(.*?)(?=^\w[\w ]*\n-{3,}\n|\Z)", re.DOTALL | re.MULTILINE
)
"""A headed section of a docstring."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages of the top level, and the gallery, to the site."""
    for source, target in TOP_LEVEL.items():
        files.append(File.generated(config, target, content=(ROOT / source).read_text("utf-8")))
    for picture in sorted((ROOT / PICTURES).iterdir()):
        files.append(
            File.generated(config, f"{PICTURES}/{picture.name}", content=picture.read_bytes())
        )
    return files


def on_page_markdown(markdown: str, *, page: Page, **_: Any) -> str:
    """Point links to where the site has their targets; source files become plain code."""
    source = {target: name for name, target in TOP_LEVEL.items()}.get(page.file.src_uri)
    folder = ROOT if source else (ROOT / "docs" / page.file.src_uri).parent

    def point(match: re.Match[str]) -> str:
        mark, text, target, anchor = match.groups()
        if "://" in target:
            return match[0]
        path = (folder / target).resolve().relative_to(ROOT).as_posix()
        if path in TOP_LEVEL:
            place = TOP_LEVEL[path]
        elif path.startswith("docs/"):
            place = path.removeprefix("docs/")
        elif path.startswith(PICTURES):
            place = path
        else:
            return f"`{path}`" if mark else text if "`" in text else f"`{text}`"
        up = "../" * page.file.src_uri.count("/")
        return f"{mark}[{text}]({up}{place}{anchor or ''})"

    return LINK.sub(point, markdown)


class Sections(griffe.Extension):
    """Turns the sections of a docstring ("Parameters" and so on) into lists."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Rewrite the docstring of an object as Markdown."""
        if obj.docstring is not None:
            obj.docstring.value = SECTION.sub(list_entries, obj.docstring.value)


def list_entries(match: re.Match[str]) -> str:
    """A section with a bold heading and a list entry for each line that is not indented."""
    lines = match[2].strip("\n").split("\n")
    entries = [re.sub(r"^(?=\S)", "- ", re.sub(r"^([\w, ]+)(?=: )", r"`\1`", x)) for x in lines]
    return f"**{match[1]}**\n\n" + "\n".join(entries) + "\n\n"
