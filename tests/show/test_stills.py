"""Stills show what is where: points appear in their colours, forces as the sensor feels them."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread
from PIL import Image
from support.browser import hue_share
from support.kinematics import link_origins
from support.pr2_reaches import ARM as PR2
from support.pr2_reaches import SCENARIO as SPHERES
from support.pr2_reaches import felt, spheres
from support.reaches import free_space, reach_request, small_clutter
from support.worlds import ARM, cylinder, make_clutter

from lic_drake.errors import LicError, RenderingError
from lic_drake.evaluate.trial import Attempt
from lic_drake.perception.image import CameraImage
from lic_drake.reach.session import instance_of, make_record, simulate_request
from lic_drake.reach.trace import ReachTrace, SceneState
from lic_drake.robots.pr2 import Q_HOME
from lic_drake.select.situation import Selection
from lic_drake.show.figures import ShownTrial
from lic_drake.show.film import film_frames, save_film
from lic_drake.show.pictures import save_rendered
from lic_drake.show.stills import CAMERA, Still, StillCamera, draw_still, save_stills

P_WG = np.array([0.62, -0.3, 0.0])
Q = np.array([-0.6, 1.0, 0.5])
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


def shown(attempts: list[tuple[Attempt, ReachTrace]]) -> ShownTrial:
    done, traces = [done for done, _ in attempts], [trace for _, trace in attempts]
    return ShownTrial(
        scenario=REQUEST.scenario,
        instance=instance_of(REQUEST),
        p_WG=REQUEST.goal,
        attempts=done,
        traces=traces,
    )


@pytest.mark.usefixtures("_renderer")
def test_each_attempt_has_a_start_a_middle_and_an_end(
    attempt: tuple[Attempt, ReachTrace], tmp_path: Path
) -> None:
    never = (attempt[0], ReachTrace())
    camera = StillCamera(REQUEST.scenario, instance_of(REQUEST), REQUEST.goal)
    files = save_stills(shown([attempt, never]), camera, tmp_path)
    names = [f"attempt1_{name}.png" for name in ("start", "middle", "end")]
    assert [path.name for path in files.values()] == names
    start, middle, end = (imread(path)[..., :3] for path in files.values())
    assert start.shape == (720, 960, 3)
    # The arm has moved.
    assert np.mean(np.abs(start - end).max(axis=2) > 0.1) > 0.01
    # At its hardest, and only where it touches, there is an arrow.
    assert crimson(middle) > 1e-4
    assert crimson(start) < 1e-5


@pytest.mark.usefixtures("_renderer", "_coarse")
def test_a_film_shows_all_attempts_from_start_to_end_and_holds_their_ends(
    attempt: tuple[Attempt, ReachTrace], tmp_path: Path
) -> None:
    trial = shown([attempt, attempt])
    frames = film_frames(trial)
    half, odd = divmod(len(frames), 2)
    assert half > 2 and not odd
    assert [i for i, f in enumerate(frames) if f.duration_ms == 1500] == [half - 1, len(frames) - 1]
    begin, end = (frame.picture.astype(float) for frame in (frames[0], frames[half - 1]))
    assert np.mean(np.abs(begin - end).max(axis=2) > 25.0) > 0.01
    # Between the attempts only the caption and the objects that were moved differ.
    np.testing.assert_array_equal(frames[half].picture[60:], frames[0].picture[60:])
    save_film(frames, tmp_path / "film.webp")
    with Image.open(tmp_path / "film.webp") as film:
        assert getattr(film, "n_frames", 1) == len(frames)
        assert film.size == begin.shape[1::-1]
    with pytest.raises(LicError, match="cannot write"):
        save_film(frames, tmp_path / "missing" / "film.webp")


def crimson(image: np.ndarray) -> float:
    return float(np.mean(np.all(np.abs(image - [0.863, 0.078, 0.235]) < 0.06, axis=2)))


def test_without_a_renderer_a_line_says_what_to_install(
    attempt: tuple[Attempt, ReachTrace], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*args: object) -> None:
        raise RenderingError("cameras cannot be simulated; install it with: apt-get x")

    monkeypatch.setattr("lic_drake.show.stills.make_renderer", broken)
    lines: list[str] = []
    assert save_rendered(shown([attempt]), tmp_path, lines.append) == {}
    (line,) = lines
    assert line == "no stills and no film: cameras cannot be simulated; install it with: apt-get x"
    assert list(tmp_path.iterdir()) == []


def test_arrows_are_forces_to_scale_but_for_the_largest() -> None:
    image = CameraImage(
        color=np.full((CAMERA.height, CAMERA.width, 3), 200, dtype=np.uint8),
        depth=np.full((CAMERA.height, CAMERA.width), np.nan),
        focal_px=1000.0,
        R_WC=np.eye(3),
        p_WC=np.zeros(3),
    )
    forces = np.array([[2.0, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, -100.0, 0.0]])
    points = np.array([[0.0, 0.0, 2.0], [0.1, 0.0, 2.0], [0.0, 0.0, 1.0]])
    ax = draw_still(Still(image, points, forces), "words").axes[0]
    *arrows, words = ax.texts
    middle = np.array([0.5 * CAMERA.width - 0.5, 0.5 * CAMERA.height - 0.5])
    # 2 N at 20 N/m are 0.1 m, which at 2 m are 50 pixels; the small one is left out.
    np.testing.assert_allclose(
        [arrow.xy for arrow in arrows], [middle + [50, 0], middle - [0, 300]]
    )
    assert [arrow.xyann for arrow in arrows] == [tuple(middle)] * 2
    assert words.get_text() == "words; forces on the arm up to 100.0 N"


def at_rest(q: np.ndarray, p_WO: np.ndarray) -> SceneState:
    return SceneState(q=q, v=np.zeros(len(q)), q_clutter=p_WO, v_clutter=np.zeros_like(p_WO))


def color_at(still: Still, p_WQ: np.ndarray) -> np.ndarray:
    """Mean colour of the 3 x 3 pixels where a point of W appears, 0 to 1."""
    column, row = np.rint(still.image.project(p_WQ[None])[0]).astype(int)
    patch = still.image.color[row - 1 : row + 2, column - 1 : column + 2]
    mean: np.ndarray = patch.reshape(-1, 3).mean(axis=0) / 255.0
    return mean


def saturation(color: np.ndarray) -> float:
    return float((color.max() - color.min()) / color.max())


@pytest.fixture(scope="module")
def planar(_renderer: None) -> StillCamera:
    clutter = make_clutter(
        cylinder(0.5, 0.35, movable=True, radius=0.03), cylinder(0.8, 0.2, radius=0.03)
    )
    return StillCamera(free_space(), clutter, P_WG)


def test_things_are_where_they_are_and_move(planar: StillCamera) -> None:
    p_WO = np.array([[0.5, 0.35]])
    still = planar.take("", np.zeros(3), at_rest(Q, p_WO))
    red, green, blue = color_at(still, P_WG)
    assert blue > red + 0.3 and green > red + 0.2, "the goal"
    movable, fixed = np.array([0.5, 0.35, 0.099]), np.array([0.8, 0.2, 0.099])
    for top in (movable, fixed):
        assert saturation(color_at(still, top)) > 0.3
        assert color_at(still, top)[0] == color_at(still, top).max()
    assert color_at(still, movable)[1] > 1.4 * color_at(still, fixed)[1]
    assert 0.4 < still.image.color.mean() / 255.0 < 0.85, "good light"

    # The object moves, and the arm with its base.
    p_WR, away = np.array([0.0, 0.3, 0.0]), np.array([0.3, 0.5])
    p_WE = ARM.calc_pose(Q).p_RE + p_WR
    moved = planar.take("", p_WR, at_rest(Q, away[None]))
    assert saturation(color_at(moved, movable)) < 0.1
    assert saturation(color_at(moved, np.array([*away, 0.099]))) > 0.3
    assert np.abs(color_at(moved, p_WE) - color_at(still, p_WE)).max() > 0.05
    assert len(still.f_W) == len(moved.f_W) == 0


def test_forces_point_from_objects_to_the_arm(planar: StillCamera) -> None:
    # The movable object, its radius 30 mm, 2 mm deep in the middle of the last link.
    origins = link_origins(ARM, Q)
    middle, along = 0.5 * (origins[-2] + origins[-1]), origins[-1] - origins[-2]
    aside = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    radius = ARM.skin[-1].size[0]
    for side in (1.0, -1.0):
        p_WO = middle + side * (radius + 0.03 - 0.002) * aside
        still = planar.take("", np.zeros(3), at_rest(Q, p_WO[None]))
        ((fx, fy, fz),) = still.f_W
        assert np.hypot(fx, fy) > 1.0
        np.testing.assert_allclose([fx, fy] / np.hypot(fx, fy), -side * aside, atol=0.02)
        assert abs(fz) < 0.02 * np.hypot(fx, fy)
        contact = middle + side * radius * aside
        np.testing.assert_allclose(still.p_WC[0][:2], contact, atol=0.004)


@pytest.mark.usefixtures("_renderer")
def test_a_pr2_stands_where_it_stands_and_feels_what_its_skin_feels() -> None:
    b0 = np.array([0.0, 0.1, SPHERES.task.torso_m])
    q = Q_HOME
    R_RL, p_RL = PR2.calc_pose(q)[:2]
    # A ball 3 mm deep in the lower face of the forearm.
    forearm = PR2.link_names.index("r_forearm_roll_link")
    down = -R_RL[forearm][:, 2]
    hit = p_RL[forearm] + R_RL[forearm] @ np.array([0.236, 0.0, -0.0445])
    ball, aside = hit + (0.05 - 0.003) * down, b0
    camera = StillCamera(SPHERES, spheres(ball + aside), np.array([0.84, -0.2, 0.9]))
    overview = camera.take("", b0, at_rest(q, np.zeros((0, 3))))
    _, sensor = felt(spheres(ball), q)
    assert sensor.sum() > 1.0
    (f_W,), (p_WC,) = overview.f_W, overview.p_WC
    assert np.linalg.norm(f_W) == pytest.approx(sensor.sum(), rel=0.1)
    np.testing.assert_allclose(f_W / np.linalg.norm(f_W), -down, atol=0.02)
    np.testing.assert_allclose(p_WC, hit + aside, atol=0.004)
    image = overview.image.color / 255.0
    assert hue_share(image, 0, 50) > 1e-4, "ball"
    # The robot stands between floor and sky: white, grey and black.
    assert np.mean(image.min(axis=2) > 0.9) > 0.002
    assert np.mean(image.max(axis=2) < 0.2) > 0.002
