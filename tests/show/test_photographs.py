"""Photographs show what is where: known points project onto their colours; forces against the
sensor."""

import numpy as np
import pytest
from support.browser import hue_share
from support.pr2_reaches import ARM as PR2
from support.pr2_reaches import SCENARIO as SPHERES
from support.pr2_reaches import felt, spheres
from support.reaches import free_space
from support.worlds import ARM, cylinder, make_clutter

from lic_drake.reach.trace import SceneState
from lic_drake.show.photographs import Photograph, Photographer
from lic_drake.show.stills import PLANAR_VIEWS, PR2_VIEWS

pytestmark = pytest.mark.usefixtures("_renderer")

P_WG = np.array([0.62, -0.3, 0.0])
Q = np.array([-0.6, 1.0, 0.5])


def at_rest(q: np.ndarray, p_WO: np.ndarray) -> SceneState:
    return SceneState(q=q, v=np.zeros(len(q)), p_WO=p_WO, v_WO=np.zeros_like(p_WO))


def color_at(photograph: Photograph, p_WQ: np.ndarray) -> np.ndarray:
    """Mean colour of the 3 x 3 pixels where a point of W appears, 0 to 1."""
    column, row = np.rint(photograph.image.project(p_WQ[None])[0]).astype(int)
    patch = photograph.image.color[row - 1 : row + 2, column - 1 : column + 2]
    mean: np.ndarray = patch.reshape(-1, 3).mean(axis=0) / 255.0
    return mean


def saturation(color: np.ndarray) -> float:
    return float((color.max() - color.min()) / color.max())


@pytest.fixture(scope="module")
def planar() -> Photographer:
    clutter = make_clutter(
        cylinder(0.5, 0.35, movable=True, radius=0.03), cylinder(0.8, 0.2, radius=0.03)
    )
    return Photographer(free_space(), clutter, P_WG, PLANAR_VIEWS)


def test_things_are_where_they_are_and_move(planar: Photographer) -> None:
    p_WO = np.array([[0.5, 0.35]])
    photograph = planar.take("", np.zeros(3), at_rest(Q, p_WO))
    red, green, blue = color_at(photograph, P_WG)
    assert blue > red + 0.3 and green > red + 0.2, "the goal"
    movable, fixed = np.array([0.5, 0.35, 0.099]), np.array([0.8, 0.2, 0.099])
    for top in (movable, fixed):
        assert saturation(color_at(photograph, top)) > 0.3
        assert color_at(photograph, top)[0] == color_at(photograph, top).max()
    assert color_at(photograph, movable)[1] > 1.4 * color_at(photograph, fixed)[1]
    assert 0.4 < photograph.image.color.mean() / 255.0 < 0.85, "good light"

    # The object moves, and the arm with its base.
    p_WR, away = np.array([0.0, 0.3, 0.0]), np.array([0.3, 0.5])
    p_WE = ARM.tip_position(Q) + p_WR
    moved = planar.take("", p_WR, at_rest(Q, away[None]))
    assert saturation(color_at(moved, movable)) < 0.1
    assert saturation(color_at(moved, np.array([*away, 0.099]))) > 0.3
    assert np.abs(color_at(moved, p_WE) - color_at(photograph, p_WE)).max() > 0.05
    assert len(photograph.f_W) == len(moved.f_W) == 0


def test_forces_point_from_objects_to_the_arm(planar: Photographer) -> None:
    # The movable object, its radius 30 mm, 2 mm deep in the middle of the last link.
    origins = ARM.kinematics.link_origins(Q)
    middle, along = 0.5 * (origins[-2] + origins[-1]), origins[-1] - origins[-2]
    aside = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    radius = ARM.skin[-1].radius
    for side in (1.0, -1.0):
        p_WO = middle + side * (radius + 0.03 - 0.002) * aside
        photograph = planar.take("", np.zeros(3), at_rest(Q, p_WO[None]))
        ((fx, fy, fz),) = photograph.f_W
        assert np.hypot(fx, fy) > 1.0
        np.testing.assert_allclose([fx, fy] / np.hypot(fx, fy), -side * aside, atol=0.02)
        assert abs(fz) < 0.02 * np.hypot(fx, fy)
        contact = middle + side * radius * aside
        np.testing.assert_allclose(photograph.p_WC[0][:2], contact, atol=0.004)


def test_a_pr2_stands_where_it_stands_and_feels_what_its_skin_feels() -> None:
    b0 = np.array([0.0, 0.1, SPHERES.task.torso_m])
    q = PR2.q_home
    R_RL, p_RL = PR2.link_poses(q)
    # A ball 3 mm deep in the lower face of the forearm.
    forearm = PR2.link_names.index("r_forearm_roll_link")
    down = -R_RL[forearm][:, 2]
    hit = p_RL[forearm] + R_RL[forearm] @ np.array([0.236, 0.0, -0.0445])
    ball, aside = hit + (0.05 - 0.003) * down, np.array([0.0, 0.1, 0.0])
    photographer = Photographer(
        SPHERES, spheres(ball + aside), np.array([0.84, -0.2, 0.9]), PR2_VIEWS
    )
    overview = photographer.take("", b0, at_rest(q, np.zeros((0, 3))))
    _, sensor = felt(spheres(ball), q)
    assert sensor.sum() > 1.0
    (f_W,), (p_WC,) = overview.f_W, overview.p_WC
    assert np.linalg.norm(f_W) == pytest.approx(sensor.sum(), rel=0.1)
    np.testing.assert_allclose(f_W / np.linalg.norm(f_W), -down, atol=0.02)
    np.testing.assert_allclose(p_WC, hit + aside, atol=0.003)
    image = overview.image.color / 255.0
    assert hue_share(image, 0, 50) > 1e-4, "ball"
    # The robot stands between floor and sky: white, grey and black.
    assert np.mean(image.min(axis=2) > 0.9) > 0.002
    assert np.mean(image.max(axis=2) < 0.2) > 0.002
