"""Figures 5 and 6 of the paper for one trial: snapshots of its reaches, densities behind them."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from lic_drake.evaluate.trial import Attempt
from lic_drake.reach.rollout import simulate_request
from lic_drake.reach.starts import Starts, find_region
from lic_drake.select.lic import LicSelector
from lic_drake.select.situation import FailedReach, Situation
from lic_drake.show.density import density_lattice, estimate_density
from lic_drake.show.plots import draw_density, draw_snapshot
from lic_drake.types import Vector

SNAPSHOTS = 4
"""Samples of each reach that Fig. 5 shows."""


def snapshots_figure(attempts: Sequence[Attempt]) -> Figure:
    """Returns snapshots in time of each attempt, a row for each (Fig. 5).

    The reaches are simulated again.
    """
    figure = Figure(figsize=(3.0 * SNAPSHOTS, 3.3 * len(attempts)), layout="constrained")
    axes = figure.subplots(len(attempts), SNAPSHOTS, squeeze=False)
    for row, attempt in zip(axes, attempts, strict=True):
        request = attempt.request
        scenario, p_WG = request.scenario, request.goal
        instance = scenario.sample_instance(request.stream, request.environment)
        trace = simulate_request(request, keep_states=True).trace
        samples = np.linspace(0, len(trace.states) - 1, SNAPSHOTS).round().astype(int)
        for ax, k in zip(row, samples, strict=True):
            draw_snapshot(ax, scenario, instance, p_WG, trace, int(k))
        row[-1].set_title(f"{row[-1].get_title()}, {attempt.record.outcome}", fontsize=9)
    return figure


def densities_figure(
    selector: LicSelector,
    starts: Starts,
    p_WG: Vector,
    attempts: Sequence[Attempt],
) -> Figure:
    """Returns the estimated success of all starts before each attempt, on one scale (Fig. 6).

    Args:
        selector: Whose estimates to draw; the attempts may be another strategy's.
        starts: The possible initial conditions.
        p_WG: Goal, shape (3,), metres.
        attempts: The attempts, each but the last one a failure.
    """
    figure = Figure(figsize=(7.0 * len(attempts), 4.5))
    axes = figure.subplots(1, len(attempts), squeeze=False)[0]
    for number, (ax, attempt) in enumerate(zip(axes, attempts, strict=True), start=1):
        failed = tuple(FailedReach.from_record(a.record) for a in attempts[: number - 1])
        situation = Situation(p_WG=p_WG, starts=starts, failed=failed)
        start = attempt.selection.start
        region = find_region(situation.planar_starts.regions, start.x0, start.b0[:2])
        assert region is not None  # Selections lie in one.
        conditions, shape = density_lattice(situation.planar_starts, region)
        probability = estimate_density(selector, situation, conditions)
        draw_density(ax, conditions.in_R, probability, shape, [(f"attempt {number}", start.x0_R)])
        model = 1 if selector.second is None else min(number, 2)
        ax.set_title(
            f"LIC-{model} ({selector.method}), goal ({p_WG[0]:.2f}, {p_WG[1]:.2f}) m", fontsize=10
        )
    return figure
