from pathlib import Path

import numpy as np
import pytest
from support.trial_rows import fill_records, make_rows

from lic_drake.errors import LibraryError
from lic_drake.evaluate.paper import TABLES
from lic_drake.evaluate.trials import read_trials, write_trials
from lic_drake.reach.scenario import load_scenario
from scripts.tables.figures import FIGURES, attempts_figure, calibration_figure, goals_figure


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fill_records(tmp_path_factory.mktemp("records") / "results")


def small_records(results: Path, category: str) -> Path:
    rows = make_rows("rnd", ["1", "001", "000", "01"], goals=2)
    rows += make_rows("gp", ["1", "01", "00", "1"], goals=2)
    write_trials(results / category / "trials.parquet", rows)
    return results


@pytest.mark.parametrize("name", FIGURES)
def test_every_figure_is_drawn_from_the_records(records: Path, name: str) -> None:
    figure = FIGURES[name](records)
    for ax in figure.axes:
        assert ax.has_data()


@pytest.mark.parametrize("name", FIGURES)
def test_a_missing_record_comes_with_its_command(tmp_path: Path, name: str) -> None:
    with pytest.raises(LibraryError, match=r"no .* with: (lic evaluate|python scripts/)"):
        FIGURES[name](tmp_path)


def test_every_category_has_its_figures() -> None:
    for category in TABLES:
        assert {f"{kind}_{category}" for kind in ("success", "attempts", "calibration")} <= set(
            FIGURES
        )


def test_the_attempts_figure_goes_as_far_as_each_strategys_trials(tmp_path: Path) -> None:
    (ax,) = attempts_figure(small_records(tmp_path, "passage-clutter"), "passage-clutter").axes
    rnd, gp = (container.lines[0].get_xydata() for container in ax.containers)
    np.testing.assert_allclose(rnd, [[1, 25], [2, 50], [3, 75]])
    np.testing.assert_allclose(gp, [[1, 50], [2, 75]])


def test_the_attempts_figure_takes_the_trials_that_go_on_where_there_are_some(
    tmp_path: Path,
) -> None:
    results = small_records(tmp_path, "passage-clutter")
    path = results / "passage-clutter" / "trials.parquet"
    longer = make_rows("rnd", ["00001", "1"], variant="five-attempts")
    write_trials(path, [*read_trials(path), *longer, *make_rows("gp>rnd", ["1"])])
    (ax,) = attempts_figure(results, "passage-clutter").axes
    (rnd,) = (container.lines[0].get_xydata() for container in ax.containers)
    np.testing.assert_allclose(rnd, [[1, 50], [2, 50], [3, 50], [4, 50], [5, 100]])


def test_calibration_takes_attempts_apart_and_leaves_out_what_does_not_estimate(
    tmp_path: Path,
) -> None:
    figure = calibration_figure(small_records(tmp_path, "passage-clutter"), "passage-clutter")
    first, second = figure.axes
    assert [t.get_text() for t in first.get_legend().get_texts()] == ["LIC(GP), n = 4"]
    assert [t.get_text() for t in second.get_legend().get_texts()] == ["LIC(GP), n = 2"]


def test_the_goals_are_those_of_the_evaluation(tmp_path: Path) -> None:
    category = "cylinder-clutter"
    figure = goals_figure(small_records(tmp_path, category), category)
    scenario = load_scenario(category)
    goals = [scenario.sample_goal("evaluation", e, g) for e in (0, 1) for g in (0, 1)]
    panels = [ax for ax in figure.axes if ax.texts]
    assert [ax.get_title() for ax in panels] == ["RND", "LIC(GP)"]
    cells = {tuple(np.floor(10 * np.array(text.get_position()))) for text in panels[0].texts}
    assert cells == {tuple(np.floor(10 * goal[:2])) for goal in goals}


def test_damaged_calibration_curves_are_refused(tmp_path: Path) -> None:
    (tmp_path / "cross_validation").mkdir()
    path = tmp_path / "cross_validation" / "calibration_curves.csv"
    path.write_text("estimator,low\ngp,0.1\n")
    with pytest.raises(LibraryError, match="has no calibration curves"):
        FIGURES["calibration_held_out"](tmp_path)
