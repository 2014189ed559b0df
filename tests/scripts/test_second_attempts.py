from pathlib import Path

import numpy as np
import pytest
from support.fake_reach import make_record, make_request

from lic_drake.experience.real_pairs import pair_real_attempts
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.scenario import load_scenario
from scripts.second_attempts.collect import collect_second_attempts

WALL = (
    "{clutter: {num_movable: 0, num_fixed: 12, lower: [0.4, -0.3], upper: [0.5, 0.3]},"
    " stop: {timeout_s: 0.4}}"
)


@pytest.fixture
def experience(tmp_path: Path) -> ExperienceLibrary:
    library = ExperienceLibrary(tmp_path / "library")
    request = make_request(
        scenario=load_scenario("cylinder-clutter", WALL), max_goals=4, max_starts=9
    )
    for environment in range(2):
        records = [make_record(r) for r in request.reaches(environment)]
        library.write_shard(f"training-{environment}", records, request.scenario)
    return library


def test_every_start_follows_each_failure_and_nothing_is_simulated_twice(
    experience: ExperienceLibrary, tmp_path: Path
) -> None:
    scenario = experience.scenario()
    scenario.task.goal_area.upper = scenario.task.goal_area.lower
    experience = ExperienceLibrary(tmp_path / "one-goal")
    experience.write_shard(
        "training",
        [make_record(r) for r in make_request(scenario=scenario, max_starts=9).reaches(0)],
        scenario,
    )
    output = ExperienceLibrary(tmp_path / "attempts")
    count = collect_second_attempts(experience, output, range(5, 7), "cost", say=lambda _: None)
    records = output.records()
    firsts = [record for record in records if not record.after]
    assert len(firsts) == 2
    assert all(record.outcome == "timeout" for record in firsts)
    assert count == 2 * 21 == len(records) - len(firsts)
    pairs = pair_real_attempts(output.columns())
    assert len(pairs["key"]) == count
    assert set(pairs["environment"]) == {5, 6}
    assert np.all(np.isfinite(pairs["first_final_y"]))
    lines: list[str] = []
    collect_second_attempts(experience, output, range(5, 7), "cost", say=lines.append)
    assert not any("reaches," in line for line in lines)
