import numpy as np
from support.select_surfaces import random_bumps

from lic_drake.estimate.features import PLANAR_LIC1
from lic_drake.reach.hand_poses import HandPoses
from lic_drake.reach.start import Start
from lic_drake.reach.starts import LineStarts
from lic_drake.reach.task import StartLine
from lic_drake.robots.planar import planar_arm
from lic_drake.select.objective import SuccessModel
from lic_drake.select.planar_lic import PlanarLbfgsb, PlanarLic
from lic_drake.select.situation import FailedReach, Situation


def test_a_start_that_is_barely_away_from_a_failed_one_can_be_chosen() -> None:
    # The grid's last start, y = -0.4 m, is one retry distance and a hair from the failed one.
    starts = LineStarts(poses=HandPoses(arm=planar_arm(), line=StartLine()))
    failed = FailedReach.from_start(Start(np.array([0.335, -0.3 + 1e-7, 0.0])))
    situation = Situation(p_WG=np.array([0.6, 0.1, 0.0]), starts=starts, failed=(failed,))
    peak = random_bumps(0)
    peak.centres[:] = [-0.4, -0.3]
    model = SuccessModel(estimator=peak, features=PLANAR_LIC1)
    for kind in (PlanarLic, PlanarLbfgsb):
        chosen = kind(planar_arm(), model).select(situation)
        assert chosen.start.x0[1] == starts.grid.x0[0, 1] == -0.4
