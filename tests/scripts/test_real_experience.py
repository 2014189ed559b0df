from dataclasses import replace
from pathlib import Path

import pytest
from support.fake_reach import make_record

from lic_drake.errors import LibraryError
from lic_drake.evaluate import trial
from lic_drake.evaluate.statistics import count
from lic_drake.evaluate.trial import Evaluation, random_requests
from lic_drake.evaluate.trials import TrialTable, read_trials
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.experience.workers import Workers
from lic_drake.paths import shipped_library
from lic_drake.reach.request import ReachRecord, ReachRequest
from scripts.real_experience import run as script
from scripts.real_experience.run import REAL, Learned, evaluate_learned

WRONG_SIDE_Y = 0.1


def reach(request: ReachRequest) -> ReachRecord:
    """In this reality only starts to the left succeed, which simulated passages advise against."""
    record = replace(make_record(request), final_x=0.5, final_y=0.0)
    success = record.start_y > WRONG_SIDE_Y
    return replace(record, success=success, outcome="reached" if success else "stuck")


@pytest.mark.slow
def test_records_of_weight_turn_a_selection_that_the_simulation_had_wrong(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trial, "run_reach", reach)
    monkeypatch.setattr(script, "LocalWorkers", lambda _: Workers())
    shipped = ExperienceLibrary(shipped_library("passage-clutter"))
    few = ExperienceLibrary(tmp_path / "simulated")
    few.write_shard("few", shipped.records()[:280], shipped.scenario())
    asked = Evaluation(
        experience=few.path,
        results=tmp_path,
        methods=("knn1",),
        environments=10,
        goals=1,
        attempts=1,
        overrides=REAL,
    )
    real = ExperienceLibrary(tmp_path / "records")
    requests = random_requests(asked.scenario(), "training", 120, 1)
    real.write_shard("all", list(map(reach, requests)), asked.scenario())
    points = [Learned(records=n, weight=w) for n, w in ((0, 1.0), (120, 50.0), (120, None))]
    for point in points:
        evaluate_learned(point, real, asked)
    trials = TrialTable(read_trials(asked.trials_path))
    none, weighty, alone = (count(trials.success("knn1", 1, point.variant)) for point in points)
    assert none.trials == 10 and none.successes <= 2
    assert min(weighty.successes, alone.successes) > 8
    assert len(few.columns()["key"]) == 280
    with pytest.raises(LibraryError, match="holds 120 records, not 121"):
        evaluate_learned(Learned(records=121, weight=1.0), real, asked)
