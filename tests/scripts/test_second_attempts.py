from pathlib import Path

import numpy as np
import pytest
from support.fake_reach import make_record, make_request

from lic_drake.experience.pairs import pair_second_attempts
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.experience.workers import Workers
from lic_drake.reach.scenario import load_scenario
from lic_drake.starts import make_starts
from scripts.second_attempts.run import collect

WALL = (
    "{clutter: {num_movable: 0, num_fixed: 12, lower: [0.4, -0.3], upper: [0.5, 0.3]},"
    " stop: {timeout_s: 0.1}, task: {start_line: {phi_step_deg: 60.0}}}"
)


def test_every_start_follows_each_failure_and_nothing_is_simulated_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("scripts.common.LocalWorkers", lambda count: Workers())
    scenario = load_scenario("cylinder-clutter", WALL)
    scenario.task.goal_area.upper = scenario.task.goal_area.lower
    experience = ExperienceLibrary(tmp_path / "one-goal")
    requests = [r for e in (0, 1) for r in make_request(scenario=scenario).reaches(e)]
    experience.write_shard("training", [make_record(r) for r in requests], scenario)
    output = ExperienceLibrary(tmp_path / "attempts")
    count = collect(experience, output.path, range(5, 7))
    records = output.records()
    firsts = [record for record in records if not record.after]
    assert len(firsts) == 2
    assert all(record.outcome == "timeout" for record in firsts)
    starts = make_starts(scenario, scenario.sample_instance("training", 5)).grid
    assert count == 2 * len(starts) == len(records) - len(firsts)
    pairs = pair_second_attempts(output.columns())
    assert set(pairs["environment"]) == {5, 6}
    assert np.all(np.isfinite(pairs["first_final_y"]))
    before = [record.wall_time_s for record in output.records()]
    assert collect(experience, output.path, range(5, 7)) == count
    assert [record.wall_time_s for record in output.records()] == before
