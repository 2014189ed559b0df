"""The live view: sliders move the goal and change the clutter; map and chosen start follow."""

import gc
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from pydrake.geometry import Meshcat, Rgba

from lic_drake.errors import LicError
from lic_drake.estimate.features import features_of
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.session import make_record, simulate_request
from lic_drake.reach.start import describe_start
from lic_drake.reach.trace import ReachTrace, SceneState
from lic_drake.select.lic import LicSelector
from lic_drake.select.situation import FailedReach, Situation
from lic_drake.show.density import map_success, mark_starts
from lic_drake.show.recording import frame_rate
from lic_drake.show.stage import NEUTRAL, Screen, look
from lic_drake.starts import make_starts

STREAM = "evaluation"
"""Seed stream of the environments; none of its environments is in a library."""

REACH, AGAIN, AGAIN_KEY = "reach", "try again", "KeyT"
"""Buttons; the second one appears after a failure."""

ESTIMATE, ENVIRONMENT = "success [%]", "environment"
"""Sliders that every category has; the first one only shows a number."""

NUM_ENVIRONMENTS = 100
"""Number of environments to choose from."""

_IDLE_S = 0.02
_REACHED, _FAILED = Rgba(0.1, 0.7, 0.2, 0.9), Rgba(0.85, 0.1, 0.1, 0.9)
_MAP = "/map"
_AXES = {f"goal {axis} [m]": k for k, axis in enumerate("xyz")}
_OFFERED_GOALS = 20


class Slider(NamedTuple):
    """A slider with its bounds, its step and its first value, in the unit of its name."""

    low: float
    high: float
    step: float
    value: float


def goal_sliders(scenario: Scenario) -> dict[str, Slider]:
    """Returns a slider for each coordinate of a goal, metres, that varies and is a feature."""
    features = features_of(scenario.category).first
    area, first = scenario.task.goal_area, scenario.sample_goal(STREAM, 0)
    if area is not None:
        low, high = np.pad([area.lower, area.upper], ((0, 0), (0, 3 - len(area.lower))))
    else:
        offered = [scenario.sample_goal(STREAM, i) for i in range(_OFFERED_GOALS)]
        low, high = np.min(offered, axis=0), np.max(offered, axis=0)
    return {
        name: Slider(round(low[k], 2), round(high[k], 2), 0.01, first[k])
        for name, k in _AXES.items()
        if f"goal_{'xyz'[k]}" in features.goal and high[k] > low[k]
    }


def aperture_sliders(scenario: Scenario) -> dict[str, tuple[str, Slider]]:
    """Returns the slider of a board or barrier, if there is one, with the parameter it sets."""
    clutter: Any = scenario.clutter
    if hasattr(clutter, "num_blocked"):
        most = clutter.rows * clutter.columns - 1
        return {"blocked": ("num_blocked", Slider(0, most, 1, clutter.num_blocked))}
    if hasattr(clutter, "num_apertures"):
        count = clutter.num_apertures
        return {"apertures": ("num_apertures", Slider(1, count, 1, count))}
    return {}


class Explorer:
    """Follows the sliders and buttons of a Meshcat; must be used from the thread that made it.

    A move of any slider begins a new trial. `reach` simulates the reach that the strategy selects,
    and plays it. After a failure, `try again` shows what is estimated and chosen next, in the
    clutter as it was left. While a slider moves to other environments, their maps and the arm are
    shown; the clutter follows when it rests.
    """

    def __init__(
        self,
        meshcat: Meshcat,
        scenario: Scenario,
        selector: LicSelector,
        say: Callable[[str], None] = print,
    ) -> None:
        """Replaces the controls, and shows the first environment."""
        meshcat.DeleteAddedControls()
        look(meshcat, scenario.arm().is_planar)
        self._meshcat, self._original, self._selector, self._say = meshcat, scenario, selector, say
        self._apertures = aperture_sliders(scenario)
        self._sliders = {
            **goal_sliders(scenario),
            **{name: slider for name, (_, slider) in self._apertures.items()},
            ENVIRONMENT: Slider(0, NUM_ENVIRONMENTS - 1, 1, 0),
        }
        for name, slider in self._sliders.items():
            meshcat.AddSlider(name, *slider)
        meshcat.AddSlider(ESTIMATE, 0, 100, 1, 0)
        meshcat.AddButton(REACH, "KeyR")
        self._clicks = 0
        self._last: tuple[ReachRequest, ReachRecord, ReachTrace] | None = None
        self._change_environment()
        self._show_environment()
        self._begin()

    def run(self, others: Sequence[str]) -> str:
        """Follows until another category is asked for, with the buttons that it adds for them."""
        for name in others:
            self._meshcat.AddButton(name)
        while True:
            for name in others:
                if self._meshcat.GetButtonClicks(name):
                    return name
            if not self.step():
                time.sleep(_IDLE_S)

    def step(self) -> bool:
        """Does what sliders and buttons ask for; returns whether that was anything."""
        if self._moved():
            values = self._values()
            changed = {name for name in values if values[name] != self._shown[name]}
            if changed & {ENVIRONMENT, *self._apertures}:
                self._change_environment()
            self._begin()
        elif not self._is_shown:
            self._show_environment()
            self._follow()
        elif (clicks := self._meshcat.GetButtonClicks(REACH)) != self._clicks:
            self._clicks = clicks
            self._attempt(self.reach)
        elif self._last is not None and self._meshcat.GetButtonClicks(AGAIN):
            self._attempt(self._look_again)
        else:
            return False
        return True

    def reach(self) -> None:
        """Selects a start, reaches from it, and plays the reach with its contact forces."""
        selection = self._selector.select(self._situation)
        if self._before is not None:
            request = self._before.then(selection.start)
        else:
            place = (self._scenario, STREAM, int(self._shown[ENVIRONMENT]))
            request = ReachRequest(*place, self._situation.p_WG, selection.start)
        self._say(
            f"reaches from {describe_start(selection.start)}: estimated success"
            f" {100 * (selection.probability or 0.0):.0f} %"
        )
        self._forget()
        record, trace = play_request(request, self._screen, stopped=self._moved)
        self._say(describe_record(record))
        if not record.success:
            self._last = (request, record, trace)
            self._meshcat.AddButton(AGAIN, AGAIN_KEY)

    def _attempt(self, action: Callable[[], None]) -> None:
        """Does something that may be impossible in this situation, and then says why."""
        try:
            action()
        except LicError as error:
            self._say(f"lic: {error}")

    def _values(self) -> dict[str, float]:
        return {name: self._meshcat.GetSliderValue(name) for name in self._sliders}

    def _moved(self) -> bool:
        return self._values() != self._shown

    def _change_environment(self) -> None:
        """Goes to another environment, and to its own goal if it offers only one."""
        values = self._values()
        clutter: Any = self._original.clutter
        for name, (parameter, _) in self._apertures.items():
            clutter = replace(clutter, **{parameter: int(values[name])})
        self._scenario = replace(self._original, clutter=clutter)
        index = int(values[ENVIRONMENT])
        self._instance = self._scenario.sample_instance(STREAM, index)
        self._goal = self._scenario.sample_goal(STREAM, index)
        if self._scenario.task.goal_area is None:
            for name in _AXES.keys() & values.keys():
                self._meshcat.SetSliderValue(name, self._goal[_AXES[name]])
        self._starts = make_starts(self._scenario, self._instance)
        self._is_shown = False

    def _show_environment(self) -> None:
        """Builds and draws the environment, which takes longer than all else."""
        self._screen = Screen(self._meshcat, self._scenario, self._instance)
        self._is_shown = True
        gc.collect()  # The last screen's diagram is in a reference cycle: 4 MB.

    def _begin(self) -> None:
        """Begins a trial at the goal of the sliders."""
        self._shown = self._values()
        p_WG = self._goal.copy()
        for name in _AXES.keys() & self._shown.keys():
            p_WG[_AXES[name]] = self._shown[name]
        self._situation = Situation(p_WG=p_WG, starts=self._starts)
        self._before: ReachRequest | None = None
        self._forget()
        self._follow()

    def _look_again(self) -> None:
        """Shows what is estimated and chosen after the last reach, which failed."""
        assert self._last is not None
        request, record, trace = self._last
        failed = (*self._situation.failed, FailedReach.from_record(record))
        self._situation = replace(self._situation, failed=failed)
        self._before = request
        self._forget()
        self._follow(trace)

    def _forget(self) -> None:
        self._last = None
        self._meshcat.DeleteButton(AGAIN, strict=False)

    def _follow(self, left: ReachTrace | None = None) -> None:
        """Draws map and start; the clutter as drawn, or as a reach left it."""
        found = map_success(self._selector, self._situation)
        self._meshcat.SetTriangleColorMesh(_MAP, *mark_starts(found))
        self._screen.draw_goal(self._situation.p_WG)
        self._screen.show_forces(False)
        best, q_clutter = found.best, None if left is None else left.q_clutter
        if best is None or best.q is None:
            return
        state = None
        if q_clutter is not None and self._instance.stems is None:  # Stems spring back.
            state = SceneState(best.q, 0.0 * best.q, q_clutter, 0.0 * q_clutter)
        self._screen.draw(best.b0, best.q, state)
        self._meshcat.SetSliderValue(ESTIMATE, round(100 * float(np.nanmax(found.probability))))


def play_request(
    request: ReachRequest, screen: Screen, stopped: Callable[[], bool] = lambda: False
) -> tuple[ReachRecord, ReachTrace]:
    """Simulates a reach and plays it as fast as it was, or until stopped; returns what it was.

    The goal is green after a success and red after a failure.
    """
    began = time.perf_counter()
    screen.draw_goal(request.goal, NEUTRAL)
    result = simulate_request(request, keep_states=True)
    record, trace = make_record(request, result, time.perf_counter() - began), result.trace
    screen.show_forces(True)
    step = round(request.scenario.mpc.rate_hz / frame_rate(request.scenario.mpc.rate_hz))
    began = time.perf_counter()
    count = len(trace.states)
    for k in [*range(0, count, step), *range(max(count - 1, 0), count)]:
        if stopped():
            break
        time.sleep(max(0.0, began + trace.time_s[k] - time.perf_counter()))
        screen.draw(trace.b0, trace.states[k].q, trace.states[k], trace.time_s[k])
    screen.draw_goal(request.goal, _REACHED if record.success else _FAILED)
    return record, trace


def describe_record(record: ReachRecord) -> str:
    """Returns in words how a reach ended."""
    return (
        f"{record.outcome} after {record.duration_s:.1f} s, nearest to the goal"
        f" {1000 * record.min_distance:.0f} mm, peak force {record.peak_force:.1f} N"
    )
