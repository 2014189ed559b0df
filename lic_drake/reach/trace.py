"""What happened during a reach, sample by sample, and the figures that a record keeps of it."""

from collections import Counter
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from lic_drake.types import IntVector, Vector

VELOCITY_WINDOW_S = 1.0
"""Time over which the velocity at the end of a reach is averaged, seconds."""


class SceneState(NamedTuple):
    """Where everything is at one instant, and how fast it moves.

    Attributes:
        q: Joint angles, shape (m,), radians.
        v: Joint velocities, shape (m,), rad/s.
        q_clutter: Positions p_WO of the movable objects, shape (n, 2) in the plane and (n, 3) in
            space, metres; of stems the angles by which they are bent, shape (n, 2), radians.
        v_clutter: Their velocities, of the same shape, m/s or rad/s.
    """

    q: Vector
    v: Vector
    q_clutter: Vector
    v_clutter: Vector


@dataclass(kw_only=True)
class ReachTrace:
    """Samples at the control rate, from the start to the end of a reach.

    Attributes:
        q: Joint angles, each shape (m,), radians.
        p_WE: Tip positions, each shape (3,), metres.
        peak_force: Largest taxel force of each sample, N; total_force their sum.
        contacts: Number of loaded taxels.
        loaded: Their indices and forces, N.
        states: The state of the scene at each sample, if it was asked for.
        b0: Position of R, shape (3,), metres.
        q_clutter: As in `SceneState`, at the end; None where there is none or it is not finite.
        statistics: How often the integrator did what, see `lic_drake.reach.rig.Stepper`.
    """

    time_s: list[float] = field(default_factory=list)
    q: list[Vector] = field(default_factory=list)
    p_WE: list[Vector] = field(default_factory=list)
    peak_force: list[float] = field(default_factory=list)
    total_force: list[float] = field(default_factory=list)
    contacts: list[int] = field(default_factory=list)
    loaded: list[tuple[IntVector, Vector]] = field(default_factory=list)
    states: list[SceneState] = field(default_factory=list)
    b0: Vector = field(default_factory=lambda: np.zeros(3))
    q_clutter: Vector | None = None
    statistics: Counter[str] = field(default_factory=Counter)

    def append(self, time_s: float, q: Vector, p_WE: Vector, taxel_force: Vector) -> None:
        """Adds a sample; `taxel_force` has shape (num_taxels,), N."""
        self.time_s.append(time_s)
        self.q.append(q)
        self.p_WE.append(p_WE)
        self.peak_force.append(float(taxel_force.max()))
        self.total_force.append(float(taxel_force.sum()))
        loaded = np.flatnonzero(taxel_force)
        self.contacts.append(len(loaded))
        self.loaded.append((loaded, taxel_force[loaded]))

    def translate(self, offset: Vector, clutter_too: bool) -> None:
        """Moves all positions by an offset, shape (3,), metres; stems' angles are none."""
        self.p_WE = [p_WE + offset for p_WE in self.p_WE]
        self.b0 = self.b0 + offset
        if not clutter_too:
            return
        self.states = [
            s._replace(q_clutter=s.q_clutter + offset[: s.q_clutter.shape[1]]) for s in self.states
        ]
        if self.q_clutter is not None:
            self.q_clutter = self.q_clutter + offset[: self.q_clutter.shape[1]]

    @property
    def mean_force(self) -> float:
        """Mean force of a loaded taxel over all samples, N; 0 without contact."""
        loaded = sum(self.contacts)
        return sum(self.total_force) / loaded if loaded else 0.0

    def final_velocity(self, still_s: float) -> Vector:
        """Returns the mean tip velocity in the last second of motion, shape (3,), m/s.

        Before it the tip stood still for `still_s`: the stuck rule's time for a reach that got
        stuck, where the paper's final velocity would otherwise always be nearly zero, else 0.
        """
        times = np.array(self.time_s)
        end = max(times[-1] - still_s, times[0])
        last = int(np.searchsorted(times, end + 1e-9) - 1)
        first = int(np.searchsorted(times, end - VELOCITY_WINDOW_S - 1e-9))
        span = times[last] - times[first]
        if span <= 0.0:
            return np.zeros(3)
        return (self.p_WE[last] - self.p_WE[first]) / span


class ReachResult(NamedTuple):
    """How a simulated reach ended: `lic_drake.reach.request.OUTCOMES`, samples and a remark."""

    outcome: str
    trace: ReachTrace
    detail: str = ""
