import base64
import gzip
import re
from pathlib import Path

import numpy as np
import pytest
from support.browser import assert_shows_a_scene, visit
from support.reaches import reach_request, small_clutter

from lic_drake.errors import LicError
from lic_drake.reach.rollout import instance_of, simulate_request
from lic_drake.show.embed import EmbeddedRecording, pack, read_page
from lic_drake.show.recording import ReachRecording


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    request = reach_request(small_clutter(0.4))
    drawing = ReachRecording(request.scenario, instance_of(request))
    trace = simulate_request(request, keep_states=True).trace
    drawing.add_reach(trace, np.array(request.goal))
    path = tmp_path_factory.mktemp("recording") / "a <reach>.html"
    drawing.save(path)
    return path


def test_packing_is_undone_by_what_any_gzip_reader_does() -> None:
    page = "<p>größer &amp; 'kleiner'</p>\n" * 1000
    assert gzip.decompress(base64.b64decode(pack(page))).decode() == page
    assert pack(page) == pack(page)
    assert len(pack(page)) < 0.1 * len(page)


def test_a_frame_holds_the_whole_recording_and_nothing_from_elsewhere(recording: Path) -> None:
    text = EmbeddedRecording(recording)._repr_html_()
    (packed,) = re.findall(r"'([\w+/]{1000,}=*)'", text)
    assert gzip.decompress(base64.b64decode(packed)).decode() == recording.read_text("utf-8")
    assert not re.search(r"(src|href)\s*=", text)
    assert 'title="a &lt;reach&gt;"' in text
    assert len(text) < 0.5 * recording.stat().st_size


def test_what_is_no_recording_is_one_clear_error(tmp_path: Path) -> None:
    (tmp_path / "picture.png").write_bytes(b"\x89PNG\xff\xfe")
    for path in (tmp_path / "none.html", tmp_path, tmp_path / "picture.png"):
        with pytest.raises(LicError, match=str(path)):
            read_page(path)


@pytest.mark.slow
@pytest.mark.browser
def test_a_browser_plays_it_inside_another_page(
    recording: Path, tmp_path: Path, chromium: str
) -> None:
    page = tmp_path / "notebook.html"
    frame = EmbeddedRecording(recording, height_px=700)._repr_html_()
    page.write_text(f"<!DOCTYPE html><html><body>{frame}</body></html>", encoding="utf-8")
    image, console = visit(chromium, f"file://{page}", tmp_path)
    assert console == []
    assert_shows_a_scene(image[60:])
