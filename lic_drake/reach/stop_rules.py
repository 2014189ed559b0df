"""When a reach ends: at the goal, stuck, by force, or out of time. Pure bookkeeping."""

import math
from collections import deque
from dataclasses import dataclass, fields

import numpy as np

from lic_drake.config import check_numbers
from lic_drake.types import Vector

MAX_TIMEOUT_S = 3600.0
"""Maximum simulated time of a reach; a longer one would take minutes to simulate."""


@dataclass(kw_only=True)
class StopConfig:
    """Limits of a reach; the paper states none of them."""

    # A reach succeeds when the tip is this near the goal, metres (authors' batch scripts).
    success_distance_m: float = 0.015
    # A reach is stuck when the tip moved less than `stuck_distance_m` in `stuck_time_s`.
    stuck_distance_m: float = 0.005
    stuck_time_s: float = 3.0
    # Where objects give way slowly: a reach is also stuck when its smallest distance to the goal
    # fell by less than `progress_m` in `progress_time_s`; 0: this does not count.
    progress_m: float = 0.0
    progress_time_s: float = 3.0
    # Simulated seconds after which a reach fails.
    timeout_s: float = 30.0
    # A reach fails when a taxel reads more than `force_limit_N` for `force_time_s` on end. The
    # authors' controller shuts down at 15 N; a single sample of an impact, whose height depends
    # on how finely the impact is simulated, does not count here.
    force_limit_N: float = 15.0
    force_time_s: float = 0.1

    def __post_init__(self) -> None:
        # An infinite limit switches a rule off.
        ranges = {item.name: (0.0, math.inf) for item in fields(self)}
        ranges["timeout_s"] = (0.0, MAX_TIMEOUT_S)
        check_numbers(self, positive=["success_distance_m"], ranges=ranges)


class StopMonitor:
    """Follows a reach sample by sample and says when and how it ends."""

    def __init__(self, config: StopConfig, p_WG: Vector, period_s: float) -> None:
        self._config = config
        self._p_WG = p_WG
        # Tip positions and smallest distances from now back to so long ago, at the control period.
        self._recent: deque[Vector] = deque(maxlen=_samples(config, period_s, config.stuck_time_s))
        self._nearest: deque[float] = deque(
            maxlen=_samples(config, period_s, config.progress_time_s)
        )
        self._low_force_time_s = 0.0
        self.min_distance = np.inf

    def update(self, time_s: float, p_WE: Vector, peak_force: float) -> str | None:
        """Takes the largest taxel force, N, at a time and tip position p_WE, shape (3,), metres.

        Returns:
            The outcome if the reach ends with this sample, else None.
        """
        self._recent.append(p_WE)
        distance = math.dist(p_WE, self._p_WG)
        self.min_distance = min(self.min_distance, distance)
        if distance < self._config.success_distance_m:
            return "reached"
        if peak_force <= self._config.force_limit_N:
            self._low_force_time_s = time_s
        elif time_s - self._low_force_time_s >= self._config.force_time_s - 1e-9:
            return "force"
        if len(self._recent) == self._recent.maxlen:
            if math.dist(self._recent[-1], self._recent[0]) < self._config.stuck_distance_m:
                return "stuck"
        self._nearest.append(self.min_distance)
        if len(self._nearest) == self._nearest.maxlen:
            if self._nearest[0] - self.min_distance < self._config.progress_m:
                return "stuck"
        if time_s >= self._config.timeout_s - 1e-9:
            return "timeout"
        return None


def _samples(config: StopConfig, period_s: float, window_s: float) -> int:
    """Returns how many samples a window holds; one longer than the time-out never fills."""
    return max(1, round(min(window_s, config.timeout_s + period_s) / period_s)) + 1
