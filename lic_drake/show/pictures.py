"""What a demonstration shows of its attempts: a recording and pictures."""

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from matplotlib.figure import Figure

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.evaluate.trial import Attempt
from lic_drake.reach.pointing_starts import PointingStarts
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.starts import Starts
from lic_drake.reach.trace import ReachTrace
from lic_drake.select.lic import LicSelector
from lic_drake.select.situation import FailedReach, Situation
from lic_drake.show.aperture_map import draw_aperture_map, estimate_apertures
from lic_drake.show.attempt_figures import densities_figure
from lic_drake.show.mobile_recording import MobileRecording
from lic_drake.show.plots import ATTEMPT_COLORS, draw_top_view, save_figure
from lic_drake.show.pr2_meshes import LinkMesh
from lic_drake.show.recording import ReachRecording
from lic_drake.types import Vector


class Pictures(Protocol):
    """Collects attempts and draws them."""

    @property
    def num_attempts(self) -> int:
        """Number of attempts so far."""
        ...

    def add(self, request: ReachRequest, record: ReachRecord, trace: ReachTrace) -> None:
        """Records an attempt."""
        ...

    def save(self, out: Path, selector: LicSelector, done: Sequence[Attempt]) -> dict[str, Path]:
        """Writes everything into a folder; returns the files by kind."""
        ...


class PlanarPictures:
    """A planar reach: densities over the start line and a view from above."""

    def __init__(
        self, scenario: Scenario, instance: ClutterInstance, starts: Starts, p_WG: Vector
    ) -> None:
        self._scenario, self._instance, self._starts = scenario, instance, starts
        self._p_WG = p_WG
        self._recording = ReachRecording(scenario, instance)
        self._traces: list[ReachTrace] = []

    @property
    def num_attempts(self) -> int:
        """Number of attempts so far."""
        return len(self._traces)

    def add(self, request: ReachRequest, record: ReachRecord, trace: ReachTrace) -> None:
        """Records an attempt."""
        self._recording.add_reach(trace, self._p_WG)
        self._traces.append(trace)

    def save(self, out: Path, selector: LicSelector, done: Sequence[Attempt]) -> dict[str, Path]:
        """Writes demo.html, density.png and path.png."""
        files = {
            "recording": out / "demo.html",
            "density": out / "density.png",
            "path": out / "path.png",
        }
        self._recording.save(files["recording"])
        save_figure(densities_figure(selector, self._starts, self._p_WG, done), files["density"])
        figure = Figure(figsize=(7, 7))
        draw_top_view(
            figure.subplots(),
            self._scenario,
            self._instance,
            self._p_WG,
            list(zip(attempt_labels(done), self._traces, strict=True)),
        )
        save_figure(figure, files["path"])
        return files


class AperturePictures:
    """A PR2 before a board: what was estimated for each aperture, and the tool's paths."""

    def __init__(
        self,
        scenario: Scenario,
        instance: ClutterInstance,
        starts: PointingStarts,
        p_WG: Vector,
        meshes: Sequence[LinkMesh] = (),
    ) -> None:
        self._instance, self._starts, self._p_WG = instance, starts, p_WG
        self._recording = MobileRecording(scenario, instance, meshes)
        self._traces: list[ReachTrace] = []

    @property
    def num_attempts(self) -> int:
        """Number of attempts so far."""
        return len(self._traces)

    def add(self, request: ReachRequest, record: ReachRecord, trace: ReachTrace) -> None:
        """Records base, torso and arm moving to the start, and the reach."""
        if self._traces:
            self._recording.retract(self._traces[-1])
        b0 = request.start.b0
        if trace.q:
            self._recording.move_to(b0, trace.q[0])
        self._recording.add_reach(trace, self._p_WG, b0)
        self._traces.append(trace)

    def save(self, out: Path, selector: LicSelector, done: Sequence[Attempt]) -> dict[str, Path]:
        """Writes demo.html, apertures.png and path.png."""
        files = {
            "recording": out / "demo.html",
            "apertures": out / "apertures.png",
            "path": out / "path.png",
        }
        self._recording.save(files["recording"])
        save_figure(self._aperture_figure(selector, done), files["apertures"])
        save_figure(self._path_figure(done), files["path"])
        return files

    def _aperture_figure(self, selector: LicSelector, done: Sequence[Attempt]) -> Figure:
        """Returns a map before each attempt."""
        starts = self._starts
        figure = Figure(figsize=(6.5 * len(done), 4.5))
        axes = figure.subplots(1, len(done), squeeze=False)[0]
        for number, (ax, attempt) in enumerate(zip(axes, done, strict=True), start=1):
            failed = tuple(FailedReach.from_record(a.record) for a in done[: number - 1])
            situation = Situation(p_WG=self._p_WG, starts=starts, failed=failed)
            draw_aperture_map(
                ax,
                starts.p_WA,
                estimate_apertures(selector.objective(situation), starts),
                starts.all_apertures,
                starts.aperture_m,
                self._p_WG,
                [(f"attempt {number}", attempt.selection.start.x0[:3])],
            )
            model = 1 if selector.second is None else min(number, 2)
            ax.set_title(f"LIC-{model} ({selector.method}): {attempt.record.outcome}", fontsize=10)
        return figure

    def _path_figure(self, done: Sequence[Attempt]) -> Figure:
        """Returns the tool's paths, from above and from the side."""
        figure = Figure(figsize=(6, 7), layout="constrained")
        for ax, (across, name) in zip(figure.subplots(1, 2), ((1, "y"), (2, "z")), strict=True):
            for i in range(self._instance.num_objects):
                p, size = self._instance.p_WO[i], self._instance.size[i]
                if self._instance.movable[i]:
                    ax.plot(p[0], p[across], "o", ms=11, color="0.85", zorder=0)
                else:
                    ends = p[across] + 0.5 * size[across] * np.array([-1.0, 1.0])
                    ax.plot([p[0], p[0]], ends, color="0.45", lw=2, zorder=1)
            labels = attempt_labels(done)
            for i, (label, trace) in enumerate(zip(labels, self._traces, strict=True)):
                path = np.array(trace.p_WE).reshape(-1, 3)
                color = ATTEMPT_COLORS[i % len(ATTEMPT_COLORS)]
                ax.plot(path[:, 0], path[:, across], color=color, lw=2, label=label, zorder=3)
            ax.plot(self._p_WG[0], self._p_WG[across], "o", ms=7, color="tab:cyan", zorder=4)
            ax.set(xlabel="x [m]", ylabel=f"{name} [m]", aspect="equal")
            ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), fontsize=8)
        return figure


def attempt_labels(done: Sequence[Attempt]) -> list[str]:
    """Returns a label for each attempt: which one it is and how it ended."""
    words = ("first", "second", "third", "fourth", "fifth")
    return [f"{words[i]} start: {attempt.record.outcome}" for i, attempt in enumerate(done)]
