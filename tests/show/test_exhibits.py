import base64
import gzip
import html
import re
from pathlib import Path

import pytest
from support.browser import assert_shows_a_scene, visit

from lic_drake.cli.main import main
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_libraries, shipped_library
from lic_drake.reach.rollout import run_reach
from lic_drake.show.exhibits import Exhibit, choose_exhibits
from lic_drake.show.gallery_page import HEADS, make_page, numbers_of


@pytest.fixture(scope="module")
def exhibits() -> list[Exhibit]:
    return choose_exhibits(
        ExperienceLibrary(shipped_library("passage-clutter")), "cost", say=lambda line: None
    )


def test_a_success_and_a_failure_are_shown_and_none_is_left_out_before_them(
    exhibits: list[Exhibit],
) -> None:
    success, failure = exhibits
    assert success.success and success.attempts[-1].record.outcome == "reached"
    assert not failure.success and len(failure.attempts) == 2
    assert not any(attempt.record.success for attempt in failure.attempts)
    # Environments are taken in order: the first of all is one of the two.
    assert min(success.environment, failure.environment) == 0


def test_what_is_shown_is_what_was_simulated(exhibits: list[Exhibit]) -> None:
    for attempt in exhibits[1].attempts:
        assert run_reach(attempt.request) == attempt.record


def test_the_page_holds_everything_and_needs_nothing(exhibits: list[Exhibit]) -> None:
    page = make_page(exhibits, "cost")
    # Nothing is fetched from anywhere: every source is in the page.
    sources = re.findall(r'\b(?:src|href)\s*=\s*"?([^\s">]{1,30})', page)
    assert sources and all(source.startswith("data:image/png;base64,") for source in sources)
    assert not re.search(r"https?://|@import|url\(", page)
    packed = re.findall(r'<script type="text/plain"[^>]*>([^<]*)</script>', page)
    pages = [gzip.decompress(base64.b64decode(text)).decode() for text in packed]
    assert pages == [exhibit.recording for exhibit in exhibits]
    for text in pages:
        assert not re.search(r"<(script|link|img|iframe)[^>]*(src|href)\s*=", text)
    stills = [base64.b64decode(text) for text in re.findall(r"png;base64,([^\"]*)", page)]
    assert stills == [exhibit.still for exhibit in exhibits]
    assert all(still.startswith(b"\x89PNG") for still in stills)


def test_the_page_s_numbers_are_those_of_the_records(exhibits: list[Exhibit]) -> None:
    page = make_page(exhibits, "cost")
    rows = re.findall(r"<tr>((?:<td>.*?</td>)+)</tr>", page)
    cells = [[html.unescape(c) for c in re.findall(r"<td>(.*?)</td>", row)] for row in rows]
    attempts = [(i, a) for e in exhibits for i, a in enumerate(e.attempts, start=1)]
    assert len(cells) == len(attempts)
    for row, (number, attempt) in zip(cells, attempts, strict=True):
        assert len(row) == len(HEADS)
        assert row[0] == str(number)
        assert row[5] == attempt.record.outcome
        assert float(row[1]) == pytest.approx(attempt.record.start_y, abs=5e-4)
        assert float(row[8]) == pytest.approx(attempt.record.peak_force, abs=0.05)
        assert row[4] == "–"  # COST estimates nothing.
        assert numbers_of(number, attempt)["estimated_success"] is None


def test_the_shipped_libraries_are_found() -> None:
    assert {path.name for path in shipped_libraries()} >= {
        *("cylinder-clutter", "passage-clutter", "cylinder-aperture-clutter")
    }


@pytest.mark.slow
@pytest.mark.browser
def test_a_browser_shows_the_gallery_and_plays_what_its_address_asks_for(
    tmp_path: Path, chromium: str
) -> None:
    library = str(shipped_library("cylinder-clutter"))
    assert main(["gallery", str(tmp_path), "--method", "cost", "--library", library]) == 0
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    name = re.findall(r'<section id="([^"]*)"', page)[0]
    # Tall enough for the whole page, which would be scrolled otherwise.
    closed, console = visit(chromium, f"file://{tmp_path / 'index.html'}", tmp_path, (1200, 2200))
    assert console == []
    playing, console = visit(
        chromium, f"file://{tmp_path / 'index.html'}#{name}", tmp_path, (1200, 2200)
    )
    assert console == []
    scene = playing[:1000, 620:1140]
    assert_shows_a_scene(scene)
    with pytest.raises(AssertionError):
        assert_shows_a_scene(closed[:1000, 620:1140])
