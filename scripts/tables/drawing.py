"""Figures of success rates: functions that take data and an axis, draw, and return the axis.

Every rate is drawn with its Wilson 90 % interval.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from lic_drake.evaluate.paper import LABELS, label
from lic_drake.evaluate.statistics import Count
from lic_drake.types import Vector
from scripts.cross_validation.scores import CalibrationBin
from scripts.learning_curve.run import LearningPoint

COLORS = {"rnd": "tab:gray", "cost": "tab:orange", "gp": "tab:blue", "knn": "tab:green"}
"""Colours of the strategies; others take the next colour of matplotlib's cycle."""

_MARKERS = "osD^vP"


@dataclass(frozen=True, kw_only=True)
class AttemptCounts:
    """Successes of a strategy.

    Attributes:
        first: On first attempts.
        total: On either of two attempts.
    """

    first: Count
    total: Count


def draw_success_bars(
    ax: Axes, ours: Mapping[str, AttemptCounts], paper: Mapping[str, AttemptCounts]
) -> Axes:
    """Draws first attempts as dark bars in front of light bars of totals (paper Fig. 8).

    Args:
        ax: Where to draw.
        ours: Our counts by strategy.
        paper: The paper's counts by strategy, drawn as hatched bars to the right of ours.
    """
    methods = _in_order([*ours, *paper])
    for source, offset, hatch in ((ours, -0.2, ""), (paper, 0.2, "///")):
        for i, method in enumerate(methods):
            if method not in source:
                continue
            for result, alpha in ((source[method].total, 0.35), (source[method].first, 0.9)):
                ax.bar(
                    i + offset,
                    100.0 * result.rate,
                    width=0.36,
                    color=COLORS.get(method, "tab:purple"),
                    alpha=alpha,
                    hatch=hatch,
                    edgecolor="white",
                )
                ax.errorbar(
                    i + offset,
                    100.0 * result.rate,
                    yerr=_error([result]),
                    color="black",
                    capsize=3,
                    linewidth=1,
                )
    ax.set_xticks(range(len(methods)), [label(method) for method in methods])
    ax.set(ylim=(0.0, 100.0), ylabel="success [%]")
    ax.set_title("first attempt (dark) and total of two; hatched: paper", fontsize=9)
    return ax


def draw_learning_curve(
    ax: Axes, curves: Mapping[str, Sequence[LearningPoint]], ylabel: str
) -> Axes:
    """Draws scores against the size of the library, on a logarithmic axis.

    Args:
        ax: Where to draw.
        curves: Points by estimator.
        ylabel: What the score is, with its unit.
    """
    for i, (name, points) in enumerate(curves.items()):
        ordered = sorted(points, key=lambda point: point.size)
        value = np.array([point.value for point in ordered])
        ends = np.array([[point.low, point.high] for point in ordered]).T
        ax.errorbar(
            [point.size for point in ordered],
            value,
            yerr=np.abs(ends - value),
            color=COLORS.get(name),
            marker=_MARKERS[i % len(_MARKERS)],
            capsize=3,
            label=label(name),
        )
    ax.set(xscale="log", xlabel="reaches in the library", ylabel=ylabel)
    ax.legend(fontsize=8)
    return ax


def draw_calibration(ax: Axes, curves: Mapping[str, Sequence[CalibrationBin]]) -> Axes:
    """Draws observed against predicted success; perfect predictions lie on the dashed line.

    Args:
        ax: Where to draw.
        curves: Bins of similar predictions by estimator.
    """
    ax.plot([0.0, 1.0], [0.0, 1.0], color="0.6", linestyle="--", linewidth=1)
    for i, (name, bins) in enumerate(curves.items()):
        counts = [Count(round(bin_.observed * bin_.count), bin_.count) for bin_ in bins]
        ax.errorbar(
            [bin_.predicted for bin_ in bins],
            [bin_.observed for bin_ in bins],
            yerr=0.01 * _error(counts),
            color=COLORS.get(name),
            marker=_MARKERS[i % len(_MARKERS)],
            markersize=4,
            capsize=3,
            label=f"{label(name)}, n = {sum(bin_.count for bin_ in bins)}",
        )
    ax.set(
        xlim=(0.0, 1.0),
        ylim=(0.0, 1.0),
        aspect="equal",
        xlabel="predicted probability of success",
        ylabel="observed share of successes",
    )
    ax.legend(fontsize=8, loc="upper left")
    return ax


def draw_success_by_goal(
    ax: Axes, goals: Vector, success: NDArray[np.bool_], bin_m: float = 0.1
) -> Axes:
    """Draws success rates over the goal area as a map whose cells show successes and trials.

    Args:
        ax: Where to draw.
        goals: Goals (x, y), shape (n, 2), metres.
        success: Whether the trial at each succeeded, shape (n,).
        bin_m: Edge of the cells, metres; their edges are whole multiples of it.
    """
    # A goal on the edge of two cells belongs to the upper one, whatever the rounding.
    cell = np.floor(goals / bin_m + 1e-9).astype(int)
    low = cell.min(axis=0)
    x_edges, y_edges = (
        bin_m * np.arange(low[k], cell[:, k].max() + 2, dtype=float) for k in range(2)
    )
    trials = np.zeros((len(x_edges) - 1, len(y_edges) - 1), dtype=int)
    won = np.zeros_like(trials)
    np.add.at(trials, tuple((cell - low).T), 1)
    np.add.at(won, tuple((cell - low).T), success)
    rate = np.divide(won, trials, out=np.full(trials.shape, np.nan), where=trials > 0)
    # As in the top views, x points to the right and y up.
    image = ax.pcolormesh(x_edges, y_edges, 100.0 * rate.T, cmap="viridis", vmin=0.0, vmax=100.0)
    for i, j in np.argwhere(trials > 0):
        ax.text(
            0.5 * (x_edges[i] + x_edges[i + 1]),
            0.5 * (y_edges[j] + y_edges[j + 1]),
            f"{won[i, j]}/{trials[i, j]}",
            ha="center",
            va="center",
            fontsize=7,
            color="black" if rate[i, j] > 0.5 else "white",
        )
    ax.set(xlabel="goal x [m]", ylabel="goal y [m]", aspect="equal")
    ax.set_facecolor("0.9")
    if ax.figure is not None:
        ax.figure.colorbar(image, ax=ax, shrink=0.65, label="success [%]")
    return ax


def draw_success_by_attempts(ax: Axes, counts: Mapping[str, Sequence[Count]]) -> Axes:
    """Draws the success rate within the first k attempts against k.

    Args:
        ax: Where to draw.
        counts: Trials that succeed within 1, 2, ... attempts, by strategy.
    """
    for i, method in enumerate(_in_order(list(counts))):
        results = counts[method]
        ax.errorbar(
            np.arange(1, len(results) + 1),
            [100.0 * result.rate for result in results],
            yerr=_error(results),
            color=COLORS.get(method),
            marker=_MARKERS[i % len(_MARKERS)],
            capsize=3,
            label=f"{label(method)}, n = {results[0].trials}",
        )
    most = max((len(results) for results in counts.values()), default=0)
    ax.set_xticks(range(1, most + 1))
    ax.set(xlabel="attempts", ylabel="success within them [%]")
    ax.legend(fontsize=8, loc="best")
    return ax


def _error(results: Sequence[Count]) -> Vector:
    """Returns the distances from rates down and up to their intervals' ends, (2, n), percent."""
    rate = np.array([result.rate for result in results])
    ends = np.array([result.interval() for result in results]).T
    return 100.0 * np.abs(ends - rate)


def _in_order(methods: Sequence[str]) -> list[str]:
    """Returns distinct strategies in the paper's order, others behind."""
    known = [method for method in LABELS if method in methods]
    return known + [method for method in dict.fromkeys(methods) if method not in LABELS]
