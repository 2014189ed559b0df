"""Records reaches as one HTML file that plays offline, contact forces included."""

import logging
import math
from pathlib import Path

import numpy as np
from pydrake.geometry import Cylinder, Meshcat, MeshcatParams, Rgba, Sphere
from pydrake.math import RigidTransform

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.errors import LicError
from lic_drake.reach.diagram import make_reach_diagram
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.simulation import Simulation
from lic_drake.reach.trace import ReachTrace
from lic_drake.types import Vector

PAUSE_S = 1.0
"""Time between two reaches of a recording, at least."""

TICKS_PER_FRAME = 10
"""Meshcat rounds a frame's time down to ticks; with one a frame, some fell on the one before."""

MAX_FRAMES_PER_SECOND = 30.0
"""A recording has no more frames a second."""

_CAMERA_PLANE = (np.array([-0.4, -0.3, 1.05]), np.array([0.45, 0.02, 0.0]))
"""Where the camera is, and what it looks at: an arm on the ground."""
_CAMERA_SPACE = (np.array([-0.45, -1.65, 1.65]), np.array([0.4, -0.15, 0.85]))
"""The same for a robot before its clutter."""


def in_plane(scenario: Scenario) -> bool:
    """Tells whether the robot is an arm in the plane."""
    return scenario.arm().surface is None


def frame_rate(control_rate_hz: float) -> float:
    """Returns the frames per second of a recording: the control rate, halved while too high.

    Frames show the samples of a reach, every one or every second, fourth and so on.
    """
    rate = control_rate_hz
    while rate > MAX_FRAMES_PER_SECOND:
        rate /= 2.0
    return rate


class MeshcatRecording:
    """A Meshcat scene that is recorded frame by frame and saved as one file.

    Must be used from the thread that made it.

    Args:
        scenario: Gives the control rate and the goal's size.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._meshcat = _make_meshcat()
        self._frames_per_second = frame_rate(scenario.mpc.rate_hz)
        self._meshcat.SetProperty("/Background/<object>", "top_color", [0.97, 0.97, 0.98])
        self._meshcat.SetProperty("/Background/<object>", "bottom_color", [0.97, 0.97, 0.98])
        self._meshcat.SetProperty("/Grid", "visible", False)
        self._meshcat.SetProperty("/Axes", "visible", False)
        self._meshcat.SetCameraPose(*(_CAMERA_PLANE if in_plane(scenario) else _CAMERA_SPACE))
        self._meshcat.StartRecording(
            TICKS_PER_FRAME * self._frames_per_second, set_visualizations_while_recording=False
        )
        self._clock_s = 0.0

    def save(self, path: Path) -> None:
        """Writes the recording.

        Raises:
            LicError: The file cannot be written.
        """
        self._meshcat.StopRecording()
        self._meshcat.PublishRecording()
        try:
            path.write_text(self._meshcat.StaticHtml(), encoding="utf-8")
        except OSError as error:
            raise LicError(f"cannot write {path}: {error.strerror}") from None

    def _sample_steps(self) -> int:
        """Returns how many samples of a reach there are for each frame."""
        return round(self._scenario.mpc.rate_hz / self._frames_per_second)

    def _draw_goal(self, p_WG: Vector) -> None:
        radius = self._scenario.stop.success_distance_m
        self._meshcat.SetObject("/task/goal", Sphere(radius), Rgba(0.0, 0.7, 0.8, 0.9))
        self._meshcat.SetTransform("/task/goal", RigidTransform(p_WG))
        self._meshcat.SetObject("/task/pole", Cylinder(0.002, 0.3), Rgba(0.0, 0.7, 0.8, 0.9))
        self._meshcat.SetTransform("/task/pole", RigidTransform(p_WG))


class ReachRecording(MeshcatRecording):
    """A Meshcat scene of one environment in which reaches are recorded one after another.

    A reach is simulated first, as anywhere else but with its states kept, and its samples are
    drawn afterwards.

    Args:
        scenario: Robot, task and control rate.
        instance: The environment.
        torso_m: Height of the robot's torso, metres; by default as the scenario's task has it.
    """

    def __init__(
        self, scenario: Scenario, instance: ClutterInstance, torso_m: float | None = None
    ) -> None:
        super().__init__(scenario)
        diagram = make_reach_diagram(
            scenario, instance, self._meshcat, base_slides=True, torso_m=torso_m
        )
        self._drawing = Simulation(diagram, scenario.scene)
        if in_plane(scenario):
            self._draw_start_line()

    def add_reach(self, trace: ReachTrace, p_WG: Vector) -> None:
        """Records a reach.

        Args:
            trace: Its samples with their states.
            p_WG: Its goal, shape (3,), metres.
        """
        self._draw_goal(p_WG)
        self._drawing.set_base(trace.p_WR)
        for k in range(0, len(trace.states), self._sample_steps()):
            self._drawing.set_state(trace.states[k])
            self._drawing.publish(self._clock_s + trace.time_s[k])
        if trace.time_s:
            self._clock_s += math.ceil(trace.time_s[-1] + PAUSE_S)

    def _draw_start_line(self) -> None:
        """Draws where the hand may start, green, or, with a mobile base, where that may, blue."""
        line, track = self._scenario.task.start_line, self._scenario.task.base
        if track is None:
            ends = np.array([[line.x_m, line.y_min_m, -0.1], [line.x_m, line.y_max_m, -0.1]])
            self._meshcat.SetLine("/task/start_line", ends.T, 3.0, Rgba(0.1, 0.65, 0.2, 1.0))
        else:
            ends = np.array([[0.0, track.y_min_m, -0.1], [0.0, track.y_max_m, -0.1]])
            self._meshcat.SetLine("/task/base_track", ends.T, 3.0, Rgba(0.1, 0.3, 0.8, 1.0))


def _make_meshcat() -> Meshcat:
    """Returns a Meshcat without the message that tells where to look at it live."""
    logger = logging.getLogger("drake")
    level = logger.level
    logger.setLevel(logging.WARNING)
    try:
        return Meshcat(MeshcatParams(show_stats_plot=False))
    finally:
        logger.setLevel(level)
