from dataclasses import replace
from math import comb, isnan
from pathlib import Path

import numpy as np
import pytest
from fake_reach import make_record, make_request

from lic_drake.errors import RequestError
from lic_drake.evaluate import experiment as dut
from lic_drake.evaluate.experiment import Trial, format_rates, mcnemar, summarize_trials
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.scenario import Scenario, load_scenario

EASY = "{clutter: {num_movable: 0, num_fixed: 2}, stop: {timeout_s: 3}}"


def _fake_trial(method: str, environment: int, *outcomes: bool) -> Trial:
    (request, *_) = make_request().reaches(0)
    record = make_record(request)
    return Trial(
        method=method,
        environment=environment,
        goal=0,
        selections=(),
        records=tuple(replace(record, success=outcome) for outcome in outcomes),
    )


def _library(path: Path, scenario: Scenario) -> ExperienceLibrary:
    """A library in which every start left of the middle succeeds, and no other."""
    library = ExperienceLibrary(path)
    request = make_request(scenario=scenario, max_goals=6, max_starts=9)
    for environment in range(3):
        records = [
            replace(make_record(r), success=r.start[1] > 0.0) for r in request.reaches(environment)
        ]
        library.write_shard(f"training-{environment}", records, scenario)
    return library


def test_mcnemar_is_the_sign_test_of_the_goals_that_only_one_strategy_reached() -> None:
    a = np.array([True] * 9 + [False] * 2 + [True] * 20 + [False] * 5)
    b = np.array([False] * 9 + [True] * 2 + [True] * 20 + [False] * 5)
    exact = 2 * sum(comb(11, k) for k in range(3)) / 2**11
    assert mcnemar(a, b) == pytest.approx(exact)
    assert mcnemar(b, a) == pytest.approx(exact)
    assert mcnemar(a, a) == 1.0


def test_rates_count_successes_within_the_first_attempts() -> None:
    trials = [
        _fake_trial("rnd", 0, False, True),
        _fake_trial("rnd", 1, False, False),
        _fake_trial("gp", 0, True),
        _fake_trial("gp", 1, False, True),
    ]
    counts = {(r.method, r.attempts): r.successes for r in summarize_trials(trials, 2)}
    assert counts == {("rnd", 1): 0, ("gp", 1): 1, ("rnd", 2): 1, ("gp", 2): 2}
    p_values = {r.method: r.p_value for r in summarize_trials(trials, 1)}
    assert isnan(p_values["rnd"])
    assert p_values["gp"] == 1.0
    table = format_rates(summarize_trials(trials, 1)).splitlines()
    assert len(table) == 4
    assert table[3].startswith("| gp | 1 | 50.0 |")


def test_trials_share_goals_learn_from_the_library_and_resume(tmp_path: Path) -> None:
    scenario = load_scenario("cylinder-clutter", EASY)
    library = _library(tmp_path / "library", scenario)
    lines: list[str] = []

    def run() -> list[Trial]:
        lines.clear()
        return dut.run_trials(
            scenario, library, tmp_path / "out", ["rnd", "knn"], 2, 1, say=lines.append
        )

    first = run()
    assert [(t.method, t.environment) for t in first] == [
        ("rnd", 0),
        ("rnd", 1),
        ("knn", 0),
        ("knn", 1),
    ]
    assert [t.records[0].p_WG.tolist() for t in first[:2]] == [
        t.records[0].p_WG.tolist() for t in first[2:]
    ]
    assert all(t.records[0].stream == "evaluation" for t in first)
    assert all(t.selections[0].x0[1] > 0.0 for t in first[2:])
    assert any("4/4 reaches" in line for line in lines)

    again = run()
    # Wall times would differ if anything had been simulated again.
    assert [(t.records[0].key, t.records[0].wall_time_s) for t in again] == [
        (t.records[0].key, t.records[0].wall_time_s) for t in first
    ]
    assert not any("reaches," in line for line in lines)


def test_unknown_method_is_refused_before_any_reach(tmp_path: Path) -> None:
    scenario = load_scenario("cylinder-clutter", EASY)
    library = _library(tmp_path / "library", scenario)
    with pytest.raises(RequestError, match="unknown method 'svm'"):
        dut.run_trials(scenario, library, tmp_path / "out", ["svm"], 1, 1)
    assert not (tmp_path / "out").exists()
