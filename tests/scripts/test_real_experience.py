from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure
from support.fake_reach import make_record

from lic_drake.errors import LibraryError
from lic_drake.evaluate import experiment
from lic_drake.evaluate.batch import random_requests
from lic_drake.evaluate.experiment import Evaluation
from lic_drake.evaluate.statistics import Count
from lic_drake.evaluate.trials import TrialTable, read_trials
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.reach.request import ReachRecord, ReachRequest
from scripts.real_experience.learned import (
    Learned,
    draw_success_by_records,
    evaluate_learned,
    real_experience_table,
    success_by_records,
)

REAL = "{clutter: {min_slope_deg: -10.0, max_slope_deg: 10.0}}"
WRONG_SIDE_Y = 0.1
SIMULATION = Learned(records=0, weight=1.0)


class HereExecutor:
    """Does in this process, at once, what it is given."""

    def __init__(self, *_: Any, initializer: Callable[..., None], initargs: Any, **__: Any) -> None:
        initializer(*initargs)

    def submit(self, function: Callable[..., Any], *args: Any) -> "Future[Any]":
        future: Future[Any] = Future()
        future.set_result(function(*args))
        return future

    def shutdown(self, cancel_futures: bool) -> None:
        pass


def reach(request: ReachRequest) -> ReachRecord:
    """In this reality only starts to the left succeed, which simulated passages advise against."""
    record = replace(make_record(request), final_x=0.5, final_y=0.0)
    success = request.start.x0[1] > WRONG_SIDE_Y
    return replace(record, success=success, outcome="reached" if success else "stuck")


@pytest.fixture
def asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Evaluation:
    monkeypatch.setattr(experiment, "run_reach", reach)
    monkeypatch.setattr(experiment, "ProcessPoolExecutor", HereExecutor)
    monkeypatch.setattr(experiment, "prepare_worker", lambda: None)
    shipped = ExperienceLibrary(shipped_library("passage-clutter"))
    few = ExperienceLibrary(tmp_path / "simulated")
    few.write_shard("few", shipped.records()[:280], shipped.scenario())
    return Evaluation(
        experience=few.path,
        results=tmp_path,
        methods=("knn1",),
        environments=10,
        goals=1,
        attempts=1,
        overrides=REAL,
    )


@pytest.fixture
def real(asked: Evaluation) -> ExperienceLibrary:
    library = ExperienceLibrary(asked.results / "records")
    requests = random_requests(asked.scenario(), "training", 120, 1)
    library.write_shard("all", list(map(reach, requests)), asked.scenario())
    return library


@pytest.mark.slow
def test_records_of_weight_turn_a_selection_that_the_simulation_had_wrong(
    asked: Evaluation, real: ExperienceLibrary
) -> None:
    simulated = ExperienceLibrary(asked.experience)
    points = [SIMULATION, Learned(records=120, weight=50.0), Learned(records=120, weight=None)]
    for point in points:
        evaluate_learned(point, simulated, real, asked, say=lambda _: None)
    counts = success_by_records(TrialTable(read_trials(asked.trials_path)), "knn1", points)
    assert [counts[point].trials for point in points] == [10, 10, 10]
    assert counts[points[0]].successes <= 2
    assert counts[points[1]].successes > 8
    assert counts[points[2]].successes > 8
    assert len(simulated.columns()["key"]) == 280
    assert not (simulated.path / "_added").exists()
    with pytest.raises(LibraryError, match="holds 120 records, not 121"):
        evaluate_learned(Learned(records=121, weight=1.0), simulated, real, asked)


COUNTS = {
    SIMULATION: Count(20, 100),
    Learned(records=100, weight=1.0): Count(30, 100),
    Learned(records=100, weight=8.0): Count(35, 100),
    Learned(records=100, weight=None): Count(25, 100),
}


def test_the_table_names_every_point_with_interval_and_count() -> None:
    table = real_experience_table(COUNTS, Count(22, 200), "A caption.")
    assert [row[:3] for row in table.rows if row] == [
        ("0", "1", "20.0"),
        ("100", "1", "30.0"),
        ("100", "8", "35.0"),
        ("100", "no simulation", "25.0"),
        ("random starts", "", "11.0"),
    ]
    low, high = Count(35, 100).interval()
    assert table.rows[2][3:] == (f"{100 * low:.1f}..{100 * high:.1f}", "35/100")


def test_the_figure_has_a_line_for_each_weight_that_begins_at_the_simulation() -> None:
    ax = draw_success_by_records(Figure().subplots(), COUNTS, Count(22, 200))
    lines = {container.get_label(): container.lines[0] for container in ax.containers}
    assert lines["simulation and records of weight 1"].get_ydata().tolist() == [20.0, 30.0]
    assert lines["simulation and records of weight 8"].get_ydata().tolist() == [20.0, 35.0]
    assert lines["real records only"].get_ydata().tolist() == [25.0]
