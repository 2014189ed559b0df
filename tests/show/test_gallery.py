import gzip
import html
import re
from base64 import b64decode
from pathlib import Path

import numpy as np
import pytest
from support.browser import assert_shows_a_scene, visit
from support.made_up import planar_library, sphere_library

from lic_drake.cli.main import main
from lic_drake.paths import shipped_library
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.session import run_reach
from lic_drake.show.gallery import HEADS, Exhibit, choose_exhibits, make_gallery, numbers_of
from lic_drake.show.page import embed, make_page, pack, picture


@pytest.fixture(scope="module")
def said() -> list[str]:
    return []


@pytest.fixture(scope="module")
def exhibits(tmp_path_factory: pytest.TempPathFactory, said: list[str]) -> list[Exhibit]:
    scenario = load_scenario("passage-clutter", "{stop: {timeout_s: 3.0, success_distance_m: 0.2}}")
    library = planar_library(tmp_path_factory.mktemp("passages") / "library", scenario)
    with pytest.MonkeyPatch.context() as patched:  # Stills take most of the time.
        patched.setattr("lic_drake.show.pictures.save_rendered", lambda *args: {})
        return choose_exhibits(library, "cost", say=said.append)


def test_a_success_and_a_failure_are_shown_and_none_is_left_out_before_them(
    exhibits: list[Exhibit],
) -> None:
    success, failure = exhibits
    assert success.success and success.attempts[-1].record.outcome == "reached"
    assert not failure.success and len(failure.attempts) == 2
    assert not any(attempt.record.success for attempt in failure.attempts)
    # Environments are taken in order: the first of all is one of the two.
    assert min(success.environment, failure.environment) == 0
    for attempt in failure.attempts:
        assert run_reach(attempt.request) == attempt.record


def test_every_trial_is_said_with_its_outcomes_and_how_many_are_done(
    exhibits: list[Exhibit], said: list[str]
) -> None:
    lines = [line for line in said if "environment" in line]
    last = max(exhibit.environment for exhibit in exhibits)
    assert [line.partition(":")[0] for line in lines] == [
        f"planar-arm in passage-clutter, environment {i}" for i in range(last + 1)
    ]
    assert lines[0].endswith("; 1 of 2 trials") and lines[-1].endswith("; 2 of 2 trials")
    for exhibit in exhibits:
        outcomes = ", ".join(attempt.record.outcome for attempt in exhibit.attempts)
        assert f": {outcomes}; " in lines[exhibit.environment]


@pytest.mark.usefixtures("_coarse", "_renderer")
def test_a_pr2_shows_its_apertures_and_stills_of_both_attempts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lic_drake.show.gallery.MAX_ENVIRONMENTS", 1)
    library = sphere_library(tmp_path / "library")
    (exhibit,) = choose_exhibits(library, "knn", say=lambda line: None)
    assert exhibit.name == "pr2-sphere-aperture-clutter-0" and not exhibit.success
    moments = ("start", "middle", "end", "inside")
    stills = {f"attempt {i} {moment}" for i in (1, 2) for moment in moments}
    assert set(exhibit.pictures) == {"path", "apertures"} | stills
    page = make_gallery([exhibit], "knn")
    shown = [b64decode(text) for text in re.findall(r"webp;base64,([^\"]*)", page)]
    assert sorted(shown) == sorted(exhibit.pictures.values())
    assert page.count("<h3>Attempt ") == 2


def test_the_page_holds_everything_and_needs_nothing(exhibits: list[Exhibit]) -> None:
    page = make_gallery(exhibits, "cost")
    # Nothing is fetched from anywhere: every source is in the page.
    sources = re.findall(r'\b(?:src|href)\s*=\s*"?([^\s">]{1,30})', page)
    assert sources and all(source.startswith("data:image/webp;base64,") for source in sources)
    assert not re.search(r"https?://|@import|url\(", page)
    packed = re.findall(r"'([\w+/]{100,}=*)'", page)
    pages = [gzip.decompress(b64decode(text)).decode() for text in packed]
    assert pages == [exhibit.recording for exhibit in exhibits]
    shown = [b64decode(text) for text in re.findall(r"webp;base64,([^\"]*)", page)]
    pictures = [picture for exhibit in exhibits for picture in exhibit.pictures.values()]
    assert sorted(shown) == sorted(pictures)
    assert all(picture[8:12] == b"WEBP" for picture in pictures)
    # COST estimates nothing.
    assert all("path" in exhibit.pictures for exhibit in exhibits)
    assert not any("density" in exhibit.pictures for exhibit in exhibits)


def test_the_page_s_numbers_are_those_of_the_records(exhibits: list[Exhibit]) -> None:
    page = make_gallery(exhibits, "cost")
    rows = re.findall(r"<tr>((?:<td>.*?</td>)+)</tr>", page)
    cells = [[html.unescape(c) for c in re.findall(r"<td>(.*?)</td>", row)] for row in rows]
    attempts = [(i, a) for e in exhibits for i, a in enumerate(e.attempts, start=1)]
    assert len(cells) == len(attempts)
    for row, (number, attempt) in zip(cells, attempts, strict=True):
        assert len(row) == len(HEADS)
        assert row[0] == str(number)
        assert row[1].startswith(f"y {attempt.record.start_y:+.3f} m, phi")
        assert row[2] == "–"  # COST estimates nothing.
        assert row[3] == attempt.record.outcome
        assert float(row[6]) == pytest.approx(attempt.record.peak_force, abs=0.05)
        assert numbers_of(number, attempt)["estimated_success"] is None


def test_pages_escape_text_and_hold_what_they_are_given() -> None:
    page = "<p>größer &amp; 'kleiner'</p>\n" * 1000
    assert gzip.decompress(b64decode(pack(page))).decode() == page
    assert len(pack(page)) < 0.1 * len(page)
    text = embed(page, "a <reach>")
    (packed,) = re.findall(r"'([\w+/]{100,}=*)'", text)
    assert packed == pack(page)
    assert not re.search(r"(src|href)\s*=", text)
    assert 'title="a &lt;reach&gt;"' in text
    whole = make_page("a < b", picture(b"\x89PNG", "image/png", "c > d"), "x {}")
    for part in ("<h1>a &lt; b</h1>", "c &gt; d</figcaption>", "x {}</style>"):
        assert part in whole


@pytest.mark.slow
@pytest.mark.browser
def test_a_browser_shows_the_gallery_and_plays_what_its_address_asks_for(
    tmp_path: Path, chromium: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lic_drake.show.pictures.save_rendered", lambda *args: {})
    library = str(shipped_library("cylinder-clutter"))
    assert main(["gallery", str(tmp_path), "--method", "cost", "--library", library]) == 0
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    name = re.findall(r'<section id="([^"]*)"', page)[0]
    # Tall enough for the whole page, which would be scrolled otherwise.
    closed, console = visit(chromium, f"file://{tmp_path / 'index.html'}", tmp_path, (1200, 3000))
    assert console == []
    playing, console = visit(
        chromium, f"file://{tmp_path / 'index.html'}#{name}", tmp_path, (1200, 3000)
    )
    assert console == []
    assert_shows_a_scene(playing[340:810])
    controls = np.s_[340:355, 950:1150]  # Those of the recording are closed, a black bar.
    assert np.median(playing[controls]) < 0.1 < 0.9 < np.median(closed[controls])
