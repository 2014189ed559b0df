"""Rendered stills of attempts: start, moment of the largest contact force, and end."""

from pathlib import Path
from typing import NamedTuple, cast

import numpy as np
from matplotlib.figure import Figure
from pydrake.geometry import Box, LightParameter, Sphere
from pydrake.multibody.plant import ContactResults
from pydrake.systems.framework import DiagramBuilder

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.control.tactile_sensor import read_patches
from lic_drake.errors import RenderingError
from lic_drake.perception.cameras import (
    RENDERER,
    add_camera,
    add_prop,
    look_at,
    make_renderer,
    take_color_image,
)
from lic_drake.perception.config import CameraConfig
from lic_drake.perception.image import CameraImage
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.trace import SceneState
from lic_drake.show.detections import draw_image
from lic_drake.show.figures import ShownTrial, save_figure
from lic_drake.show.stage import FLOOR_THICKNESS_M, add_stage, floor_centre, place
from lic_drake.types import Vector

CAMERA = CameraConfig(width=1280, height=960, focal_px=1100.0)
"""The camera."""

GOAL_COLOR = np.array([0.0, 0.65, 0.8, 1.0])
"""Colour of the goal, RGBA."""
FLOOR_COLOR = np.array([0.74, 0.74, 0.76, 1.0])
"""Colour of the floor, RGBA."""

NEWTONS_PER_METRE = 20.0
"""Scale of the force arrows."""

LONGEST_ARROW_M = 0.3
"""Maximum length of a force arrow; the caption gives the largest force."""

LEAST_FORCE_N = 0.05
"""Minimum force that is drawn."""


type View = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Position and target of a camera, (x, y, z), metres."""

PLANAR_VIEWS: dict[str, View] = {"": ((-0.45, -0.62, 0.95), (0.46, 0.0, -0.08))}
"""From behind and above, to the right."""

SPATIAL_VIEWS: dict[str, View] = {
    "": ((-0.75, -2.25, 1.75), (0.22, -0.05, 0.78)),
    "inside": ((1.8, -1.0, 1.75), (0.55, -0.12, 1.0)),
}
"""Robot, board and clutter from the right; the clutter from behind the board."""


class Still(NamedTuple):
    """An image without depths, and the forces f_W on the arm at points p_WC, shape (n, 3)."""

    image: CameraImage
    p_WC: Vector
    f_W: Vector


class StillCamera:
    """Renders states of one environment that were simulated before."""

    def __init__(
        self,
        scenario: Scenario,
        instance: ClutterInstance,
        p_WG: Vector,
        drake_models: Path | None = None,
        camera: CameraConfig | None = None,
    ) -> None:
        """Builds the scene for a camera, by default `CAMERA`; a RenderingError if it cannot.

        For the environment see `lic_drake.show.stage.add_stage`.
        """
        self._config = camera or CAMERA
        builder = DiagramBuilder()
        self._scene = add_stage(builder, scenario, instance, drake_models)
        scene_graph = self._scene.scene_graph
        try:
            renderer = make_renderer(_lamps(2.5 if drake_models else 1.0))
            scene_graph.AddRenderer(RENDERER, renderer)
        except RuntimeError as error:  # It loads the meshes now.
            raise RenderingError(f"a mesh cannot be rendered: {error}") from None
        planar = scenario.arm().is_planar
        floor = Box(12.0, 12.0, FLOOR_THICKNESS_M)
        add_prop(scene_graph, "floor", floor, floor_centre(planar), FLOOR_COLOR)
        radius = scenario.stop.success_distance_m
        add_prop(scene_graph, "goal", Sphere(radius), p_WG, GOAL_COLOR)
        self.views = PLANAR_VIEWS if planar else SPATIAL_VIEWS
        self._sensors = {
            name: add_camera(builder, scene_graph, f"{name}_camera", self._config, look_at(*view))
            for name, view in self.views.items()
        }
        self._diagram = builder.Build()
        self._context = self._diagram.CreateDefaultContext()

    def take(self, view: str, b0: Vector, state: SceneState) -> Still:
        """Returns a still from one of `views`, given by its name."""
        place(self._scene, self._context, b0, state.q, state)
        X_WC = look_at(*self.views[view])
        image = CameraImage(
            color=take_color_image(self._sensors[view], self._context),
            depth=np.full((self._config.height, self._config.width), np.nan),
            focal_px=self._config.focal_px,
            R_WC=np.array(X_WC.rotation().matrix()),
            p_WC=np.array(X_WC.translation()),
        )
        return Still(image, *self._forces())

    def _forces(self) -> tuple[Vector, Vector]:
        """Returns the centres of pressure on the skin and the normal forces there."""
        plant, skin = self._scene.plant, self._scene.skin_links
        port = plant.get_contact_results_output_port()
        results = cast(ContactResults, port.Eval(plant.GetMyContextFromRoot(self._context)))
        contacts = [c for c in read_patches(results, skin.get) if c.force.sum() > 0.0]
        p_WC = [np.average(c.p_RQ, axis=0, weights=c.force) for c in contacts]
        f_W = [-c.force @ c.n_R for c in contacts]
        return np.reshape(p_WC, (-1, 3)), np.reshape(f_W, (-1, 3))


def save_stills(trial: ShownTrial, camera: StillCamera, out: Path) -> dict[str, Path]:
    """Writes attempt1_start.png, attempt1_middle.png, attempt1_end.png and so on.

    For a robot in space attempt1_inside.png shows the end from behind the board. Returns the files
    by kind.
    """
    files = {}
    for number, (_, trace) in enumerate(trial, start=1):
        if not trace.states:
            continue
        last = len(trace.states) - 1
        hardest = int(np.argmax(trace.total_force)) if any(trace.contacts) else last // 2
        shots = [("start", "", 0), ("middle", "", hardest), ("end", "", last)]
        shots += [(view, view, last) for view in camera.views if view]
        for name, view, k in shots:
            still = camera.take(view, trace.b0, trace.states[k])
            path = out / f"attempt{number}_{name}.png"
            save_figure(draw_still(still, still_caption(trial, number, k)), path, margins=False)
            files[f"attempt {number} {name}"] = path
    return files


def still_caption(trial: ShownTrial, number: int, k: int) -> str:
    """Returns the words for sample k of an attempt, counted from 1; at its end with the outcome."""
    trace = trial.traces[number - 1]
    caption = f"attempt {number}, {trace.time_s[k]:.1f} s"
    at_end = k == len(trace.states) - 1
    return f"{caption}: {trial.attempts[number - 1].record.outcome}" if at_end else caption


def draw_still(still: Still, caption: str, scale: float = 1.0) -> Figure:
    """Returns a still with arrows for the forces on the arm, and a caption if there is one.

    `scale` multiplies the sizes of words and arrowheads.
    """
    image = still.image
    height, width = image.shape
    figure = Figure(figsize=(0.005 * width, 0.005 * height))
    ax = draw_image(figure.add_axes((0.0, 0.0, 1.0, 1.0)), image)
    strength = np.linalg.norm(still.f_W, axis=1)
    shown = strength > LEAST_FORCE_N
    length = np.minimum(strength[shown] / NEWTONS_PER_METRE, LONGEST_ARROW_M)
    arrows = still.f_W[shown] * (length / strength[shown])[:, np.newaxis]
    tails = image.project(still.p_WC[shown])
    heads = image.project(still.p_WC[shown] + arrows)
    style = {"arrowstyle": "-|>", "color": "crimson", "shrinkA": 0}
    style |= {"lw": 1.8 * scale, "mutation_scale": 10.0 * scale}
    for tail, head in zip(tails, heads, strict=True):
        ax.annotate("", xy=head, xytext=tail, annotation_clip=False, arrowprops=style)
    if caption and np.any(shown):
        caption += f"; forces on the arm up to {strength.max():.1f} N"
    if caption:
        paper = {"facecolor": "white", "edgecolor": "none", "alpha": 0.7}
        ax.text(30, 45, caption, fontsize=9.0 * scale, color="0.15", bbox=paper)
    return figure


def _lamps(strength: float) -> list[LightParameter]:
    """Returns a lamp behind and above the robot, and one at the camera.

    VTK computes light physically for the meshes' materials, which takes stronger lamps.
    """
    return [
        LightParameter(type="directional", frame=frame, direction=direction, intensity=intensity)
        for frame, direction, intensity in (
            ("world", [0.5, 0.5, -1.0], 0.65 * strength),
            ("camera", [0.0, 0.0, 1.0], 0.75 * strength),
        )
    ]
