"""Which goals any start reached, and which starts are tried at the others."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.fake_reach import make_record

from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.request import ReachRequest
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.start import Start, Starts
from lic_drake.select.lic import LicSelector
from lic_drake.select.situation import Situation
from lic_drake.starts import make_starts
from scripts.bounds.race import APART_M, preferred_starts, reached

CATEGORY = "sphere-aperture-clutter"
SCENARIO = load_scenario(CATEGORY)


def test_a_goal_counts_if_any_start_reaches_it_in_the_untouched_environment(tmp_path: Path) -> None:
    def record(environment: int, goal: int, success: bool, first: Start | None = None) -> object:
        p_WG = SCENARIO.sample_goal("evaluation", environment, goal)
        start = make_starts(SCENARIO, SCENARIO.sample_instance("evaluation", 0)).grid[0]
        request = ReachRequest(SCENARIO, "evaluation", environment, p_WG, start)
        if first is not None:
            request = request.then(first)
        return replace(make_record(request), success=success)

    other = make_starts(SCENARIO, SCENARIO.sample_instance("evaluation", 0)).grid[1]
    evaluated = [
        record(0, 0, success=True),
        record(1, 0, success=False),
        record(2, 1, success=True),  # Another goal.
        record(3, 0, success=True, first=other),  # A second attempt.
        record(9, 0, success=True),
    ]
    library = ExperienceLibrary(tmp_path / CATEGORY / "reaches")
    library.write_shard("some", evaluated, SCENARIO)
    assert reached(tmp_path, CATEGORY, 5).tolist() == [True, False, False, False, False]
    raced = ExperienceLibrary(tmp_path / "bounds" / CATEGORY / "race")
    raced.write_shard("some", [record(1, 0, success=True)], SCENARIO)
    assert reached(tmp_path, CATEGORY, 5).tolist() == [True, True, False, False, False]


def test_preferred_starts_are_apart_and_come_in_the_order_of_their_estimates() -> None:
    starts = make_starts(SCENARIO, SCENARIO.sample_instance("evaluation", 0))
    situation = Situation(p_WG=SCENARIO.sample_goal("evaluation", 0, 0), starts=starts)

    class Middle:
        """Likes the middle of the board."""

        failed = ()

        def values(self, conditions: Starts) -> np.ndarray:
            return -np.abs(conditions.x0[:, 1] + 0.29)

    class Selector(LicSelector):
        def objective(self, situation: Situation) -> Middle:
            return Middle()

    found = preferred_starts(Selector(None), situation, 12)
    place = np.column_stack([found.b0[:, 1:], found.x0[:, 1:3]])
    apart = np.linalg.norm(place[:, None] - place, axis=2) + np.eye(12)
    assert apart.min() >= APART_M - 1e-9
    values = Middle().values(found)
    assert np.all(np.diff(values) <= 1e-12)
    assert values[0] == pytest.approx(Middle().values(starts.grid).max())
