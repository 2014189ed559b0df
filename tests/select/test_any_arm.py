"""A robot from one file outside the package is collected for, learned from and selected for."""

from pathlib import Path

import numpy as np
from support.five_joint_arm import NAME

from lic_drake.experience.collect import CollectionRequest, collect
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.request import ReachRequest
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.session import run_reach
from lic_drake.select.lic import LicSelector
from lic_drake.select.registry import make_selector
from lic_drake.select.situation import FailedReach, Situation
from lic_drake.starts import make_starts

SCENARIO = load_scenario(
    "sphere-aperture-clutter",
    f"{{robot: {NAME}, stop: {{timeout_s: 0.2, success_distance_m: 0.2}},"
    " clutter: {num_spheres: 6, columns: 3, rows: 1},"
    " task: {torso_m: 0.8, stand: {y_min_m: -0.32, y_max_m: -0.28, torso_min_m: 0.8,"
    " torso_max_m: 0.8, training_y_m: [-0.3], training_torso_m: [0.8]}, goal_area:"
    " {lower: [0.66, -0.4, 0.8], upper: [0.66, -0.2, 0.9], step_m: 0.1}}}",
)


def test_it_is_collected_for_and_selected_for_as_any_other(tmp_path: Path) -> None:
    library = ExperienceLibrary(tmp_path / "library")
    request = CollectionRequest(scenario=SCENARIO, environments=1, max_goals=1, max_starts=3)
    assert collect(library, request).done == library.num_reaches == 3
    columns = library.columns()
    assert set(columns["robot"]) == {NAME} and 0 < columns["success"].sum() < 3

    arm = SCENARIO.arm()
    selector = make_selector("knn", columns)
    starts = make_starts(SCENARIO, SCENARIO.sample_instance("holdout", 0))
    p_WG = np.array([0.66, -0.3, 0.85])
    situation = Situation(p_WG=p_WG, starts=starts)
    chosen = selector.select(situation)
    assert isinstance(selector, LicSelector) and chosen.probability is not None
    assert chosen.probability >= selector.objective(situation).values(starts.grid).max() - 1e-8
    start = chosen.start
    assert start.q is not None and starts.checker is not None
    assert not starts.checker.touches(start.b0, start.q)
    np.testing.assert_allclose(
        arm.tip_pose(start.q) + np.pad(start.b0, (0, 4)), start.x0, atol=1e-8
    )

    record = run_reach(ReachRequest(SCENARIO, "holdout", 0, p_WG, start))
    np.testing.assert_array_equal(record.q_start, start.q)
    failed = (FailedReach.from_record(record),)
    again = selector.select(Situation(p_WG=p_WG, starts=starts, failed=failed)).start
    assert np.linalg.norm(again.x0[:3] - start.x0[:3]) > 0.1
    for method in ("rnd", "cost"):
        assert make_selector(method).select(situation).start.q is not None
