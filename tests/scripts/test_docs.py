"""The documentation site is whole: every page that it leads to is there, with every picture."""

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from support.browser import visit

from lic_drake.errors import LicError
from scripts.docs.run import CHECKOUT, PAGES, ROOMS, page_of, relink, write_pages


class Links(HTMLParser):
    """What a page links to and shows, and the anchors that it has."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.links: set[str] = set()
        self.anchors: set[str] = set()
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name in ("href", "src") and value and not re.match("[a-z]+:", value):
                self.links.add(value)
            if name == "id" and value:
                self.anchors.add(value)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("docs")
    write_pages(out)
    return out


def test_every_link_and_anchor_of_every_page_exists(site: Path) -> None:
    pages = {page.resolve(): Links(page) for page in site.rglob("*.html")}
    api = {site.resolve() / f"lic_drake/{room}.html" for room in ROOMS}
    api.add(site.resolve() / "lic_drake.html")
    missing = []
    for page, found in pages.items():
        for link in found.links:
            path, _, anchor = link.partition("#")
            target = (page.parent / path).resolve() if path else page
            there = target.is_file() or target in api
            if not there or (anchor and anchor not in pages[target].anchors):
                missing.append(f"{page.relative_to(site.resolve())}: {link}")
    assert missing == []


def test_the_start_leads_to_everything_and_everything_back(site: Path) -> None:
    start = Links(site / "index.html").links
    assert {str(page_of(Path(source))) for source in PAGES.values()} <= start
    assert {f"lic_drake/{room}.html" for room in ROOMS} | {"lic_drake.html"} <= start
    assert "../index.html" in Links(site / "notebooks" / "README.md.html").links


def test_a_notebook_is_shown_with_its_pictures(site: Path) -> None:
    for notebook in (CHECKOUT / "notebooks").glob("*.ipynb"):
        page = (site / "notebooks" / f"{notebook.name}.html").read_text(encoding="utf-8")
        stored = notebook.read_text(encoding="utf-8").count('"image/png"')
        assert page.count('src="data:image/png;base64,') == stored > 0


def test_a_link_that_leads_nowhere_is_refused() -> None:
    with pytest.raises(LicError, match=r"README\.md: the link to nowhere\.md"):
        relink('<a href="nowhere.md">', Path("README.md"))


@pytest.mark.browser
@pytest.mark.parametrize("page", ["index.html", "notebooks/5_choosing.ipynb.html"])
def test_a_page_shows_in_a_browser_what_it_has(
    page: str, site: Path, tmp_path: Path, chromium: str
) -> None:
    picture, console = visit(chromium, f"file://{site / page}", tmp_path)
    assert console == []  # A picture that is missing would be named here.
    assert picture.std() > 0.1
