"""The site of the documentation: every link, anchor and resource in its pages exists, without the network."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from tests.helpers import ROOT
from tests.web.chromium import Chromium

#: Attributes with which a page loads something; other links only lead to another page.
LOADING = {("img", "src"), ("script", "src"), ("link", "href"), ("iframe", "src"), ("source", "src")}


@dataclass
class Html(HTMLParser):
    """The links, resources and anchors of a page, and its text by paragraph."""

    links: list[str] = field(default_factory=list)
    resources: list[str] = field(default_factory=list)
    anchors: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        super().__init__()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if value and name in ("id", "name"):
                self.anchors.add(value)
            elif value and (tag, name) in LOADING:
                self.resources.append(value)
            elif value and (tag, name) == ("a", "href"):
                self.links.append(value)


def build(docs: Path | None, site: Path) -> subprocess.CompletedProcess[str]:
    """The site; docs : another folder of documents."""
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(site)]
    env = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    return subprocess.run(command, cwd=docs or ROOT, env=env, capture_output=True, text=True, check=False, timeout=300)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    done = build(None, folder)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Html]:
    found = {}
    for file in sorted(site.rglob("*.html")):
        found[file] = Html()
        found[file].feed(file.read_text(encoding="utf-8"))
    return found


def is_external(address: str) -> bool:
    return bool(urlsplit(address).scheme or urlsplit(address).netloc)


def fault_of(address: str, page: Path, pages: dict[Path, Html]) -> str:
    """What is wrong with a local address; "" if nothing is."""
    parts = urlsplit(address)
    target = Path(os.path.normpath(page.parent / unquote(parts.path))) if parts.path else page
    if not target.is_file():
        return f"{page.name}: {address}: no such file"
    if parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].anchors:
        return f"{page.name}: {address}: no such anchor"
    return ""


def test_every_document_is_a_page(site: Path, pages: dict[Path, Html]) -> None:
    documents = {file.relative_to(ROOT / "docs").with_suffix(".html") for file in (ROOT / "docs").rglob("*.md")}
    outside = {Path("index.html"), Path("files/CHANGELOG.html"), Path("files/configs/demo.toml.html")}
    assert documents | outside <= {page.relative_to(site) for page in pages}


def test_every_local_link_and_anchor_exists(pages: dict[Path, Html]) -> None:
    checked = [
        fault_of(address, page, pages)
        for page, html in pages.items()
        if page.name != "404.html"  # its links begin at the root of a server
        for address in (*html.links, *html.resources)
        if not is_external(address)
    ]
    assert len(checked) > 1000
    assert [fault for fault in checked if fault] == []


def test_nothing_is_loaded_from_elsewhere(site: Path, pages: dict[Path, Html]) -> None:
    assert [address for html in pages.values() for address in html.resources if is_external(address)] == []
    for sheet in site.rglob("*.css"):
        assert re.findall(r"(?:url\(|@import )[\"']?(?:https?:)?//[^)\"' ]*", sheet.read_text(encoding="utf-8")) == []


def test_lists_and_tables_are_recognised(pages: dict[Path, Html]) -> None:
    """A list or table directly below a paragraph is one on the page of a repository, and text here."""
    for page in pages:
        text = re.sub(r"<pre.*?</pre>", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
        for paragraph in re.findall(r"<p>(.*?)</p>", text, re.DOTALL):
            assert not re.search(r"^(- |\d+\. |\| |---)|\|---", paragraph, re.MULTILINE), (page.name, paragraph[:200])


@pytest.mark.browser
async def test_the_search_finds_a_key_without_a_server(site: Path) -> None:
    async with Chromium() as browser:
        page = await browser.open((site / "index.html").as_uri())
        await page.wait_for("document.querySelector('[data-md-component=search-query]') !== null")
        await page.eval("document.querySelector('[data-md-component=search-query]').focus()")
        await page.type_text("max_dispersion")
        found = "[...document.querySelectorAll('.md-search-result__link')].map((link) => link.href).join(' ')"
        assert await page.wait_for(f"/reference.configuration.html.*#devicealtimeter/.test({found})")


def test_a_broken_link_stops_the_build(tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    (copy / "docs").mkdir(parents=True)
    (copy / "docs" / "index.md").write_text("# Here\n\n[there](there.md)\n", encoding="utf-8")
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    hooks, nav = text.index("\nhooks:"), text.index("\nnav:")
    (copy / "mkdocs.yml").write_text(text[:hooks] + text[text.index("\nmarkdown_extensions:") : nav], encoding="utf-8")
    done = build(copy, tmp_path / "site")
    assert done.returncode != 0
    assert "there.md" in done.stdout + done.stderr
