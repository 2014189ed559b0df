"""Records reaches as one HTML file that plays offline, contact forces included."""

import html
import math
from pathlib import Path

import numpy as np

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.errors import readable_errors
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.trace import ReachTrace
from lic_drake.show.approach import Approach
from lic_drake.show.page import embed
from lic_drake.show.stage import Screen, open_meshcat
from lic_drake.types import Vector

PAUSE_S = 1.0
"""Minimum pause between two reaches, seconds."""

TICKS_PER_FRAME = 10
"""Meshcat rounds times down to ticks; with one tick a frame, some frames would coincide."""

MAX_FRAMES_PER_SECOND = 30.0
"""Largest frame rate."""

MOVE_S = 1.0
"""Least duration of a move of base, torso or arm between reaches, seconds."""

ARM_RAD_PER_S = 1.2
"""Average speed of the arm's fastest joint between reaches."""

RETRACT_SPEED = 4.0
"""Playback speed of the arm's retraction, relative to the reach."""

_CAPTIONS = (
    '<p style="position: fixed; left: 1rem; bottom: 0; font: 16px/1.5 system-ui, sans-serif;'
    ' color: #222; pointer-events: none">'
)


class Recording:
    """A Meshcat scene of one environment in which reaches are recorded one after another.

    Reaches are simulated beforehand with their states kept, and drawn here. Moves between reaches
    are drawn, not simulated. Must be used from the thread that made it.
    """

    def __init__(
        self,
        scenario: Scenario,
        instance: ClutterInstance,
        drake_models: Path | None = None,
        approach: bool = False,
    ) -> None:
        """Starts a recording.

        Args:
            scenario: Gives robot, task and control rate.
            instance: The environment.
            drake_models: See `lic_drake.show.stage.add_stage`.
            approach: Whether a PR2's arm begins in its waiting posture and moves to its starts on
                planned paths; otherwise it moves straight in joint space.
        """
        self._scenario = scenario
        self._approach = Approach(scenario, instance) if approach else None
        self._meshcat = open_meshcat(scenario.arm().is_planar)
        self._screen = Screen(self._meshcat, scenario, instance, drake_models)
        self._frames_per_second = frame_rate(scenario.mpc.rate_hz)
        self._springs_back = instance.stems is not None
        self._clock_s = 0.0
        self._captions: list[str] = []
        self._b0 = scenario.task.b0
        self._q = self._screen.initial if self._approach is None else self._approach.waiting
        self._meshcat.StartRecording(
            TICKS_PER_FRAME * self._frames_per_second, set_visualizations_while_recording=False
        )
        if approach:
            self._draw()

    def add_reach(self, trace: ReachTrace, p_WG: Vector, caption: str = "") -> None:
        """Records a reach to a goal p_WG; the trace needs its states.

        The page shows plain-text captions below each other, with the time at which each begins.
        """
        if caption:
            self._captions.append(f"from {self._clock_s:.0f} s: {caption}")
        self._screen.draw_goal(p_WG)
        self._screen.show_forces(True, self._clock_s)
        self._b0 = trace.b0
        begin = self._clock_s
        for k in range(0, len(trace.states), self._sample_step()):
            self._clock_s = begin + trace.time_s[k]
            self._draw(trace, k)
        if trace.time_s:
            self._clock_s = begin + math.ceil(trace.time_s[-1] + PAUSE_S)

    def move_to(self, b0: Vector, q: Vector) -> None:
        """Records the moves of base, torso and arm to a start, in that order."""
        for next_b0 in (np.array([*b0[:2], self._b0[2]]), b0):
            self._follow(next_b0, self._q[None])
        self._follow(b0, q[None] if self._approach is None else self._approach.path(b0, q))

    def retract(self, trace: ReachTrace) -> None:
        """Records the arm retracing its path and returning to its waiting posture.

        Stems spring back with it, as they do once released.
        """
        self._screen.show_forces(False, self._clock_s)  # Moves between reaches are not simulated.
        step = round(RETRACT_SPEED * self._sample_step())
        for k in [*range(len(trace.states) - 1, -1, -step), 0]:
            self._draw(trace, k, with_clutter=self._springs_back)
            self._clock_s += 1.0 / self._frames_per_second
        if self._approach is not None:
            self._follow(self._b0, self._approach.path(self._b0, self._q)[::-1])

    def save(self, path: Path) -> None:
        """Writes the recording; a LicError if the file cannot be written."""
        with readable_errors(path, "write"):
            path.write_text(self.html(), encoding="utf-8")

    def _repr_html_(self) -> str:
        """Returns the recording in a frame; notebooks call this."""
        return embed(self.html())

    def html(self) -> str:
        """Returns the recording as a page."""
        self._meshcat.StopRecording()
        self._meshcat.PublishRecording()
        lines = "<br>".join(map(html.escape, self._captions))
        return str(self._meshcat.StaticHtml()).replace("</body>", f"{_CAPTIONS}{lines}</p></body>")

    def _sample_step(self) -> int:
        """Returns the number of samples of a reach per frame."""
        return round(self._scenario.mpc.rate_hz / self._frames_per_second)

    def _follow(self, b0: Vector, path: Vector) -> None:
        """Records base and torso moving to b0 and the arm along a path, unless already there.

        Each move takes at least `MOVE_S` and eases in and out.
        """
        old_b0 = self._b0
        path = np.vstack([self._q, path])
        passed = np.append(0.0, np.cumsum(np.abs(np.diff(path, axis=0)).max(axis=1)))
        if np.allclose(b0, old_b0) and passed[-1] < 1e-6:
            return
        frames = round(max(MOVE_S, passed[-1] / ARM_RAD_PER_S) * self._frames_per_second)
        for share in 0.5 - 0.5 * np.cos(np.pi * np.arange(1, frames + 1) / frames):
            self._b0 = old_b0 + share * (b0 - old_b0)
            self._q = np.array([np.interp(share * passed[-1], passed, angle) for angle in path.T])
            self._draw()
            self._clock_s += 1.0 / self._frames_per_second

    def _draw(self, trace: ReachTrace | None = None, k: int = 0, with_clutter: bool = True) -> None:
        """Draws the robot's current configuration, or a sample of a reach, at the current time."""
        state = None if trace is None else trace.states[k]
        if state is not None:
            self._q = state.q
        shown = state if with_clutter else None
        self._screen.draw(self._b0, self._q, shown, self._clock_s)


def frame_rate(control_rate_hz: float) -> float:
    """Returns the frames per second of a recording: the control rate, halved while too high."""
    rate = control_rate_hz
    while rate > MAX_FRAMES_PER_SECOND:
        rate /= 2.0
    return rate
