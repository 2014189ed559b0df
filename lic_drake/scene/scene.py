"""Plant and scene graph from an arm, a clutter instance and a contact configuration."""

from dataclasses import dataclass, field

import numpy as np
from pydrake.geometry import Box, Cylinder, GeometryId, RoleAssign, SceneGraph, Shape, Sphere
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import ModelInstanceIndex, RigidBody, SpatialInertia, UnitInertia
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.config import check_numbers
from lic_drake.errors import ScenarioError
from lic_drake.robots.arm import Arm
from lic_drake.scene.contact import (
    ContactConfig,
    object_color,
    object_properties,
    skin_properties,
)
from lic_drake.scene.movables import add_movable, add_stems
from lic_drake.types import Vector

_STEP_SLACK = 1e-9
# Relative slack on the maximum step. Without it, round-off added a fifth, near-zero step to every
# other control period of four steps.


@dataclass(kw_only=True)
class SceneConfig:
    """Simulation parameters."""

    # Step of a discrete plant, seconds; 0 makes the plant continuous for the error-controlled
    # CENIC integrator, which is faster than steps of 5 ms and resolves impacts better.
    time_step_s: float = 0.0
    # Accuracy of CENIC, and its maximum step, seconds: without one, an impact within a long step
    # appears as a single force of hundreds of newtons.
    cenic_accuracy: float = 1e-4
    cenic_max_step_s: float = 0.01
    # A control period in which the arm moves less than this, metres, is one step without error
    # control (up to twice as far: two steps, beyond: four), unless the total force on the skin
    # changes by more than the second value, N. 0: always error control.
    calm_move_m: float = 0.0
    calm_change_N: float = 0.3
    # Contact approximation of a discrete plant.
    contact_approximation: str = "lagged"
    # Dry friction of a movable object on the ground, N (authors' simulator), and the speed at which
    # it saturates, m/s.
    ground_friction_N: float = 2.0
    ground_creep_m_per_s: float = 1e-3
    # Viscous drag of a floating object, N s/m: the velocity of 0.1 kg halves every 1 ms.
    drag_N_s_per_m: float = 69.3
    # Density of the skin's sensors, 1/m (paper V-A: 100 in the plane).
    taxels_per_m: float = 100.0
    contact: ContactConfig = field(default_factory=ContactConfig)

    def __post_init__(self) -> None:
        if self.time_step_s != 0.0 and not 1e-5 <= self.time_step_s <= 0.1:
            raise ScenarioError(
                f"time_step_s must be from 1e-05 to 0.1, or 0, got {self.time_step_s}"
            )
        if self.contact_approximation not in ("sap", "similar", "lagged"):
            raise ScenarioError(
                "contact_approximation must be one of sap, similar, lagged,"
                f" got {self.contact_approximation!r}"
            )
        names = "cenic_accuracy cenic_max_step_s ground_friction_N ground_creep_m_per_s"
        check_numbers(
            self,
            positive=[*names.split(), "drag_N_s_per_m", "calm_change_N"],
            non_negative=["calm_move_m"],
            ranges={"taxels_per_m": (1.0, 1000.0)},
        )


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A finalized plant with its contents.

    Attributes:
        arm: Model instance of the robot.
        clutter: Model instance of the movable objects and stems.
        skin_links: Skin geometry -> index into the arm's link names.
        body: Collision geometry of the rest of the robot.
        objects: Collision geometry of each object of the instance.
        num_axes: Degrees of freedom of a movable object, see `ClutterInstance`.
    """

    plant: MultibodyPlant
    scene_graph: SceneGraph
    arm: ModelInstanceIndex
    clutter: ModelInstanceIndex
    skin_links: dict[GeometryId, int]
    body: tuple[GeometryId, ...]
    objects: tuple[GeometryId, ...]
    robot: Arm
    num_axes: int


def add_scene(
    builder: DiagramBuilder,
    arm: Arm,
    instance: ClutterInstance,
    config: SceneConfig,
    visuals: bool = False,
    mobile: bool = False,
    height_m: float = 0.0,
) -> Scene:
    """Adds a plant with the arm and the clutter, and its scene graph, to a builder.

    Movable objects only translate, in the ground plane or in space: the friction torque of the
    authors' planar objects exceeds any contact torque, so that they never spin. With `visuals`
    objects have visual geometry, too, which takes a third more time to build. For `mobile` and
    `height_m` see `Arm.add_to_plant`.
    """
    plant, scene_graph = AddMultibodyPlant(
        MultibodyPlantConfig(
            time_step=config.time_step_s,
            discrete_contact_approximation=config.contact_approximation,
            contact_model="hydroelastic_with_fallback",
            use_sampled_output_ports=False,
        ),
        builder,
    )
    plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    arm_instance = arm.add_to_plant(plant, mobile=mobile, height_m=height_m)
    source = plant.get_source_id()
    assert source is not None
    skin_links = {
        geometry: link
        for link, name in enumerate(arm.link_names)
        for geometry in plant.GetCollisionGeometriesForBody(plant.GetBodyByName(name, arm_instance))
    }
    skin, properties = skin_properties(config.contact), object_properties(config.contact)
    for geometry in skin_links:
        scene_graph.AssignRole(source, geometry, skin, RoleAssign.kReplace)
    clutter = plant.AddModelInstance("clutter")
    objects: list[GeometryId] = []
    surroundings = _add_surroundings(plant)
    for i in range(instance.num_objects):
        name = f"object{i}"
        if instance.movable[i]:
            body = add_movable(
                plant,
                clutter,
                name,
                instance.mass[i],
                instance.p_WO[i, : instance.num_axes],
                friction_N=config.ground_friction_N,
                creep_m_per_s=config.ground_creep_m_per_s,
                drag_N_s_per_m=config.drag_N_s_per_m,
            )
            X_BO = RigidTransform(RollPitchYaw(0.0, 0.0, instance.yaw[i]), np.zeros(3))
        else:
            body, X_BO = surroundings, pose_of(instance, i)
        shape = make_shape(instance.shape[i], instance.size[i])
        if visuals:
            color = object_color(instance, i)
            plant.RegisterVisualGeometry(body, X_BO, shape, f"{name}_visual", color)
        objects.append(
            plant.RegisterCollisionGeometry(body, X_BO, shape, f"{name}_collision", properties)
        )
    if instance.stems is not None:
        stems = instance.stems
        add_stems(plant, scene_graph, clutter, stems, properties, objects, visuals)
    plant.Finalize()
    # Dry friction and springs are actuators whose desired state is 0.
    at_rest = plant.get_desired_state_input_port(clutter)
    standstill = ConstantVectorSource(np.zeros(at_rest.size()))
    builder.Connect(builder.AddNamedSystem("standstill", standstill).get_output_port(), at_rest)
    body_geometry = tuple(
        geometry
        for index in plant.GetBodyIndices(arm_instance)
        for geometry in plant.GetCollisionGeometriesForBody(plant.get_body(index))
        if geometry not in skin_links
    )
    return Scene(
        plant=plant,
        scene_graph=scene_graph,
        arm=arm_instance,
        clutter=clutter,
        skin_links=skin_links,
        body=body_geometry,
        objects=tuple(objects),
        robot=arm,
        num_axes=instance.num_axes,
    )


def make_simulator(
    diagram: Diagram, config: SceneConfig, context: Context | None = None
) -> Simulator:
    """Returns a simulator of a scene's diagram in a context, by default a new one.

    It has the integrator that the plant needs.
    """
    context = diagram.CreateDefaultContext() if context is None else context
    simulator = Simulator(diagram, context)
    if config.time_step_s == 0.0:
        ApplySimulatorConfig(
            SimulatorConfig(integration_scheme="cenic", start_time=context.get_time()), simulator
        )
        set_steps(simulator, config)
    return simulator


def set_steps(simulator: Simulator, config: SceneConfig, fixed_s: float = 0.0) -> None:
    """Lets CENIC control its error, or else make steps of a fixed length, seconds."""
    longest_s = (fixed_s or config.cenic_max_step_s) * (1.0 + _STEP_SLACK)
    integrator = simulator.get_mutable_integrator()
    integrator.set_fixed_step_mode(fixed_s > 0.0)
    integrator.set_target_accuracy(config.cenic_accuracy)
    # Instead of a tenth of it: nearly all steps have the maximum length.
    integrator.request_initial_step_size_target(longest_s)
    integrator.set_maximum_step_size(longest_s)


def _add_surroundings(plant: MultibodyPlant) -> RigidBody:
    """Adds a welded body for fixed objects.

    The world body will not do: Drake 1.58 finds no contacts with geometry of the world that
    `ChangeShape` has moved (`lic_drake.reach.sleeping`).
    """
    body = plant.AddRigidBody(
        "surroundings",
        plant.AddModelInstance("surroundings"),
        SpatialInertia(1.0, np.zeros(3), UnitInertia.SolidSphere(1.0)),
    )
    plant.WeldFrames(plant.world_frame(), body.body_frame())
    return body


def pose_of(instance: ClutterInstance, i: int) -> RigidTransform:
    """Returns X_WO of an object."""
    return RigidTransform(RollPitchYaw(0.0, 0.0, instance.yaw[i]), instance.p_WO[i])


def make_shape(shape: str, size: Vector) -> Shape:
    """Returns Drake's shape for a `ClutterInstance` entry."""
    if shape == "box":
        return Box(size)
    return Cylinder(size[0], size[1]) if shape == "cylinder" else Sphere(size[0])
