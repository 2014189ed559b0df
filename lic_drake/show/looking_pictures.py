"""What a demonstration with cameras shows: what was seen, what was estimated of it, and a film."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.evaluate.trial import Attempt
from lic_drake.perception.observer import Observer
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.trace import ReachTrace
from lic_drake.select.lic import LicSelector
from lic_drake.select.situation import FailedReach, Situation
from lic_drake.show.aperture_map import estimate_apertures
from lic_drake.show.drawing import draw_apertures, draw_goal, draw_passable_probability
from lic_drake.show.film import FilmCamera, save_film
from lic_drake.show.looking_page import make_sequence_page
from lic_drake.show.pictures import AperturePictures
from lic_drake.show.plots import save_figure
from lic_drake.show.pr2_meshes import LinkMesh

FRAMES_PER_SECOND = 2.0
"""Of the film, in simulated time."""


class LookingPictures(AperturePictures):
    """A PR2 before foliage: the looks with their maps, the reaches, and both cameras' views."""

    def __init__(
        self, instance: ClutterInstance, observer: Observer, meshes: Sequence[LinkMesh] = ()
    ) -> None:
        """Sets up the pictures.

        Args:
            instance: The environment.
            observer: What the robot sees of it.
            meshes: What the PR2 wears instead of the shapes of its model.
        """
        super().__init__(
            observer.scenario, instance, observer.belief(0).starts, observer.p_WG, meshes
        )
        self._observer = observer
        self._frames: list[NDArray[np.uint8]] = []
        self._film = FilmCamera(instance, observer.p_WG, observer.cameras)

    def add(self, request: ReachRequest, record: ReachRecord, trace: ReachTrace) -> None:
        """Records base, torso and arm moving to the start, and the reach; films it."""
        super().add(request, record, trace)
        b0 = request.start.b0
        step = max(1, round(self._observer.scenario.mpc.rate_hz / FRAMES_PER_SECOND))
        self._frames += [self._film.frame(b0, state) for state in trace.states[::step]]

    def save(self, out: Path, selector: LicSelector, done: Sequence[Attempt]) -> dict[str, Path]:
        """Writes demo.html, apertures.png, path.png, views.webp, lookN.png and sequence.html."""
        files = super().save(out, selector, done)
        for number in range(len(done)):
            files[f"look {number + 1}"] = path = out / f"look{number + 1}.png"
            save_figure(self._look_figure(selector, done, number), path)
        if self._frames:
            files["views"] = out / "views.webp"
            save_film(self._frames, 2.0 * FRAMES_PER_SECOND, files["views"])
        files["sequence"] = out / "sequence.html"
        page = make_sequence_page(self._observer, done, files)
        files["sequence"].write_text(page, encoding="utf-8")
        return files

    def _aperture_figure(self, selector: LicSelector, done: Sequence[Attempt]) -> Figure:
        """Returns the maps before all attempts, over the head camera's images."""
        figure = Figure(figsize=(6.0 * len(done), 4.8), layout="constrained")
        axes = figure.subplots(1, len(done), squeeze=False)[0]
        for number, ax in enumerate(axes):
            self._draw_map(ax, selector, done, number)
        return figure

    def _look_figure(self, selector: LicSelector, done: Sequence[Attempt], number: int) -> Figure:
        """Returns what was seen before an attempt, from 0, and what was made of it."""
        look = self._observer.belief(number).look
        figure = Figure(figsize=(15.0, 4.3), layout="constrained")
        seen, estimated, external = figure.subplots(1, 3)
        draw_apertures(seen, look.views.head, look.apertures)
        seen.set_title("head camera: probability of being open", fontsize=10)
        self._draw_map(estimated, selector, done, number)
        draw_goal(external, look.views.external, look.goal, self._observer.cameras.ball_radius_m)
        external.set_title(f"external camera: {external.get_title()}", fontsize=10)
        return figure

    def _draw_map(self, ax: Axes, selector: LicSelector, done: Sequence[Attempt], k: int) -> None:
        belief = self._observer.belief(k)
        failed = tuple(FailedReach.from_record(a.record) for a in done[:k])
        situation = Situation(p_WG=belief.p_WG, starts=belief.starts, failed=failed)
        values = estimate_apertures(selector.objective(situation), belief.starts)
        x0 = done[k].selection.start.x0
        apart = np.linalg.norm(belief.starts.p_WA - x0[:3], axis=1)
        draw_passable_probability(
            ax,
            belief.look.views.head,
            belief.look.apertures,
            belief.over_all(values),
            int(belief.index[np.argmin(apart)]),
        )
        model = 1 if selector.second is None else min(k + 1, 2)
        outcome = done[k].record.outcome
        ax.set_title(f"attempt {k + 1}, LIC-{model} ({selector.method}): {outcome}", fontsize=10)
