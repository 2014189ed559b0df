from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread
from support.reaches import reach_request, small_clutter

from lic_drake.errors import RenderingError
from lic_drake.evaluate.trial import Attempt
from lic_drake.perception.image import CameraImage
from lic_drake.reach.rollout import instance_of, make_record, simulate_request
from lic_drake.reach.trace import ReachTrace
from lic_drake.select.situation import Selection
from lic_drake.show import photographs
from lic_drake.show.photographs import HEIGHT, WIDTH, Photograph
from lic_drake.show.stills import draw_photograph, save_stills

REQUEST = reach_request(small_clutter(2.0), (0.7, 0.0), 0.0, 90.0)


@pytest.fixture(scope="module")
def attempt() -> tuple[Attempt, ReachTrace]:
    result = simulate_request(REQUEST, keep_states=True)
    assert max(result.trace.total_force) > 0.0
    record = make_record(REQUEST, result, 0.0)
    selection = Selection(
        method="rnd",
        start=REQUEST.start,
        probability=None,
        seconds=0.0,
    )
    return Attempt(selection=selection, request=REQUEST, record=record), result.trace


def save(
    attempts: list[tuple[Attempt, ReachTrace]], out: Path, lines: list[str]
) -> dict[str, Path]:
    done, traces = [done for done, _ in attempts], [trace for _, trace in attempts]
    instance = instance_of(REQUEST)
    return save_stills(
        REQUEST.scenario, instance, np.array(REQUEST.goal), done, traces, out, lines.append
    )


@pytest.mark.usefixtures("_renderer")
def test_each_attempt_has_a_start_a_middle_and_an_end(
    attempt: tuple[Attempt, ReachTrace], tmp_path: Path
) -> None:
    (tmp_path / "attempt2_end.png").write_text("of an earlier demonstration")
    (tmp_path / "attempt1_mine.png").write_text("the user's")
    never = (attempt[0], ReachTrace())
    lines: list[str] = []
    files = save([attempt, never], tmp_path, lines)
    names = [f"attempt1_{name}.png" for name in ("start", "middle", "end")]
    assert [path.name for path in files.values()] == names
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*names, "attempt1_mine.png"])
    assert lines == []
    start, middle, end = (imread(path)[..., :3] for path in files.values())
    assert start.shape == (720, 960, 3)
    # The arm has moved.
    assert np.mean(np.abs(start - end).max(axis=2) > 0.1) > 0.01
    # At its hardest, and only where it touches, there is an arrow.
    assert crimson(middle) > 1e-4
    assert crimson(start) < 1e-5


def crimson(image: np.ndarray) -> float:
    return float(np.mean(np.all(np.abs(image - [0.863, 0.078, 0.235]) < 0.06, axis=2)))


def test_without_a_renderer_a_line_says_what_to_install(
    attempt: tuple[Attempt, ReachTrace], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*args: object) -> None:
        raise RenderingError("cameras cannot be simulated; install it with: apt-get install x")

    monkeypatch.setattr(photographs, "make_renderer", broken)
    lines: list[str] = []
    assert save([attempt], tmp_path, lines) == {}
    assert lines == ["no stills: cameras cannot be simulated; install it with: apt-get install x"]
    assert list(tmp_path.iterdir()) == []


def test_arrows_are_forces_to_scale_but_for_the_largest() -> None:
    image = CameraImage(
        color=np.full((HEIGHT, WIDTH, 3), 200, dtype=np.uint8),
        depth=np.full((HEIGHT, WIDTH), np.nan),
        focal_px=1000.0,
        R_WC=np.eye(3),
        p_WC=np.zeros(3),
    )
    forces = np.array([[2.0, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, -100.0, 0.0]])
    points = np.array([[0.0, 0.0, 2.0], [0.1, 0.0, 2.0], [0.0, 0.0, 1.0]])
    ax = draw_photograph(Photograph(image, points, forces), "words").axes[0]
    *arrows, words = ax.texts
    middle = np.array([0.5 * WIDTH - 0.5, 0.5 * HEIGHT - 0.5])
    # 2 N at 20 N/m are 0.1 m, which at 2 m are 50 pixels; the small one is left out.
    np.testing.assert_allclose(
        [arrow.xy for arrow in arrows], [middle + [50, 0], middle - [0, 300]]
    )
    assert [arrow.xyann for arrow in arrows] == [tuple(middle)] * 2
    assert words.get_text() == "words; forces on the arm up to 100.0 N"
