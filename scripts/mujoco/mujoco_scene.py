"""The scene of a reach in MuJoCo: the same arm, cylinders, friction and stiffness as in Drake.

Everything moves in the plane z = 0, where an upright cylinder and a sphere of its radius are the
same circle; MuJoCo's spheres touch a capsule at exactly one point.

MuJoCo sets a contact by an impedance d and a reference acceleration. Its force at rest is that of a
spring of k / R with R = (1 - d) / d A, where A is what one newton accelerates the contact by (the
mean over directions at the straight arm, `body_invweight0`). So a stiffness in N/m is a value of
`solref` for every pair of link and kind of object: each link has a geometry for either kind.
"""

from dataclasses import dataclass

try:
    import mujoco
except ImportError:
    raise SystemExit("MuJoCo is not installed; get it with: pip install -e '.[bench]'") from None
import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.plant import MultibodyPlant

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.errors import ScenarioError
from lic_drake.robots.arm import Arm
from lic_drake.scene.scene import SceneConfig
from lic_drake.types import Vector

SKIN_STIFFNESS_N_PER_M = 46.8e3
"""Of a link pressed on a cylinder, measured in Drake with the shipped skin and meshes."""

CONTACT_DAMPING_NS_PER_M = 5.0
"""What Drake's Hunt & Crossley dissipation of 1 s/m is worth at 5 N."""

IMPEDANCE = 0.1
"""Low: a contact in motion is then as stiff as one at rest (at MuJoCo's 0.9, a tenth of it)."""

IMPEDANCE_RATIO = 1000.0
"""Friction against normal rows: at 1, sticking contacts of a low impedance creep."""

_MOVABLE, _FIXED = 1, 2
"""Collision bits: what hits movable and what hits fixed objects."""


@dataclass(frozen=True, kw_only=True)
class MujocoConfig:
    """How MuJoCo simulates a reach.

    Attributes:
        time_step_s: Its fixed step, seconds.
        sleep: Whether objects that nothing touches sleep, from the start.
    """

    time_step_s: float = 0.005
    sleep: bool = True


@dataclass(frozen=True, kw_only=True)
class MujocoScene:
    """A compiled model: the arm's joints come first, then x and y of every movable object.

    Attributes:
        model: The model.
        link_of: Index of the link of each geometry, -1 for objects.
    """

    model: mujoco.MjModel
    link_of: NDArray[np.intp]


def make_mujoco_scene(
    arm: Arm, instance: ClutterInstance, scene: SceneConfig, config: MujocoConfig
) -> MujocoScene:
    """Builds the model of the planar arm among upright cylinders of one mass.

    Args:
        arm: The arm.
        instance: The clutter.
        scene: Friction and stiffness; how Drake simulates does not matter here.
        config: Step and sleeping.

    Raises:
        ScenarioError: The clutter holds something else than cylinders.
    """
    if set(instance.shape) - {"cylinder"}:
        raise ScenarioError(f"only cylinders can be compared, got {sorted(set(instance.shape))}")
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    option = spec.option
    option.timestep = config.time_step_s
    # It solves contacts together with the heavily damped joint impedance. implicitfast costs the
    # same and ends reaches the same, but at 5 ms taxel forces jitter nearly twice as much with it.
    option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = IMPEDANCE_RATIO
    option.gravity = np.zeros(3)
    # A diverged reach must show, not begin again.
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    if config.sleep:
        option.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP
    _add_arm(spec, arm, 2.0 * scene.contact.object_friction)
    _add_clutter(spec, instance, scene, config.sleep)
    model = spec.compile()
    _set_stiffness(model, arm, instance, scene)
    link_of = np.full(model.ngeom, -1)
    for geom in range(model.ngeom):
        body = model.body(model.geom_bodyid[geom]).name
        if body in arm.link_names:
            link_of[geom] = arm.link_names.index(body)
    return MujocoScene(model=model, link_of=link_of)


def _add_arm(spec: mujoco.MjSpec, arm: Arm, friction: float) -> None:
    """Adds the links with their impedance; their geometries touch objects only."""
    plant = MultibodyPlant(time_step=1e-3)
    model = arm.add_to_plant(plant)
    plant.Finalize()
    parent, p_PJ = spec.worldbody, np.zeros(3)
    pose = arm.calc_pose(np.zeros(arm.num_joints))
    joints = np.vstack([pose.p_RL, pose.p_RE])
    lengths = np.linalg.norm(np.diff(joints, axis=0), axis=1)
    for i, (name, capsule) in enumerate(zip(arm.link_names, arm.skin, strict=True)):
        inertia = plant.GetBodyByName(name, model).default_spatial_inertia()
        about_com = inertia.Shift(inertia.get_com()).CalcRotationalInertia()
        body = parent.add_body(
            name=name,
            pos=p_PJ,
            explicitinertial=True,
            mass=inertia.get_mass(),
            ipos=inertia.get_com(),
            inertia=about_com.get_moments(),
        )
        body.add_joint(
            name=f"joint{i}",
            axis=[0, 0, 1],
            limited=True,
            range=[arm.q_min[i], arm.q_max[i]],
            solref_limit=[0.01, 1.0],  # By default a servo pushes it twice as far as in Drake.
        )
        for bit in (_MOVABLE, _FIXED):
            body.add_geom(
                name=_skin_name(name, bit),
                type=mujoco.mjtGeom.mjGEOM_CAPSULE,
                size=[capsule.size[0], 0.5 * capsule.size[1], 0.0],
                pos=capsule.p_LS,
                zaxis=capsule.R_LS[:, 2],
                contype=0,
                conaffinity=bit,
                priority=2,
                friction=[friction, 0.0, 0.0],
                solimp=_solimp(),
            )
        servo = spec.add_actuator(trntype=mujoco.mjtTrn.mjTRN_JOINT, target=f"joint{i}")
        servo.set_to_position(kp=arm.stiffness[i], kv=arm.damping[i])
        parent, p_PJ = body, np.array([0.0, -lengths[i], 0.0])


def _add_clutter(
    spec: mujoco.MjSpec, instance: ClutterInstance, scene: SceneConfig, sleep: bool
) -> None:
    """Adds the cylinders; movable ones slide along x and y against dry friction, as in Drake."""
    limit = 0.25 * np.pi * scene.ground_friction_N
    for i in range(instance.num_objects):
        movable = bool(instance.movable[i])
        body, at = spec.worldbody, instance.p_WO[i]
        if movable:
            body, at = body.add_body(pos=at, mass=instance.mass[i], inertia=[1e-4] * 3), np.zeros(3)
            body.explicitinertial = True
            if sleep:
                body.sleep = mujoco.mjtSleepPolicy.mjSLEEP_INIT
            for axis in np.eye(3)[:2]:
                joint = body.add_joint(
                    type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis, frictionloss=limit
                )
                # Its row creeps at R f / b with b = 2 / (d_w time constant).
                d, d_w = joint.solimp_friction[:2]
                R = (1.0 - d) / d / instance.mass[i]
                joint.solref_friction = [2.0 * scene.ground_creep_m_per_s / (limit * R * d_w), 1.0]
        body.add_geom(
            name=f"object{i}",
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[instance.size[i, 0], 0.0, 0.0],
            pos=at,
            contype=_MOVABLE if movable else _FIXED,
            conaffinity=_MOVABLE | _FIXED if movable else 0,
            priority=0 if movable else 1,
            friction=[scene.contact.object_friction, 0.0, 0.0],
            solimp=_solimp(),
        )


def _set_stiffness(
    model: mujoco.MjModel, arm: Arm, instance: ClutterInstance, scene: SceneConfig
) -> None:
    """Writes `solref` so that contacts have a stiffness in N/m and a damping in Ns/m."""
    movable = np.flatnonzero(instance.movable)
    mass = instance.mass[movable].mean() if len(movable) else np.inf
    # MuJoCo's mean takes in z, along which nothing moves.
    of_object = 2.0 / 3.0 / mass
    for i, name in enumerate(arm.link_names):
        of_link = model.body(name).invweight0[0]
        for bit, A, lightness in (
            (_MOVABLE, of_link + of_object, 1.0 / mass),
            (_FIXED, of_link, 0.0),
        ):
            A *= _metric_ratio(model, arm, i, lightness)
            model.geom(_skin_name(name, bit)).solref[:] = _solref(SKIN_STIFFNESS_N_PER_M, A)
    # Drake's point contact puts the stiffnesses of two objects in series.
    stiffness = 0.5 * scene.contact.object_stiffness_N_per_m
    for i, moves in enumerate(instance.movable):
        A = (2.0 if moves else 1.0) * of_object
        model.geom(f"object{i}").solref[:] = _solref(stiffness, A)


def _metric_ratio(model: mujoco.MjModel, arm: Arm, link: int, lightness: float) -> float:
    """Returns by how much the discrete integrator scales A for a push on the middle of a link.

    It takes A of M + h D + h^2 K instead of M, row by row; here at the middle of the joint ranges.
    """
    q = 0.5 * (arm.q_min + arm.q_max)
    data = mujoco.MjData(model)
    data.qpos[: len(q)] = q
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    M = np.diag(full)[: len(q)]
    h = model.opt.timestep
    capsule = arm.skin[link]
    pose = arm.calc_pose(q)
    R_RL = pose.R_RL[link]
    p_RC = pose.p_RL[link] + R_RL @ capsule.p_LS
    side = np.cross([0.0, 0.0, 1.0], R_RL @ capsule.R_LS[:, 2])
    row = side @ arm.point_jacobians(pose, np.array([link]), p_RC[None])[0]
    plain = row @ (row / M) + lightness
    stiffened = row @ (row / (M + h * arm.damping + h**2 * arm.stiffness)) + lightness
    return float(stiffened / plain)


def _solref(stiffness_N_per_m: float, A: float) -> Vector:
    """Returns MuJoCo's direct form: minus stiffness and damping, scaled by R."""
    return -(1.0 - IMPEDANCE) * A * np.array([stiffness_N_per_m, CONTACT_DAMPING_NS_PER_M])


def _solimp() -> list[float]:
    return [IMPEDANCE, IMPEDANCE, 1e-3, 0.5, 2.0]


def _skin_name(link: str, bit: int) -> str:
    return f"{link}_for_{bit}"
