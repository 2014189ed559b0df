"""Small worlds for tests: hand-made clutter, and arm and clutter without sensor or controller."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from lic_drake.clutter.instance import ClutterInstance, join, make_objects
from lic_drake.control.mpc import MpcInput
from lic_drake.control.tactile_sensor import TactileSensor
from lic_drake.control.taxels import planar_taxels
from lic_drake.robots.planar import planar_arm
from lic_drake.scene.scene import Scene, SceneConfig, add_scene, make_simulator

ARM = planar_arm()
LAYOUT = planar_taxels(ARM.skin, ARM.link_names)


make_clutter = join


def controller_input(
    q: np.ndarray,
    taxels: Sequence[int],
    forces: Sequence[float],
    q_d: np.ndarray | None = None,
    p_EG: Sequence[float] = (0.0, 0.0, 0.0),
) -> MpcInput:
    """The controller's input at a configuration with forces on some taxels."""
    index, pose = np.array(taxels, dtype=int), ARM.calc_pose(q)
    links = LAYOUT.link[index]
    p_RC = pose.p_RL[links] + np.einsum("ijk,ik->ij", pose.R_RL[links], LAYOUT.p_LT[index])
    return MpcInput(
        q=q,
        q_d=q if q_d is None else q_d,
        p_EG=np.array(p_EG),
        Jv_E=pose.Jv_E,
        normals=np.einsum("ijk,ik->ij", pose.R_RL[links], LAYOUT.n_L[index]),
        forces=np.array(forces, dtype=float),
        Jv_C=ARM.point_jacobians(pose, links, p_RC),
    )


def cylinder(
    x: float, y: float, *, movable: bool = False, radius: float = 0.01, mass: float = 1.0
) -> ClutterInstance:
    """One upright cylinder of 0.2 m length."""
    return make_objects("cylinder", [radius, 0.2], [x, y], mass=mass, movable=movable)


def box(
    x: float, y: float, edges: tuple[float, float, float], yaw: float = 0.0, movable: bool = False
) -> ClutterInstance:
    """One box of 1 kg."""
    return make_objects("box", edges, [x, y], yaw=yaw, movable=movable)


def corners(instance: ClutterInstance, i: int) -> np.ndarray:
    """Corners of a box of an instance, seen from above, shape (4, 2)."""
    half = 0.5 * instance.size[i, :2]
    c, s = np.cos(instance.yaw[i]), np.sin(instance.yaw[i])
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return instance.p_WO[i, :2] + (signs * half) @ np.array([[c, s], [-s, c]])


def gap_to_boxes(q: np.ndarray, instance: ClutterInstance) -> float:
    """Distance in the plane from the arm's skin to the boxes of an instance, negative inside."""
    R_WL, p_WL = ARM.calc_pose(q)[:2]
    gaps = []
    for capsule in ARM.skin:
        link = ARM.link_names.index(capsule.link)
        half = 0.5 * capsule.size[1] * capsule.R_LS[:, 2]
        p_LA = capsule.p_LS + np.linspace(-1.0, 1.0, 400)[:, np.newaxis] * half
        p_WA = (p_WL[link] + p_LA @ R_WL[link].T)[:, :2]
        for i in range(instance.num_objects):
            c, s = np.cos(instance.yaw[i]), np.sin(instance.yaw[i])
            outside = np.abs((p_WA - instance.p_WO[i, :2]) @ np.array([[c, -s], [s, c]]))
            outside -= 0.5 * instance.size[i, :2]
            distance = np.linalg.norm(np.maximum(outside, 0.0), axis=1)
            gaps.append((distance + np.minimum(outside.max(axis=1), 0.0)).min() - capsule.size[0])
    return float(min(gaps))


@dataclass(kw_only=True)
class World:
    """Arm and clutter with fixed equilibrium angles, and a context of the whole."""

    diagram: Diagram
    context: Context
    scene: Scene
    simulator: Simulator

    @property
    def plant_context(self) -> Context:
        return self.scene.plant.GetMyContextFromRoot(self.context)

    @property
    def q(self) -> np.ndarray:
        return self.scene.plant.GetPositions(self.plant_context, self.scene.arm)

    @property
    def objects(self) -> np.ndarray:
        """Positions of the movable objects, shape (n, 2)."""
        return self.scene.plant.GetPositions(self.plant_context, self.scene.clutter).reshape(-1, 2)

    @property
    def object_velocities(self) -> np.ndarray:
        plant = self.scene.plant
        return plant.GetVelocities(self.plant_context, self.scene.clutter).reshape(-1, 2)

    @property
    def taxel_force(self) -> np.ndarray:
        """Readings of the sensor that `add_sensor` added, shape (num_taxels,)."""
        return np.array(self.diagram.GetOutputPort("taxel_force").Eval(self.context))

    def set_equilibrium(self, q_d: np.ndarray) -> None:
        plant = self.scene.plant
        plant.get_desired_state_input_port(self.scene.arm).FixValue(
            self.plant_context, np.append(q_d, np.zeros(3))
        )

    def push(self, body: str, p_BoQ_B: np.ndarray, f_Q_W: np.ndarray) -> None:
        """Applies a constant force to a point of a body, and no other force."""
        force = ExternallyAppliedSpatialForce()
        force.body_index = self.scene.plant.GetBodyByName(body).index()
        force.p_BoBq_B = np.asarray(p_BoQ_B, dtype=float)
        force.F_Bq_W = SpatialForce(np.zeros(3), np.asarray(f_Q_W, dtype=float))
        self.scene.plant.get_applied_spatial_force_input_port().FixValue(
            self.plant_context, [force]
        )

    def advance(self, duration_s: float) -> None:
        self.simulator.AdvanceTo(self.context.get_time() + duration_s)


def make_world(
    q: np.ndarray,
    clutter: ClutterInstance,
    config: SceneConfig,
    extend: Callable[[DiagramBuilder, Scene], None] = lambda builder, scene: None,
) -> World:
    """Builds a world at rest with the equilibrium angles q; `extend` may add systems."""
    builder = DiagramBuilder()
    scene = add_scene(builder, ARM, clutter, config, visuals=True)
    extend(builder, scene)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    plant = scene.plant
    plant_context = plant.GetMyMutableContextFromRoot(context)
    plant.SetPositions(plant_context, scene.arm, q)
    simulator = make_simulator(diagram, config, context)
    world = World(diagram=diagram, context=context, scene=scene, simulator=simulator)
    world.set_equilibrium(q)
    return world


def add_sensor(builder: DiagramBuilder, scene: Scene) -> None:
    """Adds the tactile sensor to a world: `make_world(..., extend=add_sensor)`."""
    sensor = builder.AddNamedSystem("sensor", TactileSensor(ARM, LAYOUT, scene.skin_links))
    plant = scene.plant
    builder.Connect(plant.get_contact_results_output_port(), sensor.GetInputPort("contact_results"))
    builder.Connect(plant.get_state_output_port(scene.arm), sensor.GetInputPort("arm_state"))
    builder.ExportOutput(sensor.GetOutputPort("taxel_force"), "taxel_force")
