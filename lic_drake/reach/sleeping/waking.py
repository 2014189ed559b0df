"""Simulations in which objects or stems sleep until the arm comes near."""

from collections.abc import Hashable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from pydrake.geometry import CollisionFilterDeclaration, GeometrySet

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.reach.diagram import make_reach_diagram
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.simulation import Cache, Simulation
from lic_drake.reach.sleeping.monitors import ObjectMonitor, SkinAxes, StemMonitor
from lic_drake.reach.trace import SceneState
from lic_drake.scene.scene import make_shape, pose_of
from lic_drake.types import Vector

FEWEST_SPARES = 2
"""Spare objects of the first diagram that has any; every further one has twice as many. Changing it
changes records in the last digits: in about 10 % of PR2 reaches the solver then sums in a different
order."""

PARKING_M = 100.0
"""Distance from the base, along x and y, at which spare objects wait, metres."""


class World(NamedTuple):
    """What is simulated, and where diagrams are kept.

    Attributes:
        scenario: Robot, contact, controller.
        instance: The clutter in R.
        height_m: How far R is above the robot's floor, metres.
        cache: The diagrams of this process.
    """

    scenario: Scenario
    instance: ClutterInstance
    height_m: float
    cache: Cache[Simulation]

    def simulation(self, key: Hashable, instance: ClutterInstance) -> Simulation:
        """Returns a simulation of an instance from the cache, built when it is missing."""

        def build() -> Simulation:
            return Simulation(make_reach_diagram(self.scenario, instance, self.height_m))

        return self.cache.get(key, build)


def make_sleeping(world: World) -> "PartlyAsleep | None":
    """Returns a simulation in which what can sleep does; None if nothing can."""
    if world.instance.stems is not None:
        return SleepingStems(world)
    return SleepingObjects(world) if can_sleep(world.instance) else None


class PartlyAsleep:
    """A simulation without what sleeps in it; satisfies `Simulated`."""

    def __init__(self, world: World, num_axes: int) -> None:
        self._world = world
        self._axes = SkinAxes(world.scenario.arm(), num_axes)

    def begin(self, q: Vector, p_RG: Vector) -> None:
        """Puts the arm at rest at q and everything where the environment has it."""
        raise NotImplementedError

    def state(self) -> SceneState:
        """Returns the state of the arm and of everything movable, asleep or awake."""
        raise NotImplementedError

    def wake_near(self, q: Vector) -> None:
        """Wakes what the arm at joint angles q may touch before the next control update.

        Raises:
            MovedTooFarError: An object may have been touched while it was asleep.
        """
        raise NotImplementedError

    def is_in_collision(self) -> bool:
        """Returns whether the arm touches anything."""
        return self._now.is_in_collision()

    def advance_to(self, time_s: float) -> None:
        """Simulates up to a time, without the control update of that instant."""
        self._now.advance_to(time_s)

    def joint_angles(self) -> Vector:
        """Returns the arm's q, shape (m,), radians."""
        return self._now.joint_angles()

    def taxel_force(self) -> Vector:
        """Returns the sensor's reading, shape (num_taxels,), N."""
        return self._now.taxel_force()

    def release(self) -> None:
        """Leaves the diagram that was used last to the cache."""
        del self._now

    def _start(self, simulation: Simulation, q: Vector, p_RG: Vector) -> None:
        self._now, self._p_RG = simulation, p_RG
        simulation.begin(q, p_RG)

    def _go_on_in(self, simulation: Simulation, q: Vector) -> None:
        """Continues in another diagram of the same arm, at the same time, with its controller."""
        before, self._now = self._now, simulation
        simulation.begin(q, self._p_RG, float(before.context.get_time()))
        mine, theirs = simulation.diagram.controller, before.diagram.controller
        state = mine.GetMyMutableContextFromRoot(simulation.context).get_mutable_discrete_state()
        state.SetFrom(theirs.GetMyContextFromRoot(before.context).get_discrete_state())


class SleepingObjects(PartlyAsleep):
    """Movable objects sleep: for one that wakes up a spare takes its place.

    When the spares do not suffice, the reach goes on in a diagram with more of them. A diagram
    serves all environments with as many fixed and the same movable objects: their fixed objects and
    the height of the torso are set in its context.
    """

    def __init__(self, world: World) -> None:
        super().__init__(world, world.instance.num_axes)
        self._num_movable = int(np.count_nonzero(world.instance.movable))
        self._asleep: dict[int, tuple[Hashable, ClutterInstance]] = {}

    def begin(self, q: Vector, p_RG: Vector) -> None:
        """Puts the arm at rest at q and every object where the environment has it."""
        self._monitor = ObjectMonitor(self._world.instance, self._axes)
        self._start(self._with_spares(0), q, p_RG)
        self.wake_near(q)

    def state(self) -> SceneState:
        """Returns the state of the arm and of all movable objects."""
        return self._state(self._monitor.awake)

    def _state(self, awake: list[int]) -> SceneState:
        now = self._now.state()
        p_WO, v_WO = self._monitor.p_WO.copy(), np.zeros_like(self._monitor.p_WO)
        if awake:
            p_WO[awake], v_WO[awake] = now.p_WO[: len(awake)], now.v_WO[: len(awake)]
        return SceneState(q=now.q, v=now.v, p_WO=p_WO, v_WO=v_WO)

    def wake_near(self, q: Vector) -> None:
        """Wakes what the arm at joint angles q may touch before the next control update."""
        before = self._monitor.awake.copy()
        if not self._monitor.look(q, self._now.object_positions()[: len(before)]):
            return
        awake, state = self._monitor.awake, self._state(before)
        if len(awake) > self._now.num_movable:
            self._go_on_in(self._with_spares(self._enough_spares(len(awake))), state.q)
        spares = self._now.state()
        p_WO, v_WO = spares.p_WO.copy(), spares.v_WO.copy()
        p_WO[: len(awake)], v_WO[: len(awake)] = state.p_WO[awake], state.v_WO[awake]
        self._now.set_state(SceneState(q=state.q, v=state.v, p_WO=p_WO, v_WO=v_WO))

    def _with_spares(self, spares: int) -> Simulation:
        if spares not in self._asleep:
            asleep = put_to_sleep(self._world.instance, spares)
            self._asleep[spares] = (self._world.scenario.digest, *_kind(asleep)), asleep
        key, instance = self._asleep[spares]
        simulation = self._world.simulation(key, instance)
        if simulation.shown is not instance:
            scene, context = simulation.diagram.scene, simulation.plant_context
            set_fixed_objects(simulation, instance)
            scene.robot.set_height(scene.plant, context, scene.arm, self._world.height_m)
            simulation.shown = instance
        return simulation

    def _enough_spares(self, awake: int) -> int:
        spares = FEWEST_SPARES
        while spares < awake:
            spares *= 2
        return min(spares, self._num_movable)


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
        self._start(self._with_awake(), q, p_RG)

    def state(self) -> SceneState:
        """Returns the state of the arm and of all stems that can bend."""
        now = self._now.state()
        shape = (np.count_nonzero(self._springy), now.p_WO.shape[1])
        angles, rates = np.zeros(shape), np.zeros(shape)
        awake = self._monitor.is_awake[self._springy]
        angles[awake], rates[awake] = now.p_WO, now.v_WO
        return SceneState(q=now.q, v=now.v, p_WO=angles, v_WO=rates)

    def wake_near(self, q: Vector) -> None:
        """Wakes what the arm at joint angles q may touch before the next control update."""
        state = self.state()
        if not self._monitor.look(q):
            return
        self._go_on_in(self._with_awake(), state.q)
        awake = self._monitor.is_awake[self._springy]
        self._now.set_state(state._replace(p_WO=state.p_WO[awake], v_WO=state.v_WO[awake]))

    def _with_awake(self) -> Simulation:
        awake = self._monitor.is_awake
        present = replace(self._world.instance, stems=self._stems.subset(awake))
        return self._world.simulation((self._token, awake.tobytes()), present)


def can_sleep(instance: ClutterInstance) -> bool:
    """Returns whether the movable objects are all alike, so that a spare fits any."""
    shapes = {s for s, movable in zip(instance.shape, instance.movable, strict=True) if movable}
    if shapes not in ({"cylinder"}, {"sphere"}):
        return False
    size, mass = instance.size[instance.movable], instance.mass[instance.movable]
    return bool(np.all(size == size[0]) and np.all(mass == mass[0]))


def put_to_sleep(instance: ClutterInstance, spares: int) -> ClutterInstance:
    """Returns the fixed objects of an instance, followed by parked movable spares.

    Args:
        instance: An environment that can sleep.
        spares: Number of objects that can be awake at a time.
    """
    fixed, first = np.flatnonzero(~instance.movable), int(np.argmax(instance.movable))
    chosen = instance.subset(np.r_[fixed, np.full(spares, first)])
    n, p_WO = len(fixed), chosen.p_WO.copy()
    p_WO[n:, : instance.num_axes] = PARKING_M + np.arange(spares)[:, np.newaxis]
    return replace(chosen, p_WO=p_WO)


def set_fixed_objects(simulation: Simulation, instance: ClutterInstance) -> None:
    """Puts the fixed objects of an instance in the places of a simulation's.

    Most of the time that building a scene takes goes into robot and skin, the same everywhere.

    Args:
        simulation: One with as many objects, of which the same ones are fixed.
        instance: The objects; its movable ones are ignored.
    """
    scene = simulation.diagram.scene
    context = scene.scene_graph.GetMyMutableContextFromRoot(simulation.context)
    source = scene.plant.get_source_id()
    assert source is not None
    fixed = [i for i in range(instance.num_objects) if not instance.movable[i]]
    for i in fixed:
        shape = make_shape(instance.shape[i], instance.size[i])
        scene.scene_graph.ChangeShape(
            context, source, scene.objects[i], shape, pose_of(instance, i)
        )
    # A geometry of another shape has forgotten that it belongs to what is welded together.
    welded = GeometrySet([*(scene.objects[i] for i in fixed), *scene.body])
    scene.scene_graph.collision_filter_manager(context).Apply(
        CollisionFilterDeclaration().ExcludeWithin(welded)
    )


def _kind(instance: ClutterInstance) -> tuple[object, ...]:
    """Returns what cannot be changed any more when a diagram is built."""
    movable = instance.movable
    return (
        movable.tobytes(),
        tuple(instance.shape[i] for i in movable.nonzero()[0]),
        *(
            values[movable].tobytes()
            for values in (instance.size, instance.p_WO, instance.yaw, instance.mass)
        ),
    )
