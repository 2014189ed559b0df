from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, Polygon
from support.ray_casting import blank, tilted

from lic_drake.perception.apertures import DetectedApertures
from lic_drake.perception.goal import DetectedGoal
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.start import Starts
from lic_drake.select.objective import Objective
from lic_drake.select.situation import FailedReach, Situation
from lic_drake.show.apertures import draw_aperture_map, estimate_apertures
from lic_drake.show.detections import STATE_COLORS, draw_apertures, draw_goal
from lic_drake.starts import board_starts

BLOCKED = load_scenario("sphere-aperture-clutter", "{clutter: {num_blocked: 6}}")
STARTS = board_starts(BLOCKED, BLOCKED.sample_instance("holdout", 0))
IMAGE = blank(tilted(0.0), np.array([0.0, 0.0, 1.0]))
CENTRES = np.array([[1.0, 0.1 * k, 1.0] for k in (-2, 0, 2)])
CORNERS = CENTRES[:, None] + 0.05 * np.array([[0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1]])
FOUND = DetectedApertures(
    p_WA=CENTRES,
    covariance=np.zeros((3, 3, 3)),
    corners=CORNERS,
    states=("open", "partly", "blocked"),
    probability_open=np.array([1.0, 0.25, 0.0]),
)


class HeightAlone(Objective):
    """Estimates that are the height of the tool, beyond 1 for the highest."""

    def values(self, conditions: Starts) -> np.ndarray:
        return conditions.x0[:, 2]


def test_the_estimate_of_an_aperture_is_the_best_from_there_as_a_probability() -> None:
    objective = HeightAlone(model=None, p_WG=np.zeros(3))  # type: ignore[arg-type]
    best = estimate_apertures(objective, Situation(p_WG=np.zeros(3), starts=STARTS))
    reachable = np.array(
        [np.any(np.all(np.isclose(STARTS.grid.x0[:, :3], p), axis=1)) for p in STARTS.p_WA]
    )
    np.testing.assert_allclose(best[reachable], np.clip(STARTS.p_WA[reachable, 2], 0.0, 1.0))
    assert np.all(np.isnan(best[~reachable]))


def test_what_failed_is_no_longer_estimated() -> None:
    class First(Objective):
        """Hopes for the first start alone."""

        def values(self, conditions: Starts) -> np.ndarray:
            return np.all(np.isclose(conditions.x0, STARTS.grid.x0[0]), axis=1) * np.all(
                np.isclose(conditions.b0, STARTS.grid.b0[0]), axis=1
            )

    objective = First(model=None, p_WG=np.zeros(3))  # type: ignore[arg-type]
    before = Situation(p_WG=np.zeros(3), starts=STARTS)
    after = replace(before, failed=(FailedReach.from_start(STARTS.grid[0]),))
    assert np.nanmax(estimate_apertures(objective, before)) == 1.0
    assert np.nanmax(estimate_apertures(objective, after)) == 0.0


def test_open_apertures_are_the_brighter_the_more_passable_and_the_chosen_one_is_framed() -> None:
    ax = Figure().subplots()
    probability = np.linspace(0.1, 0.8, len(STARTS.p_WA))
    probability[0] = np.nan
    draw_aperture_map(ax, STARTS, probability, np.array([0.84, -0.1, 0.8]), 3)
    *apertures, frame = [patch for patch in ax.patches if isinstance(patch, Polygon)]
    shades = [patch.get_facecolor()[0] for patch in apertures]
    np.testing.assert_allclose(shades, np.nan_to_num(probability), atol=0.01)
    centres = [patch.get_xy()[:4].mean(axis=0) for patch in apertures]
    np.testing.assert_allclose(centres, STARTS.p_WA[:, 1:])
    np.testing.assert_allclose(frame.get_xy(), apertures[3].get_xy())
    assert [text.get_text() for text in ax.texts] == [f"{value:.2f}" for value in probability[1:]]
    assert ax.xaxis_inverted()  # The robot's left is on the left.


def test_detected_apertures_are_outlined_in_the_colour_of_their_state() -> None:
    ax = draw_apertures(Figure().subplots(), IMAGE, FOUND)
    outlines = [patch for patch in ax.patches if isinstance(patch, Polygon)]
    for patch, corners, state in zip(outlines, CORNERS, FOUND.states, strict=True):
        np.testing.assert_allclose(patch.get_xy()[:4], IMAGE.project(corners))
        assert patch.get_edgecolor() == to_rgba(STATE_COLORS[state])
    assert [text.get_text() for text in ax.texts] == ["1.00", "0.25", "0.00"]


def test_a_detected_goal_is_drawn_as_the_ball_and_two_standard_deviations() -> None:
    # 1 cm along the image's x, that is along -Wy, and 2 cm along its y.
    covariance = np.diag([0.0, 0.01**2, 0.02**2])
    goal = DetectedGoal(p_WG=np.array([1.5, 0.3, 1.2]), covariance=covariance)
    ax = draw_goal(Figure().subplots(), IMAGE, goal, 0.03)
    ball, ellipse = (patch for patch in ax.patches if isinstance(patch, Ellipse))
    scale = IMAGE.focal_px / 1.5
    np.testing.assert_allclose(ball.get_center(), IMAGE.project(goal.p_WG[None])[0])
    assert ball.get_width() == pytest.approx(0.06 * scale)
    assert sorted([ellipse.get_width(), ellipse.get_height()]) == pytest.approx(
        [0.04 * scale, 0.08 * scale]
    )
