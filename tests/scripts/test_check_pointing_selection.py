import sys
from pathlib import Path

import numpy as np
import pytest
from support.kinematics import only
from support.pr2_reaches import SCENARIO

from lic_drake.reach.pointing_starts import pointing_starts
from scripts.selection import pr2 as check_pointing_selection
from scripts.selection.pr2 import best_possible, sample_conditions

STARTS = pointing_starts(SCENARIO, SCENARIO.sample_instance("holdout", 0), SCENARIO.task.stand)


def test_samples_are_within_reach_and_their_poses_are_those_of_the_arm_at_their_height() -> None:
    samples = sample_conditions(STARTS, 400, np.random.default_rng(0))
    assert len(samples) > 100
    assert len(np.unique(samples.x0[:, :3], axis=0)) > 10
    for k in range(0, len(samples), 40):
        arm = SCENARIO.arm()
        x0_R = samples[k].x0_R
        q = only(arm.solve_ik(x0_R))
        assert q is not None
        np.testing.assert_allclose(arm.tip_pose(q), x0_R, atol=1e-6)


def test_the_best_sample_is_the_best_of_those_that_are_possible() -> None:
    samples = sample_conditions(STARTS, 60, np.random.default_rng(1))
    values = np.random.default_rng(2).normal(size=len(samples))
    possible = [
        STARTS.angles(samples.x0[k], samples.p_WR[k], samples.torso_m[k]) is not None
        for k in range(len(samples))
    ]
    assert best_possible(STARTS, samples, values) == values[possible].max()
    nothing = samples.take(np.zeros(0, dtype=int))
    assert best_possible(STARTS, nothing, np.zeros(0)) == -np.inf


def test_it_writes_a_table_for_each_number_of_blocked_apertures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out.md"
    arguments = "check_pointing_selection.py --situations 1 --samples 300 --estimators knn"
    monkeypatch.setattr(
        sys, "argv", [*arguments.split(), "--blocked", "15", "10", "--out", str(out)]
    )
    assert check_pointing_selection.main() == 0
    lines = out.read_text().splitlines()
    rows = [line for line in lines if line.startswith("| knn")]
    assert len(rows) == 2 * 2 * 2  # Boards, attempts, optimisers.
    assert all("| 1 of 1 | " in row for row in rows)
