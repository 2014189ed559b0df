import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.container import ErrorbarContainer
from matplotlib.figure import Figure

from lic_drake.evaluate.statistics import Count
from lic_drake.intervals import wilson_interval
from scripts.tables.drawing import (
    AttemptCounts,
    draw_success_bars,
    draw_success_by_goal,
)

OURS = {
    "gp": AttemptCounts(first=Count(70, 100), total=Count(80, 100)),
    "rnd": AttemptCounts(first=Count(60, 100), total=Count(75, 100)),
}
PAPER = {"rnd": AttemptCounts(first=Count(1220, 2000), total=Count(1483, 2000))}


@pytest.fixture
def ax() -> Axes:
    return Figure(figsize=(4, 4)).subplots()


def bars(ax: Axes) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Positions (n, 2) and ends (n, 2) of vertical error bars, by call, with the line's colour."""
    found = []
    for container in ax.containers:
        if isinstance(container, ErrorbarContainer):
            line, _, (segments,) = container.lines
            points = line.get_xydata()
            ends = np.array([segment[:, 1] for segment in segments.get_segments()])
            found.append((points, ends, line.get_color()))
    return found


def legend(ax: Axes) -> list[str]:
    return [text.get_text() for text in ax.get_legend().get_texts()]


def test_success_bars_stand_side_by_side_with_their_intervals(ax: Axes) -> None:
    assert draw_success_bars(ax, OURS, PAPER) is ax
    # Heights and middles: ours to the left of the tick, the paper's to the right.
    drawn = {
        (round(bar.get_x() + bar.get_width() / 2, 6), round(bar.get_height(), 6), bar.get_hatch())
        for bar in ax.patches
    }
    assert drawn == {
        (-0.2, 75.0, ""),
        (-0.2, 60.0, ""),
        (0.8, 80.0, ""),
        (0.8, 70.0, ""),
        (0.2, 61.0, "///"),
        (0.2, 74.15, "///"),
    }
    assert [text.get_text() for text in ax.get_xticklabels()] == ["RND", "LIC(GP)"]
    ends = {round(points[0, 1], 6): end[0] for points, end, _ in bars(ax)}
    np.testing.assert_allclose(ends[70.0], 100 * np.array(wilson_interval(70, 100)))
    np.testing.assert_allclose(ends[61.0], 100 * np.array(wilson_interval(1220, 2000)))
    assert ax.get_ylim() == (0.0, 100.0)


def test_the_goal_map_has_rates_and_counts_in_its_cells(ax: Axes) -> None:
    goals = np.array([[0.45, -0.35], [0.48, -0.31], [0.45, 0.05], [0.65, 0.1]])
    success = np.array([True, False, True, False])
    assert draw_success_by_goal(ax, goals, success) is ax
    (mesh,) = [item for item in ax.collections if isinstance(item, QuadMesh)]
    x, y = np.moveaxis(mesh.get_coordinates(), -1, 0)
    np.testing.assert_allclose(x[0], [0.4, 0.5, 0.6, 0.7], atol=1e-12)
    np.testing.assert_allclose(y[:, 0], np.arange(-4, 3) / 10, atol=1e-12)
    rates = np.ma.filled(mesh.get_array(), np.nan)
    expected = np.full((6, 3), np.nan)
    expected[0, 0], expected[4, 0], expected[5, 2] = 50.0, 100.0, 0.0
    np.testing.assert_allclose(rates, expected)
    texts = {tuple(np.round(t.get_position(), 6)): t.get_text() for t in ax.texts}
    assert texts == {(0.45, -0.35): "1/2", (0.45, 0.05): "1/1", (0.65, 0.15): "0/1"}
    assert (mesh.norm.vmin, mesh.norm.vmax) == (0.0, 100.0)
    assert ax.get_aspect() == 1.0
