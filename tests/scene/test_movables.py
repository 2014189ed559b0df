"""Movable objects: about 2 N dry friction on the ground, or drag in space, and no spin."""

import numpy as np
import pytest
from support.worlds import box, cylinder, make_clutter, make_world

from lic_drake.clutter.instance import make_objects
from lic_drake.scene.movables import CARRIAGE_SHARE
from lic_drake.scene.scene import SceneConfig

PARKED = np.deg2rad([-140.0, 100.0, 120.0])  # The arm folded at the base, far from the objects.
AXIS_LIMIT = 0.25 * np.pi * 2.0
"""Limit along x or y, N: then the mean resistance over all directions of motion is 2 N."""


@pytest.mark.parametrize("time_step", [0.0005, 0.005])
@pytest.mark.parametrize(
    ("force", "mass"), [(0.0, 1.0), (0.5, 1.0), (1.5, 1.0), (2.0, 1.0), (-5.0, 1.0), (5.0, 0.5)]
)
def test_a_push_makes_an_object_creep_below_the_limit_and_accelerates_it_above(
    force: float, mass: float, time_step: float
) -> None:
    clutter = make_clutter(cylinder(0.6, 0.0, movable=True, mass=mass))
    world = make_world(PARKED, clutter, SceneConfig(time_step_s=time_step))
    world.push("object0", np.zeros(3), np.array([0.0, force, 0.0]))
    world.advance(0.5)
    v = world.object_velocities[0]
    assert v[0] == pytest.approx(0.0, abs=1e-12)
    if abs(force) > AXIS_LIMIT:
        expected = np.sign(force) * (abs(force) - AXIS_LIMIT) / mass * 0.5
        assert v[1] == pytest.approx(expected, rel=0.01)
    else:
        assert (0.0 < v[1] < 1e-3) if force else v[1] == 0.0


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 45.0])
def test_resistance_to_motion_is_near_2_newtons_in_every_direction(angle_deg: float) -> None:
    # Coasting at 5 cm/s for one or two steps: energy lost over distance gone.
    direction = np.array([np.cos(np.deg2rad(angle_deg)), np.sin(np.deg2rad(angle_deg))])
    world = make_world(
        PARKED, make_clutter(cylinder(0.6, 0.0, movable=True)), SceneConfig(time_step_s=0.0025)
    )
    plant = world.scene.plant
    plant.SetVelocities(world.plant_context, world.scene.clutter, 0.05 * direction)
    before = plant.CalcKineticEnergy(world.plant_context)
    world.advance(0.005)
    loss = before - plant.CalcKineticEnergy(world.plant_context)
    resistance = loss / np.linalg.norm(world.objects[0] - [0.6, 0.0])
    expected = AXIS_LIMIT * np.abs(direction).sum()
    assert resistance == pytest.approx(expected, rel=0.1)
    assert 1.5 < resistance < 2.4


def test_an_object_pushed_off_its_centre_moves_but_never_spins() -> None:
    world = make_world(
        PARKED, make_clutter(box(0.6, 0.0, (0.05, 0.02, 0.2), 0.4, True)), SceneConfig()
    )
    world.push("object0", np.array([0.0, 0.01, 0.05]), np.array([6.0, 3.0, 0.0]))
    world.advance(0.3)
    X_WO = world.scene.plant.GetBodyByName("object0").EvalPoseInWorld(world.plant_context)
    assert X_WO.translation()[0] > 0.7
    np.testing.assert_array_equal(X_WO.rotation().matrix(), np.eye(3))
    assert X_WO.translation()[2] == 0.0


def test_a_floating_sphere_rests_and_its_velocity_halves_every_millisecond_after_a_push() -> None:
    mass, drag, p_WO = 0.1, 69.3, np.array([0.6, 0.4, 0.3])
    ball = make_objects("sphere", [0.05], p_WO, mass=mass, movable=True)
    step_s, steps = 1e-4, 10
    world = make_world(PARKED, ball, SceneConfig(time_step_s=step_s, drag_N_s_per_m=drag))
    plant, clutter, context = world.scene.plant, world.scene.clutter, world.plant_context
    world.advance(0.01)
    np.testing.assert_array_equal(plant.GetPositions(context, clutter), p_WO)
    first = np.array([0.3, -0.2, 0.1])
    plant.SetVelocities(context, clutter, first)
    world.advance(steps * step_s)
    # Carriages move along with the sphere: two along x, one along y. Implicit steps divide by
    # 1 + h c / m; small ones make that the exponential.
    masses = mass * (1.0 + CARRIAGE_SHARE * np.array([2.0, 1.0, 0.0]))
    v = plant.GetVelocities(context, clutter)
    np.testing.assert_allclose(v, first / (1.0 + step_s * drag / masses) ** steps)
    np.testing.assert_allclose(v, 0.5 * first, rtol=0.04)
    world.advance(0.05)
    gone = plant.GetPositions(context, clutter) - p_WO
    np.testing.assert_allclose(gone, first * masses / drag, rtol=1e-6)
