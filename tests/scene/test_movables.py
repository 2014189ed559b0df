import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, SimulatorConfig
from support.worlds import World, make_world

from lic_drake.clutter.instance import ClutterInstance, make_objects
from lic_drake.scene.movables import CARRIAGE_SHARE
from lic_drake.scene.scene import SceneConfig

PARKED = np.deg2rad([-150.0, 0.0, 0.0])
MASS, DRAG = 0.1, 69.3
P_WO = np.array([0.6, 0.4, 0.3])
# Carriages move along with the sphere: two along x, one along y.
MASSES = MASS * (1.0 + CARRIAGE_SHARE * np.array([2.0, 1.0, 0.0]))


def ball() -> ClutterInstance:
    return make_objects("sphere", [0.05], P_WO, mass=MASS, movable=True)


def world_of(time_step_s: float) -> World:
    world = make_world(PARKED, ball(), SceneConfig(time_step_s=time_step_s, drag_N_s_per_m=DRAG))
    if time_step_s == 0.0:
        config = SimulatorConfig(integration_scheme="cenic", accuracy=1e-4, max_step_size=0.01)
        ApplySimulatorConfig(config, world.simulator)
    return world


def velocity(world: World) -> np.ndarray:
    return world.scene.plant.GetVelocities(world.plant_context, world.scene.clutter)


def position(world: World) -> np.ndarray:
    return world.scene.plant.GetPositions(world.plant_context, world.scene.clutter)


def test_a_sphere_is_where_the_environment_has_it_and_stays_there() -> None:
    world = world_of(0.0)
    np.testing.assert_array_equal(position(world), P_WO)
    world.advance(0.5)
    np.testing.assert_array_equal(position(world), P_WO)
    assert world.scene.num_axes == 3


def test_a_pushed_spheres_velocity_halves_every_millisecond() -> None:
    step_s, steps = 1e-4, 10
    world = world_of(step_s)
    first = np.array([0.3, -0.2, 0.1])
    world.scene.plant.SetVelocities(
        world.scene.plant.GetMyMutableContextFromRoot(world.context), world.scene.clutter, first
    )
    world.advance(steps * step_s)
    # Implicit steps divide by 1 + h c / m; small ones make that the exponential.
    np.testing.assert_allclose(velocity(world), first / (1.0 + step_s * DRAG / MASSES) ** steps)
    np.testing.assert_allclose(velocity(world), 0.5 * first, rtol=0.04)
    world.advance(0.05)
    np.testing.assert_allclose(position(world) - P_WO, first * MASSES / DRAG, rtol=1e-6)
