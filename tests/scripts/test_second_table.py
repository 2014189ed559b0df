import pytest
from support.trial_rows import make_rows

from lic_drake.evaluate.statistics import mcnemar
from lic_drake.evaluate.trials import TrialTable
from scripts.second_attempts.table import second_attempts_table

LIC2 = ["1", "01", "01", "01", "00", "00"]
COST = ["1", "00", "00", "01", "01", "00"]
FRESH = ["1", "01", "01", "01", "01", "00"]


def test_all_choices_are_counted_on_the_failures_of_lic_1() -> None:
    trials = TrialTable(
        [
            *make_rows("gp", LIC2),
            *make_rows("gp>cost", COST),
            *make_rows("gp", FRESH, variant="fresh"),
        ]
    )
    rows = second_attempts_table(trials, "cylinder-clutter", "gp").rows
    assert [row[0] for row in rows] == ["LIC-2", "COST away from the first", "LIC-2"]
    assert [row[4] for row in rows] == ["3/5", "2/5", "4/5"]
    assert [row[2] for row in rows] == ["60.0", "40.0", "80.0"]
    failed = slice(1, None)
    won = [trials.success(m, 2)[failed] for m in ("gp>cost", "gp")]
    assert float(rows[1][5]) == pytest.approx(mcnemar(*won), rel=0.05)
    assert rows[0][5] == ""
