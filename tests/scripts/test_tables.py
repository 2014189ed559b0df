from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.trial_rows import fill_records, make_rows

from lic_drake.errors import LibraryError
from lic_drake.evaluate.statistics import mcnemar
from lic_drake.evaluate.trials import TrialTable, write_trials
from lic_drake.reach.scenario import load_scenario
from scripts.common import load_trials, write_tables
from scripts.second_attempts.table import second_attempts_table
from scripts.tables.figures import goals_figure
from scripts.tables.run import (
    arms_table,
    foliage_table,
    oracle_table,
    paper_tables,
    pr2_table,
)


class Columns:
    """A library that holds the outcomes of these reaches."""

    def columns(self) -> dict[str, np.ndarray]:
        success = np.array([False, True, False, False])
        return {"environment": np.array([0, 0, 1, 1]), "success": success}


def test_the_tables_of_the_paper_are_written(tmp_path: Path) -> None:
    records = fill_records(tmp_path / "results")
    tables = paper_tables(records)
    assert {name: len(parts) for name, parts in tables.items()} == {
        "table_1": 2,
        "table_2": 1,
        "table_3": 2,
        "table_4": 2,
    }
    paths = write_tables(records, "table_1", tables["table_1"])
    assert [path.name for path in paths] == ["table_1.md", "table_1.tex"]
    markdown, latex = (path.read_text() for path in paths)
    assert "| 1st attempt | LIC(GP) | 77.80 (1556/2000) |" in markdown
    assert latex.count(r"\begin{tabular}") == latex.count(r"\end{tabular}") == 2


def test_missing_trials_are_one_clear_error(tmp_path: Path) -> None:
    with pytest.raises(LibraryError, match=r"no trials at .*; make them with lic evaluate"):
        load_trials(tmp_path, "passage-clutter")


def test_rates_counts_and_paired_tests_of_the_pr2_are_those_of_the_trials() -> None:
    outcomes = {
        "rnd": ["00"] * 9 + ["01"],
        "cost": ["1"] + ["00"] * 9,
        "gp": ["1"] * 7 + ["01"] * 3,
    }
    rows = [row for method, texts in outcomes.items() for row in make_rows(method, texts)]
    still = make_rows("gp", ["1", "00"], variant="still")
    table = pr2_table(TrialTable([*rows, *still]), np.arange(10) < 8)
    cells = {row[:3]: row[3:] for row in table.rows if row is not None}
    moves = "move along the board"
    assert cells[moves, "1st attempt", "LIC(GP)"][::2] == ("70.0", "7/10", "0.031")
    assert cells[moves, "total of two", "RND"][2:4] == ("1/10", "")
    p = mcnemar(np.ones(10, dtype=bool), np.arange(10) == 0)
    assert cells[moves, "total of two", "LIC(GP)"][4] == f"{p:.2g}"
    assert cells["stay", "total of two", "LIC(GP)"][2:] == ("1/2", "", "")
    assert cells[moves, "", "any start known to reach"][2:] == ("8/10", "", "")


def test_arms_stand_below_each_other_each_with_its_own_baselines() -> None:
    better = [*make_rows("cost", ["1", "00"] * 5), *make_rows("gp", ["01"] * 10)]
    arms = {"one": TrialTable(better), "other": TrialTable(make_rows("gp", ["1", "00", "00"]))}
    known = {"one": np.ones(10, dtype=bool), "other": np.arange(3) < 2}
    cells = {row[:3]: row[3:] for row in arms_table(arms, known).rows if row is not None}
    assert cells["other", "", "any start known to reach"][2] == "2/3"
    assert cells["one", "1st attempt", "LIC(GP)"][2] == "0/10"
    p = mcnemar(np.ones(10, dtype=bool), np.arange(10) % 2 == 0)
    assert cells["one", "total of two", "LIC(GP)"][2:] == ("10/10", "", f"{p:.2g}")
    assert cells["other", "total of two", "LIC(GP)"][2:] == ("1/3", "", "")


def test_the_oracle_is_right_where_any_aperture_leads_to_the_goal() -> None:
    rows = [*make_rows("rnd", ["00", "1", "1"]), *make_rows("gp", ["01", "00", "1"])]
    trials = TrialTable([replace(row, variant="still") for row in rows])
    cells = {row[:2]: row[4] for row in oracle_table(trials, Columns()).rows}
    assert cells["", "oracle: any open aperture"] == "1/2"
    assert cells["1st attempt", "LIC(GP)"] == "0/2"
    assert cells["total of two", "any of the strategies"] == "2/2"


def test_what_was_learned_among_foliage_stands_beside_spheres_and_baselines() -> None:
    rows = [
        *make_rows("rnd", ["00"] * 9 + ["01"], variant="cameras"),
        *make_rows("gp", ["1"] * 6 + ["01"] + ["00"] * 3, variant="cameras"),
        *make_rows("gp", ["1"] * 8 + ["00"] * 2, variant="cameras-foliage"),
        *make_rows("cost", ["1"] + ["00"] * 9, variant="known"),
    ]
    table = foliage_table(TrialTable(rows), np.arange(10) < 9)
    cells = {row[:3]: row[3:] for row in table.rows if row is not None}
    assert cells["known", "", "any start known to reach"][2] == "9/10"
    seen = "seen by cameras"
    assert cells[seen, "total of two", "LIC(GP), spheres"][2] == "7/10"
    # Against RND of the same condition, though its variant is another one.
    p = mcnemar(np.arange(10) < 8, np.arange(10) == 9)
    assert cells[seen, "total of two", "LIC(GP), foliage"][3:] == (f"{p:.2g}", "")
    assert cells["known", "1st attempt", "COST"][2:] == ("1/10", "", "")


def test_second_choices_are_counted_on_the_failures_of_lic_1() -> None:
    trials = TrialTable(
        [
            *make_rows("gp", ["1", "01", "01", "01", "00", "00"]),
            *make_rows("gp>cost", ["1", "00", "00", "01", "01", "00"]),
        ]
    )
    rows = second_attempts_table(trials, "cylinder-clutter", "gp").rows
    assert [row[0] for row in rows] == ["LIC-2", "COST away from the first"]
    assert [row[3] for row in rows] == ["3/5", "2/5"]
    won = [trials.success(m, 2)[1:] for m in ("gp>cost", "gp")]
    assert float(rows[1][4]) == pytest.approx(mcnemar(*won), rel=0.05)


def test_where_there_is_no_lic_2_others_are_compared_with_lic_1() -> None:
    rows = [*make_rows("gp", ["01", "00", "00"]), *make_rows("imagine", ["01", "01", "00"])]
    table = second_attempts_table(TrialTable(rows), "sphere-aperture-clutter", "gp")
    assert [row[0] for row in table.rows] == [
        "LIC-1's best away from the first",
        "best in imagined environments",
    ]
    assert [row[3] for row in table.rows] == ["1/3", "2/3"] and "LIC-1" in table.heading[-1]


def small_records(results: Path, category: str) -> Path:
    rows = make_rows("rnd", ["1", "001", "000", "01"], goals=2)
    rows += make_rows("gp", ["1", "01", "00", "1"], goals=2)
    write_trials(results / category / "trials.parquet", rows)
    return results


def test_the_goals_of_the_map_are_those_of_the_evaluation(tmp_path: Path) -> None:
    category = "cylinder-clutter"
    figure = goals_figure(small_records(tmp_path, category), category)
    scenario = load_scenario(category)
    goals = [scenario.sample_goal("evaluation", e, g) for e in (0, 1) for g in (0, 1)]
    panels = [ax for ax in figure.axes if ax.texts]
    assert [ax.get_title() for ax in panels] == ["RND", "LIC(GP)"]
    cells = {tuple(np.floor(10 * np.array(text.get_position()))) for text in panels[0].texts}
    assert cells == {tuple(np.floor(10 * goal[:2])) for goal in goals}
