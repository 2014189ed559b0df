from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.patches import Circle, Polygon, Rectangle
from support.reaches import free_space
from support.worlds import ARM, box, corners, cylinder, make_clutter

from lic_drake.errors import LicError
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.trace import ReachTrace
from lic_drake.scene.looks import FIXED_COLOR, MOVABLE_COLOR
from lic_drake.show.plots import ATTEMPT_COLORS, draw_density, draw_top_view, save_figure

Y = np.linspace(-0.4, 0.4, 5)
PHI = np.linspace(-1.5, 1.5, 4)
P_WG = np.array([0.6, 0.1, 0.0])


@pytest.fixture
def ax() -> Axes:
    return Figure(figsize=(4, 4)).subplots()


def lattice() -> tuple[np.ndarray, np.ndarray]:
    """Start poses and a probability that depends on y and phi in different ways."""
    x0 = np.array([[0.335, y, phi] for y in Y for phi in PHI])
    probability = 0.5 + 0.5 * x0[:, 1] + 0.1 * x0[:, 2]
    probability[3] = np.nan
    return x0, probability


def trace_of(*configurations: list[float]) -> ReachTrace:
    trace = ReachTrace()
    for k, q in enumerate(np.array(configurations)):
        trace.append(0.04 * k, q, ARM.tip_position(q), np.zeros(1))
    return trace


def test_a_density_shows_each_estimate_at_its_y_and_phi(ax: Axes) -> None:
    x0, probability = lattice()
    assert draw_density(ax, x0, probability, (5, 4), [("first", x0[7])]) is ax
    (mesh,) = [item for item in ax.collections if isinstance(item, QuadMesh)]
    np.testing.assert_allclose(np.ma.filled(mesh.get_array(), np.nan).ravel(), probability)
    assert (mesh.norm.vmin, mesh.norm.vmax) == (0.0, 1.0)
    # Corners of the cells: each start lies in the middle of its own, inside the lattice.
    corners = mesh.get_coordinates()
    centres = 0.25 * (corners[1:, 1:] + corners[1:, :-1] + corners[:-1, 1:] + corners[:-1, :-1])
    np.testing.assert_allclose(centres.reshape(-1, 2), x0[:, 1:], atol=1e-12)


def test_impossible_starts_stay_empty(ax: Axes) -> None:
    x0, probability = lattice()
    draw_density(ax, x0, probability, (5, 4), [("first", x0[0])])
    (mesh,) = [item for item in ax.collections if isinstance(item, QuadMesh)]
    assert np.ma.getmaskarray(mesh.get_array()).sum() == 1


def test_choices_are_marked_where_they_are_with_their_labels(ax: Axes) -> None:
    x0, probability = lattice()
    choices = [("first: stuck", np.array([0.335, -0.21, 1.2])), ("second: reached", x0[10])]
    draw_density(ax, x0, probability, (5, 4), choices)
    stars = [(*line.get_xdata(), *line.get_ydata()) for line in ax.lines]
    np.testing.assert_allclose(stars, [pose[1:] for _, pose in choices])
    assert [line.get_color() for line in ax.lines] == list(ATTEMPT_COLORS[:2])
    assert [text.get_text() for text in ax.get_legend().get_texts()] == [
        "first: stuck",
        "second: reached",
    ]


def test_a_density_has_units_and_a_colour_bar(ax: Axes) -> None:
    x0, probability = lattice()
    draw_density(ax, x0, probability, (5, 4), [("first", x0[0])])
    assert ax.get_xlabel() == "start position y [m]"
    assert ax.get_ylabel() == "start orientation φ [rad]"
    labels = [other.get_ylabel() for other in ax.figure.axes if other is not ax]
    assert labels == ["estimated probability of success"]


def test_more_attempts_than_colours_are_no_problem(ax: Axes) -> None:
    x0, probability = lattice()
    draw_density(ax, x0, probability, (5, 4), [(str(i), x0[i]) for i in range(7)])
    assert ax.lines[6].get_color() == ax.lines[1].get_color()


CLUTTER = make_clutter(
    cylinder(0.5, 0.2, movable=True, radius=0.02),
    cylinder(0.6, -0.3, radius=0.01),
    box(0.7, 0.1, (0.2, 0.1, 0.2), yaw=np.pi / 2),
)


def test_the_top_view_draws_every_object_where_it_stands(ax: Axes) -> None:
    assert draw_top_view(ax, free_space(), CLUTTER, P_WG, [("only", ReachTrace())]) is ax
    discs = {
        tuple(np.round(patch.center, 6)): (patch.radius, patch.get_facecolor())
        for patch in ax.patches
        if isinstance(patch, Circle)
    }
    assert discs[0.5, 0.2] == (0.02, to_rgba(MOVABLE_COLOR))
    assert discs[0.6, -0.3] == (0.01, to_rgba(FIXED_COLOR))
    assert discs[0.6, 0.1] == (free_space().stop.success_distance_m, to_rgba("tab:cyan"))
    (rectangle,) = [patch for patch in ax.patches if isinstance(patch, Rectangle)]
    # A quarter turn about the box's centre exchanges its edges.
    corners = rectangle.get_patch_transform().transform([[0, 0], [1, 0], [1, 1], [0, 1]])
    np.testing.assert_allclose(corners.min(axis=0), [0.65, 0.0], atol=1e-9)
    np.testing.assert_allclose(corners.max(axis=0), [0.75, 0.2], atol=1e-9)
    assert rectangle.get_facecolor() == to_rgba(FIXED_COLOR)


def test_the_top_view_draws_the_walls_of_a_passage_at_their_slope(ax: Axes) -> None:
    scenario = load_scenario("passage-clutter")
    instance = scenario.sample_instance("training", 0)
    assert instance.p_WG is not None and instance.yaw[0] > 0.1
    draw_top_view(ax, scenario, instance, instance.p_WG, [])
    walls = [patch for patch in ax.patches if isinstance(patch, Rectangle)]
    assert len(walls) == 2
    for i, wall in enumerate(walls):
        drawn = wall.get_patch_transform().transform([[0, 0], [1, 0], [1, 1], [0, 1]])
        np.testing.assert_allclose(drawn, corners(instance, i), atol=1e-9)
    (goal,) = [patch for patch in ax.patches if isinstance(patch, Circle)]
    np.testing.assert_allclose(goal.center, instance.p_WO[:, :2].mean(axis=0))


def test_the_top_view_draws_the_start_line_and_the_paths(ax: Axes) -> None:
    first = trace_of([-0.5, 1.0, 0.8], [-0.4, 1.0, 0.8], [-0.2, 1.1, 0.5])
    second = trace_of([-1.0, 1.5, 0.8], [-1.1, 1.5, 0.8])
    attempts = [("first", first), ("never began", ReachTrace()), ("third", second)]
    draw_top_view(ax, free_space(), CLUTTER, P_WG, attempts)
    start_line, *paths = ax.lines
    np.testing.assert_allclose(start_line.get_xydata(), [[0.335, -0.4], [0.335, 0.4]])
    assert [line.get_label() for line in paths] == ["first", "third"]
    for line, trace in zip(paths, (first, second), strict=True):
        np.testing.assert_array_equal(line.get_xydata(), np.array(trace.p_WE)[:, :2])
    # An attempt keeps its colour whatever became of the others.
    assert [line.get_color() for line in paths] == [ATTEMPT_COLORS[0], ATTEMPT_COLORS[2]]


def test_the_arm_is_drawn_at_the_beginning_and_at_the_end(ax: Axes) -> None:
    trace = trace_of([-0.5, 1.0, 0.8], [-0.4, 1.0, 0.8], [-0.2, 1.1, 0.5])
    draw_top_view(ax, free_space(), make_clutter(), P_WG, [("only", trace)])
    bars = [patch for patch in ax.patches if isinstance(patch, Polygon)]
    assert len(bars) == 6
    middles = np.array([bar.get_xy()[:4].mean(axis=0) for bar in bars]).reshape(2, 3, 2)
    for middle, q in zip(middles, (trace.q[0], trace.q[-1]), strict=True):
        joints = ARM.kinematics.link_origins(q)
        np.testing.assert_allclose(middle, 0.5 * (joints[1:] + joints[:-1]), atol=1e-12)
    # The bars are as wide as the skin, 2 x 15 mm.
    corners = bars[0].get_xy()
    assert np.linalg.norm(corners[1] - corners[0]) == pytest.approx(0.03)
    assert bars[0].get_alpha() < bars[-1].get_alpha()


def test_the_top_view_is_to_scale_and_shows_the_arm_and_the_goals(ax: Axes) -> None:
    draw_top_view(ax, free_space(), make_clutter(), P_WG, [("only", ReachTrace())])
    assert ax.get_aspect() == 1.0
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    goals = free_space().task.goal_area
    assert left < 0.0 and goals.upper[0] < right
    assert low < goals.lower[1] and goals.upper[1] < high


def test_a_figure_is_saved_with_150_dots_an_inch(ax: Axes, tmp_path: Path) -> None:
    ax.plot([0, 1], [0, 1], color="red", linewidth=4)
    save_figure(ax.figure, tmp_path / "figure.png")
    image = imread(tmp_path / "figure.png")
    # 4 inches, give or take what a tight frame adds or takes.
    np.testing.assert_allclose(image.shape[:2], 600, atol=80)
    assert np.any(np.all(image[:, :, :3] == [1.0, 0.0, 0.0], axis=2))


def test_a_figure_that_cannot_be_saved_is_one_clear_error(ax: Axes, tmp_path: Path) -> None:
    path = tmp_path / "none" / "figure.png"
    with pytest.raises(LicError) as caught:
        save_figure(ax.figure, path)
    assert str(caught.value) == f"cannot write {path}: No such file or directory"
