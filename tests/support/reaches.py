"""Real reaches for tests: small scenarios, requests for them, and where a hand can start."""

import math
from collections.abc import Sequence

import numpy as np
from pydrake.systems.framework import Context

from lic_drake.reach.diagram import ReachDiagram
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.scenario import Scenario, load_scenario
from lic_drake.reach.start import Start
from support.kinematics import only

START_Y_M, START_PHI_DEG = 0.0, 60.0
"""A start of the grid from which a goal straight ahead is easy."""


def free_space(timeout_s: float = 20.0) -> Scenario:
    """The shipped scenario without any clutter."""
    return load_scenario(
        "cylinder-clutter",
        "{clutter: {num_movable: 0, num_fixed: 0},"
        f" mpc: {{preset: haptic_mpc_2013}}, stop: {{timeout_s: {timeout_s},"
        " force_limit_N: 100, stuck_distance_m: 0.005, stuck_time_s: 3.0}}",
    )


def small_clutter(timeout_s: float = 3.0) -> Scenario:
    """Twelve cylinders where the arm meets them soon."""
    return load_scenario(
        "cylinder-clutter",
        "{clutter: {num_movable: 6, num_fixed: 6, lower: [0.4, -0.3], upper: [0.7, 0.3]},"
        f" mpc: {{preset: haptic_mpc_2013}}, stop: {{timeout_s: {timeout_s},"
        " force_limit_N: 100, stuck_distance_m: 0.005, stuck_time_s: 3.0}}",
    )


def reach_request(
    scenario: Scenario,
    goal: tuple[float, float] = (0.6, 0.1),
    y_m: float = START_Y_M,
    phi_deg: float = START_PHI_DEG,
    environment: int = 0,
    stream: str = "training",
) -> ReachRequest:
    """A request with the start on the start line."""
    return ReachRequest(
        scenario=scenario,
        stream=stream,
        environment=environment,
        goal=np.array([*goal, 0.0]),
        start=Start(np.array([scenario.task.start_line.x_m, y_m, np.deg2rad(phi_deg)])),
    )


def start_angles(scenario: Scenario) -> np.ndarray:
    """Joint angles of the easy start, shape (3,), radians."""
    q = only(scenario.arm().solve_ik(reach_request(scenario).start.x0))
    assert q is not None
    return q


def start_context(reach_diagram: ReachDiagram, q: np.ndarray, p_WG: np.ndarray) -> Context:
    """A new context in which the arm rests at q and the goal is p_WG."""
    context = reach_diagram.diagram.CreateDefaultContext()
    reach_diagram.set_start(context, q, p_WG)
    return context


MEASURED = (
    *("final_x", "final_y", "final_phi", "final_vx", "final_vy"),
    *("min_distance", "peak_force", "mean_force", "mean_contacts"),
)


def assert_never_began(record: ReachRecord, outcome: str, q: Sequence[float] = ()) -> None:
    assert (record.outcome, record.success, record.duration_s) == (outcome, False, 0.0)
    assert all(math.isnan(getattr(record, name)) for name in MEASURED)
    assert (record.q_start, record.q_final, record.peak_contacts) == (tuple(q), (), 0)
