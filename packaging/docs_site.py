"""Hook of mkdocs: pages of the site for what documents name outside docs, and links as in a checkout.

README.md is the first page.  A Markdown file outside docs becomes a page, a text file a page with its text, a folder a
page with the list of its files.  Links between them are relative to the repository, as on the page of a repository; the
hook translates them, and mkdocs checks the result.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[1]
DOCS, HOME, OUTSIDE = PurePosixPath("docs"), PurePosixPath("README.md"), PurePosixPath("files")
#: A link in Markdown: its target and its anchor.
LINK = re.compile(r"(?<=\]\()([^)\s#:]+)((?:#[^)\s]*)?\))")
LIST_ITEM = re.compile(r"([-*]|\d+\.) ")
LANGUAGES = {".py": "python", ".toml": "toml", ".service": "ini", ".rules": "text", ".csv": "text", ".dbc": "text"}
MAX_PAGE_BYTES = 100_000


def on_files(files: Files, *, config: MkDocsConfig) -> Files:
    """Add the pages for files outside docs that a page names, directly or by another one of them."""
    origins = {origin_of(file.src_uri): file for file in files if file.src_uri.endswith(".md")}
    waiting = [HOME, *origins]
    while waiting:
        origin = waiting.pop()
        if origin not in origins:
            file = File.generated(config, str(page_of(origin)), content=_page_text(origin))
            files.append(file)
            origins[origin] = file
        waiting += [target for target in _named(origin) if target not in origins and target not in waiting]
    return files


def on_page_markdown(markdown: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Translate the links of a page, and separate its lists from their paragraphs."""
    del config, files
    return "\n".join(_with_indented_lists(_translated(markdown, page.file.src_uri)))


def _translated(markdown: str, page: str) -> str:
    origin = origin_of(page)

    def translate(match: re.Match[str]) -> str:
        target = _resolve(origin, match[1])
        if target is None:
            return match[0]
        place = page_of(target) if _becomes_page(target) else target.relative_to(DOCS)
        return os.path.relpath(place, PurePosixPath(page).parent) + match[2]

    return LINK.sub(translate, markdown)


def _with_indented_lists(markdown: str) -> Iterator[str]:
    """The lines as Python's Markdown needs them: an empty line before a list, four columns for what is in an item."""
    is_list, moved_code = False, -1  # moved_code : columns by which the lines of an open block of code are moved
    begins_with_item: bool | None = None  # of the paragraph; None: between two
    for line in markdown.split("\n"):
        text = line.lstrip()
        if moved_code >= 0:
            yield " " * moved_code + line
            moved_code = -1 if text.startswith("```") else moved_code
            continue
        is_item, indent = LIST_ITEM.match(text) is not None, len(line) - len(text)
        if is_item and begins_with_item is False:
            yield ""
        if text:
            is_list = is_item or (is_list and indent > 1)
            begins_with_item = is_item if is_item or begins_with_item is None else begins_with_item
        else:
            begins_with_item = None
        moved = indent // 2 * 4 - indent if is_list else 0
        moved_code = moved if text.startswith("```") else -1
        yield " " * moved + line


def page_of(origin: PurePosixPath) -> PurePosixPath:
    """The page for a path in the repository."""
    if origin == HOME:
        return PurePosixPath("index.md")
    inside = origin.relative_to(DOCS) if origin.is_relative_to(DOCS) else OUTSIDE / origin
    if (ROOT / origin).is_dir():
        return inside / "index.md"
    return inside if origin.suffix == ".md" else inside.with_name(f"{inside.name}.md")


def origin_of(page: str) -> PurePosixPath:
    """The path in the repository that a page shows."""
    if page == "index.md":
        return HOME
    path = PurePosixPath(page)
    origin = path.relative_to(OUTSIDE) if path.is_relative_to(OUTSIDE) else DOCS / path
    if origin.name == "index.md":
        return origin.parent
    return origin if (ROOT / origin).exists() else origin.with_suffix("")


def _resolve(origin: PurePosixPath, link: str) -> PurePosixPath | None:
    """The path in the repository that a link names; None if there is none."""
    folder = origin if (ROOT / origin).is_dir() else origin.parent
    target = PurePosixPath(os.path.normpath(folder / link))
    return target if ".." not in target.parts and (ROOT / target).exists() else None


def _becomes_page(target: PurePosixPath) -> bool:
    """Pictures of docs are copied as they are."""
    return target.suffix == ".md" or not target.is_relative_to(DOCS) or (ROOT / target).is_dir()


def _named(origin: PurePosixPath) -> Iterator[PurePosixPath]:
    """What the page of a path links to."""
    for match in LINK.finditer(_page_text(origin)):
        target = _resolve(origin, match[1])
        if target is not None and _becomes_page(target):
            yield target


def _page_text(origin: PurePosixPath) -> str:
    path = ROOT / origin
    if path.is_dir():
        return f"# `{origin}`\n\n" + "\n".join(_listed(path)) + "\n"
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".md":
        return text
    return f"# `{origin}`\n\n`````{LANGUAGES.get(path.suffix, 'text')}\n{text}\n`````\n"


def _listed(folder: Path) -> Iterator[str]:
    """A list of the files of a folder; a page of docs by its title."""
    for path in sorted(folder.iterdir()):
        if path.name.startswith((".", "__")) or path.is_symlink():
            continue
        title = path.read_text(encoding="utf-8").splitlines()[0].removeprefix("# ") if path.suffix == ".md" else ""
        is_large = path.is_file() and path.stat().st_size > MAX_PAGE_BYTES
        name = title if folder.is_relative_to(ROOT / DOCS) and title else path.name
        yield f"- {name} ({path.stat().st_size} bytes)" if is_large else f"- [{name}]({path.name})"
