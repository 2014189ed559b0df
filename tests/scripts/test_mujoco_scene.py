"""MuJoCo's scene against Drake's, and against statics and Newton's law."""

import numpy as np
import pytest
from support.worlds import ARM, World, cylinder, make_clutter, make_world

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.scene.scene import SceneConfig

pytest.importorskip("mujoco")

import mujoco

from scripts.mujoco.mujoco_scene import MujocoConfig, make_mujoco_scene

BENT = np.deg2rad([-30.0, 60.0, 50.0])
PARKED = np.deg2rad([-140.0, 100.0, 120.0])
AXIS_LIMIT = 0.25 * np.pi * 2.0
"""Dry friction along x or y, N: 2 N in the mean over all directions, in both engines."""


class MujocoWorld:
    """Arm and clutter in MuJoCo with fixed equilibrium angles."""

    def __init__(self, q: np.ndarray, clutter: ClutterInstance, **config: float | bool) -> None:
        scene = make_mujoco_scene(ARM, clutter, SceneConfig(), MujocoConfig(**config))
        self.model, self.link_of = scene.model, scene.link_of
        self.data = mujoco.MjData(self.model)
        self.data.qpos[:3] = self.data.ctrl[:] = q

    @property
    def q(self) -> np.ndarray:
        return self.data.qpos[:3].copy()

    def advance(self, duration_s: float) -> None:
        steps = round(duration_s / self.model.opt.timestep)
        mujoco.mj_step(self.model, self.data, steps)


@pytest.mark.parametrize("time_step_s", [0.001, 0.005])
@pytest.mark.parametrize("sleep", [True, False])
@pytest.mark.parametrize("angle_deg", [0.0, 45.0, 90.0])
def test_dry_friction_holds_below_its_limit_and_yields_above(
    angle_deg: float, sleep: bool, time_step_s: float
) -> None:
    direction = np.array([np.cos(np.deg2rad(angle_deg)), np.sin(np.deg2rad(angle_deg))])
    limit = AXIS_LIMIT / np.abs(direction).max()
    clutter = make_clutter(cylinder(0.6, 0.0, movable=True))
    for force in (0.95 * limit, 1.05 * limit, 5.0):
        world = MujocoWorld(PARKED, clutter, sleep=sleep, time_step_s=time_step_s)
        world.data.qfrc_applied[3:] = force * direction
        world.advance(0.5)
        speed = float(np.linalg.norm(world.data.qvel[3:]))
        along = np.abs(force * direction)
        expected = 0.5 * np.linalg.norm(np.maximum(along - AXIS_LIMIT, 0.0))
        assert speed == pytest.approx(expected, rel=0.02, abs=1.5e-3)


def press(world: World | MujocoWorld, first: np.ndarray, force: float) -> tuple[float, float]:
    """Presses link 3 on the last cylinder; returns penetration, metres, and force, N, of statics.

    Args:
        world: A cylinder near link 3, alone or movable in front of a fixed one.
        first: Where it stands at first, shape (3,), metres.
        force: How hard to press, N.
    """
    R_RL, _ = ARM.calc_pose(BENT)[:2]
    J = ARM.point_jacobians(ARM.calc_pose(BENT), np.array([2]), first[None])[0]
    q_d = BENT + J.T @ (force * R_RL[2, :, 0]) / ARM.stiffness
    centre = first.copy()
    if isinstance(world, MujocoWorld):
        world.data.ctrl[:] = q_d
        world.advance(6.0)
        if world.model.nv > 3:
            centre[:2] += world.data.qpos[3:]
    else:
        world.set_equilibrium(q_d)
        world.advance(6.0)
        if len(world.objects):
            centre[:2] = world.objects[0]
    R_RL, p_RL = ARM.calc_pose(world.q)[:2]
    normal, p_LC = R_RL[2, :, 0], centre - p_RL[2]
    J = ARM.point_jacobians(ARM.calc_pose(world.q), np.array([2]), (centre - 0.01 * normal)[None])[
        0
    ]
    f_C = np.linalg.lstsq(J[:2].T, ARM.stiffness * (q_d - world.q), rcond=None)[0]
    return 0.025 - float(p_LC @ normal), float(f_C @ normal[:2])


@pytest.mark.parametrize(("movable", "time_step_s"), [(False, 0.005), (True, 0.001)])
def test_a_link_pressed_on_a_cylinder_is_about_as_stiff_as_in_drake(
    movable: bool, time_step_s: float
) -> None:
    R_RL, p_RL = ARM.calc_pose(BENT)[:2]
    first = p_RL[2] - 0.2 * R_RL[2, :, 1] + 0.0252 * R_RL[2, :, 0]
    behind = first + 0.0202 * R_RL[2, :, 0]
    near = cylinder(*first[:2], movable=movable)
    clutter = make_clutter(near, cylinder(*behind[:2])) if movable else make_clutter(near)
    stiffness = []
    for world in (
        MujocoWorld(BENT, clutter, time_step_s=time_step_s),
        make_world(BENT, clutter, SceneConfig(time_step_s=0.005)),
    ):
        (shallow, low), (deep, high) = (press(world, first, force) for force in (2.0, 5.0))
        assert high > low + 2.0
        stiffness.append((high - low) / (deep - shallow))
    # Drake's patch stiffens with the force; MuJoCo knows the inertia at the contact roughly.
    assert stiffness[0] == pytest.approx(stiffness[1], rel=0.25)
