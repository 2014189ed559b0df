"""What the robot believes before each attempt of a trial, from what its cameras see."""

from dataclasses import dataclass, field
from functools import partial

import numpy as np

from lic_drake.perception.belief import Belief, believe, board_of
from lic_drake.perception.config import CamerasConfig
from lic_drake.perception.lookout import Lookout
from lic_drake.reach.request import ReachRecord
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.starts import Starts
from lic_drake.seeds import make_generator
from lic_drake.types import Vector


@dataclass(kw_only=True)
class Watch:
    """Looks at one environment before every attempt; what was seen is kept.

    A call, as `run_trial` makes it, returns the goal and the starts that the robot believes in.

    Attributes:
        scenario: The scenario.
        stream: Seed stream of the environment, and of the cameras' errors.
        environment: Its index.
        p_WG: Where the ball is, shape (3,), metres.
        cameras: The cameras.
        moves: Whether base and torso may move.
    """

    scenario: Scenario
    stream: str
    environment: int
    p_WG: Vector
    cameras: CamerasConfig
    moves: bool = True
    _lookout: Lookout | None = field(default=None, init=False, repr=False)
    _beliefs: dict[int, Belief] = field(default_factory=dict, init=False, repr=False)

    def __call__(self, number: int) -> tuple[Vector, Starts]:
        """Looks before an attempt, from 0; returns p_WG, shape (3,), metres, and the starts."""
        belief = self.belief(number)
        return belief.p_WG, belief.starts

    def belief(self, number: int) -> Belief:
        """Returns what the robot believes before an attempt, from 0.

        Raises:
            RenderingError: Cameras cannot be simulated on this machine.
            PerceptionError: Board or ball is not in view, or nothing looks open.
        """
        if number not in self._beliefs:
            if self._lookout is None:
                self._lookout = Lookout(
                    self.scenario.sample_instance(self.stream, self.environment),
                    self.p_WG,
                    self.cameras,
                    board_of(self.scenario)[1],
                    partial(make_generator, self.stream, "camera errors", self.environment),
                )
            look = self._lookout.look(number)
            self._beliefs[number] = believe(self.scenario, look, self.moves)
        return self._beliefs[number]

    def touches_ball(self, record: ReachRecord) -> bool:
        """Tells whether a reach that came to where it believed the goal is ended in the ball."""
        end = np.array([record.final_x, record.final_y, record.final_z])
        apart = float(np.linalg.norm(end - self.p_WG))
        return record.success and apart <= self.cameras.ball_radius_m
