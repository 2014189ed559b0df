"""Movable objects: about 2 N dry friction on the ground, no spin; fixed ones do not move."""

import numpy as np
import pytest
from support.worlds import box, cylinder, make_clutter, make_world

from lic_drake.scene.scene import SceneConfig

PARKED = np.deg2rad([-140.0, 100.0, 120.0])  # The arm folded at the base, far from the objects.
TIME_STEPS = [0.0005, 0.005]
AXIS_LIMIT = 0.25 * np.pi * 2.0
"""Limit along x or y, N: then the mean resistance over all directions of motion is 2 N."""


def velocity_after_push(
    force: tuple[float, float], time_step: float = 0.0025, mass: float = 1.0, time: float = 0.5
) -> np.ndarray:
    world = make_world(
        PARKED,
        make_clutter(cylinder(0.6, 0.0, movable=True, mass=mass)),
        SceneConfig(time_step_s=time_step),
    )
    world.push("object0", np.zeros(3), np.append(force, 0.0))
    world.advance(time)
    return world.object_velocities[0]


@pytest.mark.parametrize("time_step", TIME_STEPS)
@pytest.mark.parametrize("force", [0.0, 0.5, 1.5])
def test_a_push_below_the_limit_only_makes_an_object_creep(force: float, time_step: float) -> None:
    v = velocity_after_push((force, 0.0), time_step)
    assert (0.0 < v[0] < 1e-3) if force else v[0] == 0.0
    assert v[1] == 0.0


@pytest.mark.parametrize("time_step", TIME_STEPS)
@pytest.mark.parametrize(("force", "mass"), [(2.0, 1.0), (-5.0, 1.0), (5.0, 0.5)])
def test_a_push_above_the_limit_accelerates_by_newtons_law(
    force: float, mass: float, time_step: float
) -> None:
    v = velocity_after_push((0.0, force), time_step, mass)
    expected = np.sign(force) * (abs(force) - AXIS_LIMIT) / mass * 0.5
    assert v[1] == pytest.approx(expected, rel=0.01)
    assert v[0] == pytest.approx(0.0, abs=1e-12)


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
