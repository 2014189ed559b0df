from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.patches import Circle, Polygon, Rectangle
from support.kinematics import link_origins
from support.reaches import free_space
from support.worlds import ARM, box, cylinder, make_clutter

from lic_drake.clutter.registry import category_names
from lic_drake.errors import LicError
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.trace import ReachTrace
from lic_drake.scene.contact import FIXED_COLOR, MOVABLE_COLOR
from lic_drake.show.figures import ATTEMPT_COLORS, save_figure
from lic_drake.show.views import FRONT, SIDE, draw_view
from lic_drake.starts import make_starts

P_WG = np.array([0.6, 0.1, 0.0])
CLUTTER = make_clutter(
    cylinder(0.5, 0.2, movable=True, radius=0.02),
    cylinder(0.6, -0.3, radius=0.01),
    box(0.7, 0.1, (0.2, 0.1, 0.2), yaw=np.pi / 2),
)


@pytest.fixture
def ax() -> Axes:
    return Figure(figsize=(4, 4)).subplots()


def trace_of(*configurations: list[float]) -> ReachTrace:
    trace = ReachTrace()
    for k, q in enumerate(np.array(configurations)):
        trace.append(0.04 * k, q, ARM.calc_pose(q).p_RE, np.zeros(1))
    return trace


def marks_of(ax: Axes) -> dict[str, np.ndarray]:
    """The marked starts by "hand" and "base", shape (n, 2)."""
    marked = {str(line.get_gid()): np.array(line.get_xydata()) for line in ax.lines}
    return {key.removesuffix(" starts"): xy for key, xy in marked.items() if "starts" in key}


def discs_of(ax: Axes) -> list[Circle]:
    return [patch for patch in ax.patches if isinstance(patch, Circle)]


def test_every_object_is_drawn_where_it_stands(ax: Axes) -> None:
    assert draw_view(ax, free_space(), CLUTTER, P_WG, [("only", ReachTrace())]) is ax
    discs = {
        tuple(np.round(disc.center, 6)): (disc.radius, disc.get_facecolor())
        for disc in discs_of(ax)
    }
    assert discs[0.5, 0.2] == (0.02, to_rgba(MOVABLE_COLOR))
    assert discs[0.6, -0.3] == (0.01, to_rgba(FIXED_COLOR))
    assert discs[0.6, 0.1] == (free_space().stop.success_distance_m, to_rgba("tab:cyan"))
    (rectangle,) = [patch for patch in ax.patches if isinstance(patch, Rectangle)]
    # A quarter turn about the box's centre exchanges its edges.
    drawn = rectangle.get_patch_transform().transform([[0, 0], [1, 0], [1, 1], [0, 1]])
    np.testing.assert_allclose([drawn.min(axis=0), drawn.max(axis=0)], [[0.65, 0], [0.75, 0.2]])


@pytest.mark.parametrize("category", category_names())
def test_each_category_is_drawn_with_all_objects_and_the_starts_of_its_own_robot(
    ax: Axes, category: str
) -> None:
    scenario = load_scenario(category)
    instance = scenario.sample_instance("evaluation", 0)
    p_WG = scenario.sample_goal("evaluation", 0)
    draw_view(ax, scenario, instance, p_WG)
    round_ones = sum(shape in ("cylinder", "sphere") for shape in instance.shape)
    assert len(discs_of(ax)) == round_ones + 1  # And the goal.
    boxes = [patch for patch in ax.patches if isinstance(patch, Rectangle)]
    assert len(boxes) == instance.shape.count("box")
    num_stems = 0 if instance.stems is None else len(instance.stems.length)
    marks = marks_of(ax)
    assert len(ax.lines) == num_stems + len(marks)
    starts = make_starts(scenario, instance).grid
    for xy in starts.x0[:, :2]:
        assert np.min(np.linalg.norm(marks["hand"] - xy, axis=1)) < 1e-5
    assert ("base" in marks) == (len(np.unique(starts.b0[:, :2], axis=0)) > 1)
    if instance.p_WA is not None:  # In the apertures, not on a planar arm's start line.
        y = instance.p_WA[:, 1]
        assert all(np.min(np.abs(y - mark)) < 1e-5 for mark in marks["hand"][:, 1])


def test_spheres_are_seen_through_the_board_from_the_front(ax: Axes) -> None:
    scenario = load_scenario("sphere-aperture-clutter")
    instance = scenario.sample_instance("evaluation", 0)
    draw_view(ax, scenario, instance, np.array([0.84, -0.1, 0.9]), axes=FRONT)
    centres = np.array([disc.center for disc in discs_of(ax)[:-1]])
    spheres = [i for i, shape in enumerate(instance.shape) if shape == "sphere"]
    assert len(spheres) == 40
    np.testing.assert_allclose(centres, instance.p_WO[spheres][:, 1:])
    assert {(ax.get_xlabel(), ax.get_ylabel())} == {("y [m]", "z [m]")}
    draw_view(ax, scenario, instance, np.array([0.84, -0.1, 0.9]), axes=SIDE)
    assert ax.get_xlabel() == "x [m]"


def test_paths_keep_the_colour_of_their_attempt(ax: Axes) -> None:
    first = trace_of([-0.5, 1.0, 0.8], [-0.4, 1.0, 0.8], [-0.2, 1.1, 0.5])
    second = trace_of([-1.0, 1.5, 0.8], [-1.1, 1.5, 0.8])
    attempts = [("first", first), ("never began", ReachTrace()), ("third", second)]
    draw_view(ax, free_space(), CLUTTER, P_WG, attempts)
    paths = [line for line in ax.lines if line.get_gid() is None]
    assert [line.get_label() for line in paths] == ["first", "third"]
    for line, trace in zip(paths, (first, second), strict=True):
        np.testing.assert_array_equal(line.get_xydata(), np.array(trace.p_WE)[:, :2])
    assert [line.get_color() for line in paths] == [ATTEMPT_COLORS[0], ATTEMPT_COLORS[2]]


def test_the_arm_is_drawn_at_the_beginning_and_at_the_end(ax: Axes) -> None:
    trace = trace_of([-0.5, 1.0, 0.8], [-0.4, 1.0, 0.8], [-0.2, 1.1, 0.5])
    draw_view(ax, free_space(), make_clutter(), P_WG, [("only", trace)])
    bars = [patch for patch in ax.patches if isinstance(patch, Polygon)]
    assert len(bars) == 6
    middles = np.array([bar.get_xy()[:4].mean(axis=0) for bar in bars]).reshape(2, 3, 2)
    for middle, q in zip(middles, (trace.q[0], trace.q[-1]), strict=True):
        joints = link_origins(ARM, q)
        np.testing.assert_allclose(middle, 0.5 * (joints[1:] + joints[:-1]), atol=0.01)
    # The last capsule ends before the tip. The bars are as wide as the skin, 2 x 15 mm.
    outline = bars[0].get_xy()
    assert np.linalg.norm(outline[1] - outline[0]) == pytest.approx(0.03)
    assert bars[0].get_alpha() < bars[-1].get_alpha()


def test_a_figure_is_saved_or_refused_in_one_clear_error(ax: Axes, tmp_path: Path) -> None:
    ax.plot([0, 1], [0, 1], color="red", linewidth=4)
    save_figure(ax.figure, tmp_path / "figure.png")
    image = imread(tmp_path / "figure.png")
    # 4 inches at 150 dots, give or take what a tight frame adds or takes.
    np.testing.assert_allclose(image.shape[:2], 600, atol=80)
    assert np.any(np.all(image[:, :, :3] == [1.0, 0.0, 0.0], axis=2))
    for name, reason in (("none/figure.png", "No such file"), ("figure.docx", "not supported")):
        with pytest.raises(LicError, match=f"cannot write .*{name}: .*{reason}"):
            save_figure(ax.figure, tmp_path / name)
