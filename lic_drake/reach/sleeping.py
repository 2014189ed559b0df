"""A speed-up: what nothing touches is left out of the plant until the arm comes near.

What nothing touches stands still, held by the ground's dry friction or by its spring, and acts on
nothing. Distances at the control instants decide when a sleeping object or stem has to wake up. A
simulated second costs a third with it, and reaches end the same but for the last digits.
"""

import math
from collections.abc import Hashable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from pydrake.geometry import CollisionFilterDeclaration, GeometrySet

from lic_drake.clutter.instance import ClutterInstance, Stems
from lic_drake.reach.diagram import make_reach_diagram
from lic_drake.reach.rig import Rig
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.simulation import Cache, Simulation
from lic_drake.reach.trace import SceneState
from lic_drake.robots.arm import Arm
from lic_drake.scene.scene import make_shape, pose_of
from lic_drake.types import BoolVector, IntVector, Vector

WAKE_M = 0.02
"""What sleeps wakes up when the gap between it and the arm, or a pushed object, is smaller. Nothing
that moves less than this in a control period can touch it before."""

MAX_MOVE_M = 0.8 * WAKE_M
"""Largest move of the skin or an object in a control period for which waking up is in time. In
11,000 control periods of random reaches no part of the arm moved further than 13 mm."""

MOVED_M = 1e-6
"""An object displaced by less than this counts as not moved."""

GROUP_M = 0.08
"""Where a stem wakes up, so do all whose gap is at most this much larger: waking one costs as much
as waking many."""

_BALL_STEP_M = 0.03

FEWEST_SPARES = 2
"""Spare objects of the first diagram that has any; every further one has twice as many. Records
depend on it in the last digits, as the solver's order of summation does."""

PARKING_M = 100.0
"""Distance from the base, along x and y, at which spare objects wait, metres."""


class MovedTooFarError(Exception):
    """Something moved further than `MAX_MOVE_M`, and may have touched what was asleep."""


class SkinAxes:
    """The axes of the capsules around an arm's skin: seen from above (2 axes), or in space (3)."""

    def __init__(self, arm: Arm, num_axes: int = 2) -> None:
        self._num_axes = num_axes
        capsules = [shape.enclosing_capsule() for shape in arm.skin]
        half = np.array([0.5 * c.size[1] * c.R_LS[:, 2] for c in capsules])
        centre = np.array([c.p_LS for c in capsules])
        self._arm = arm
        self._link = np.array([arm.link_names.index(c.link) for c in capsules])
        self._p_LA = np.stack([centre - half, centre + half], axis=-1)
        self._radius = np.array([c.size[0] for c in capsules])[:, np.newaxis]

    def ends(self, q: Vector) -> Vector:
        """Returns the ends of the axes, shape (capsules, num_axes, 2): x, y, .. of both, metres."""
        pose = self._arm.calc_pose(q)
        d = self._num_axes
        return pose.R_RL[self._link, :d] @ self._p_LA + pose.p_RL[self._link, :d, np.newaxis]

    def gaps(self, ends: Vector, p_WO: Vector) -> Vector:
        """Returns the distances from the skin at `ends` to points, shape (n, num_axes), metres."""
        along = ends[:, :, 1] - ends[:, :, 0]
        d = p_WO - ends[:, np.newaxis, :, 0]
        # The axis of a sphere has no length, and its ends are one.
        square = np.maximum((along * along).sum(axis=1, keepdims=True), 1e-30)
        share = (d @ along[:, :, np.newaxis])[..., 0] / square
        d -= np.minimum(np.maximum(share, 0.0), 1.0)[..., np.newaxis] * along[:, np.newaxis]
        return (np.sqrt((d * d).sum(axis=2)) - self._radius).min(axis=0)


class _Monitor:
    """Follows the arm, and looks only when something has moved far enough to matter."""

    def __init__(self, axes: SkinAxes, count: int) -> None:
        self._axes = axes
        self.is_awake = np.zeros(count, dtype=bool)
        self._ends: Vector | None = None
        self._slack = 0.0

    def _must_look(self, q: Vector, move: float = 0.0) -> Vector | None:
        """Takes joint angles and the largest move of an object, metres; returns ends to look at."""
        ends = self._axes.ends(q)
        if self._ends is not None:
            # No point of an axis moves further than the end that moves further.
            move = max(move, math.sqrt(((ends - self._ends) ** 2).sum(axis=1).max()))
        if move > MAX_MOVE_M:
            raise MovedTooFarError(f"{move:.3f} m in a control period")
        self._ends = ends
        self._slack -= move
        return ends if self._slack <= 0.0 else None

    def _wake(self, woken: BoolVector, gaps: Vector) -> None:
        self.is_awake |= woken
        # Until something has moved that far, nothing else has to wake up.
        self._slack = float(gaps[~self.is_awake].min(initial=np.inf)) - WAKE_M


class ObjectMonitor(_Monitor):
    """Says which movable objects have to wake up: those near the arm or pushed objects."""

    def __init__(self, instance: ClutterInstance, axes: SkinAxes) -> None:
        self._p_WO_first = instance.p_WO[instance.movable, : instance.num_axes]
        super().__init__(axes, len(self._p_WO_first))
        self._radius = float(instance.size[instance.movable, 0].max(initial=0.0))
        self._pushed = np.zeros_like(self.is_awake)
        self.p_WO = self._p_WO_first.copy()
        self.awake: list[int] = []

    def look(self, q: Vector, p_WO_awake: Vector) -> list[int]:
        """Takes q and what is awake, shape (k, num_axes), as it woke up; returns what wakes up."""
        move = 0.0
        if self.awake:
            d = p_WO_awake - self.p_WO[self.awake]
            move = math.sqrt((d * d).sum(axis=1).max())
            self.p_WO[self.awake] = p_WO_awake
            pushed = np.abs(self.p_WO - self._p_WO_first).max(axis=1) > MOVED_M
            if (pushed != self._pushed).any():
                # What begins to move was no danger before.
                self._pushed, self._slack = pushed, 0.0
        ends = self._must_look(q, move)
        if ends is None:
            return []
        gaps = self._chained_gaps(ends)
        woken = (gaps < WAKE_M) & ~self.is_awake
        self._wake(woken, gaps)
        indices: list[int] = np.flatnonzero(woken).tolist()
        self.awake += indices
        return indices

    def _chained_gaps(self, ends: Vector) -> Vector:
        """Returns the gaps between arm or pushed objects and each object, also by way of others."""
        gaps = np.maximum(self._axes.gaps(ends, self.p_WO) - self._radius, 0.0)
        gaps[self._pushed] = 0.0
        while True:
            passing = self.is_awake | (gaps < WAKE_M)
            d = self.p_WO[:, np.newaxis] - self.p_WO[passing]
            between = np.maximum(np.sqrt((d * d).sum(axis=2)) - 2.0 * self._radius, 0.0)
            chained = np.minimum(gaps, (between + gaps[passing]).min(axis=1, initial=np.inf))
            if (chained == gaps).all():
                return gaps
            gaps = chained


class StemMonitor(_Monitor):
    """Says which stems have to wake up: those near the arm, as stems do not touch one another."""

    def __init__(self, stems: Stems, axes: SkinAxes) -> None:
        super().__init__(axes, stems.num_stems)
        self._p_WB, self._radius, self._stem = _balls(stems)

    def look(self, q: Vector) -> bool:
        """Takes the joint angles at a control instant; returns whether any stem wakes up."""
        ends = self._must_look(q)
        if ends is None:
            return False
        gaps = np.full(len(self.is_awake), np.inf)
        np.minimum.at(gaps, self._stem, self._axes.gaps(ends, self._p_WB) - self._radius)
        gaps[self.is_awake] = np.inf
        woken = (gaps < WAKE_M + GROUP_M) & (gaps.min(initial=np.inf) < WAKE_M)
        self._wake(woken, gaps)
        return bool(woken.any())


def _balls(stems: Stems) -> tuple[Vector, Vector, IntVector]:
    """Returns balls that hold stems and leaves: centres, radii, and the stem of each."""
    centres, radii, owners = [], [], []
    for i, length in enumerate(stems.length):
        count = int(np.ceil(length / _BALL_STEP_M))
        along = (np.arange(count) + 0.5) * length / count
        centres.append(stems.p_WH[i] + np.outer(along, stems.R_WS[i][:, 2]))
        radii.append(np.full(count, np.hypot(0.5 * length / count, stems.radius[i])))
        owners.append(np.full(count, i))
    stem = stems.leaf_stem
    centres.append(stems.p_WH[stem] + np.einsum("kij,kj->ki", stems.R_WS[stem], stems.p_SL))
    radii.append(0.5 * np.linalg.norm(stems.leaf_size, axis=1))
    owners.append(stem)
    return np.vstack(centres), np.concatenate(radii), np.concatenate(owners)


class World(NamedTuple):
    """What is simulated: the clutter in R, R's height above the floor, metres; and the diagrams."""

    scenario: Scenario
    instance: ClutterInstance
    height_m: float
    cache: Cache[Rig]

    def rig(self, key: Hashable, instance: ClutterInstance) -> Rig:
        """Returns the rig of an instance from the cache, built when it is missing."""

        def build() -> Rig:
            return Rig(make_reach_diagram(self.scenario, instance, self.height_m))

        return self.cache.obtain(key, build)


def make_sleeping(world: World) -> "PartlyAsleep | None":
    """Returns a simulation in which what can sleep does; None if nothing can."""
    if world.instance.stems is not None:
        return SleepingStems(world)
    return SleepingObjects(world) if can_sleep(world.instance) else None


class PartlyAsleep(Simulation):
    """A simulation without what sleeps."""

    def __init__(self, world: World, num_axes: int) -> None:
        self._world = world
        self._axes = SkinAxes(world.scenario.arm(), num_axes)

    def release(self) -> None:
        """Leaves the rig that was used last, if it came to one, to the cache."""
        for name in ("_rig", "_stepper"):
            self.__dict__.pop(name, None)

    def _go_on_in(self, rig: Rig, q: Vector) -> None:
        """Continues in another rig of the same arm, at the same time, with its controller."""
        before = self._rig
        self._begin_in(rig, q, self._p_RG, float(before.context.get_time()))
        mine, theirs = rig.diagram.controller, before.diagram.controller
        state = mine.GetMyMutableContextFromRoot(rig.context).get_mutable_discrete_state()
        state.SetFrom(theirs.GetMyContextFromRoot(before.context).get_discrete_state())


class SleepingObjects(PartlyAsleep):
    """Movable objects sleep: for one that wakes up a spare takes its place.

    When the spares do not suffice, the reach goes on in a rig with more of them. A rig serves all
    environments with as many fixed and the same movable objects.
    """

    def __init__(self, world: World) -> None:
        super().__init__(world, world.instance.num_axes)
        self._asleep: dict[int, tuple[Hashable, ClutterInstance]] = {}

    def begin(self, q: Vector, p_RG: Vector) -> None:
        """Puts the arm at rest at q and every object where the environment has it."""
        self._monitor = ObjectMonitor(self._world.instance, self._axes)
        self._begin_in(self._with_spares(0), q, p_RG)
        self.wake_near(q)

    def state(self) -> SceneState:
        """Returns the state of the arm and of all movable objects."""
        return self._state(self._monitor.awake)

    def _state(self, awake: list[int]) -> SceneState:
        now = self._rig.state()
        p_WO, v_WO = self._monitor.p_WO.copy(), np.zeros_like(self._monitor.p_WO)
        if awake:
            p_WO[awake], v_WO[awake] = now.q_clutter[: len(awake)], now.v_clutter[: len(awake)]
        return SceneState(now.q, now.v, p_WO, v_WO)

    def wake_near(self, q: Vector) -> None:
        """Wakes what the arm at joint angles q may touch before the next control update."""
        before = self._monitor.awake.copy()
        if not self._monitor.look(q, self._rig.clutter_positions()[: len(before)]):
            return
        awake, state = self._monitor.awake, self._state(before)
        if len(awake) > len(self._rig.q_clutter_first):
            enough = max(FEWEST_SPARES, 1 << (len(awake) - 1).bit_length())
            self._go_on_in(self._with_spares(min(enough, len(self._monitor.p_WO))), state.q)
        spares = self._rig.state()
        p_WO, v_WO = spares.q_clutter.copy(), spares.v_clutter.copy()
        p_WO[: len(awake)], v_WO[: len(awake)] = state.q_clutter[awake], state.v_clutter[awake]
        self._rig.set_state(SceneState(state.q, state.v, p_WO, v_WO))

    def _with_spares(self, spares: int) -> Rig:
        if spares not in self._asleep:
            asleep = put_to_sleep(self._world.instance, spares)
            self._asleep[spares] = (self._world.scenario.digest, *_kind(asleep)), asleep
        key, instance = self._asleep[spares]
        rig = self._world.rig(key, instance)
        if rig.shown is not instance:
            rig.shown = None  # An interruption may leave it between two environments.
            set_fixed_objects(rig, instance)
            height_m = self._world.height_m
            rig.scene.robot.set_height(rig.plant, rig.plant_context, rig.scene.arm, height_m)
            rig.shown = instance
        return rig


class SleepingStems(PartlyAsleep):
    """Stems sleep: when the arm comes near one, the reach goes on in a diagram that has it, too."""

    def __init__(self, world: World) -> None:
        super().__init__(world, num_axes=3)
        assert world.instance.stems is not None
        self._stems = world.instance.stems
        self._springy = ~self._stems.fixed
        self._token = object()  # Diagrams are this environment's own.

    def begin(self, q: Vector, p_RG: Vector) -> None:
        """Puts the arm at rest at q and every stem upright."""
        self._monitor = StemMonitor(self._stems, self._axes)
        self._monitor.look(q)
        self._begin_in(self._with_awake(), q, p_RG)

    def state(self) -> SceneState:
        """Returns the state of the arm and of all stems that can bend."""
        now = self._rig.state()
        shape = (np.count_nonzero(self._springy), now.q_clutter.shape[1])
        angles, rates = np.zeros(shape), np.zeros(shape)
        awake = self._monitor.is_awake[self._springy]
        angles[awake], rates[awake] = now.q_clutter, now.v_clutter
        return SceneState(now.q, now.v, angles, rates)

    def wake_near(self, q: Vector) -> None:
        """Wakes what the arm at joint angles q may touch before the next control update."""
        state = self.state()
        if not self._monitor.look(q):
            return
        self._go_on_in(self._with_awake(), state.q)
        awake = self._monitor.is_awake[self._springy]
        angles, rates = state.q_clutter[awake], state.v_clutter[awake]
        self._rig.set_state(SceneState(state.q, state.v, angles, rates))

    def _with_awake(self) -> Rig:
        awake = self._monitor.is_awake
        present = replace(self._world.instance, stems=self._stems.subset(awake))
        return self._world.rig((self._token, awake.tobytes()), present)


def can_sleep(instance: ClutterInstance) -> bool:
    """Returns whether the movable objects are all alike, so that a spare fits any."""
    shapes = {s for s, movable in zip(instance.shape, instance.movable, strict=True) if movable}
    if shapes not in ({"cylinder"}, {"sphere"}):
        return False
    size, mass = instance.size[instance.movable], instance.mass[instance.movable]
    return bool(np.all(size == size[0]) and np.all(mass == mass[0]))


def put_to_sleep(instance: ClutterInstance, spares: int) -> ClutterInstance:
    """Returns the fixed objects of an instance that can sleep, followed by parked spares."""
    fixed, first = np.flatnonzero(~instance.movable), int(np.argmax(instance.movable))
    chosen = instance.subset(np.r_[fixed, np.full(spares, first)])
    n, p_WO = len(fixed), chosen.p_WO.copy()
    p_WO[n:, : instance.num_axes] = PARKING_M + np.arange(spares)[:, np.newaxis]
    return replace(chosen, p_WO=p_WO)


def set_fixed_objects(rig: Rig, instance: ClutterInstance) -> None:
    """Puts the fixed objects of an instance in the places of those of a rig, as many of them."""
    scene = rig.scene
    context = scene.scene_graph.GetMyMutableContextFromRoot(rig.context)
    source = scene.plant.get_source_id()
    assert source is not None
    fixed = np.flatnonzero(~instance.movable).tolist()
    for i in fixed:
        shape, pose = make_shape(instance.shape[i], instance.size[i]), pose_of(instance, i)
        scene.scene_graph.ChangeShape(context, source, scene.objects[i], shape, pose)
    # A geometry of another shape has forgotten that it belongs to what is welded together.
    welded = GeometrySet([*(scene.objects[i] for i in fixed), *scene.body])
    scene.scene_graph.collision_filter_manager(context).Apply(
        CollisionFilterDeclaration().ExcludeWithin(welded)
    )


def _kind(instance: ClutterInstance) -> tuple[object, ...]:
    """Returns what cannot be changed any more when a diagram is built."""
    movable = instance.movable
    arrays = (instance.size, instance.p_WO, instance.yaw, instance.mass)
    shapes = tuple(instance.shape[i] for i in movable.nonzero()[0])
    return (movable.tobytes(), shapes, *(values[movable].tobytes() for values in arrays))
