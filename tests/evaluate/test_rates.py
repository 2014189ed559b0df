from math import isnan

from support.trial_rows import make_rows

from lic_drake.evaluate.rates import format_rates, summarize_trials
from lic_drake.evaluate.trials import TrialTable
from lic_drake.intervals import wilson_interval

TABLE = TrialTable([*make_rows("rnd", ["01", "00"]), *make_rows("gp", ["1", "01"])])


def test_rates_count_successes_within_the_first_attempts() -> None:
    counts = {(r.method, r.attempts): r.count for r in summarize_trials(TABLE, 2)}
    assert counts == {
        ("rnd", 1): (0, 2),
        ("gp", 1): (1, 2),
        ("rnd", 2): (1, 2),
        ("gp", 2): (2, 2),
    }


def test_every_strategy_but_rnd_is_tested_against_it_on_the_same_goals() -> None:
    p_values = {r.method: r.p_value for r in summarize_trials(TABLE, 1)}
    assert isnan(p_values["rnd"])
    assert p_values["gp"] == 1.0
    # Ten goals that only gp reaches and one that only rnd does: the sign test's (1 + 11) / 2^10.
    rows = make_rows("rnd", ["0"] * 10 + ["1"]) + make_rows("gp", ["1"] * 10 + ["0"])
    p_values = {r.method: r.p_value for r in summarize_trials(TrialTable(rows), 1)}
    assert p_values["gp"] == 12 / 2**10
    alone = summarize_trials(TrialTable(make_rows("gp", ["1", "0"])), 1)
    assert isnan(alone[0].p_value)


def test_the_table_has_a_row_for_each_strategy_and_number_of_attempts() -> None:
    lines = format_rates(summarize_trials(TABLE, 2)).splitlines()
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines]
    assert [row[:2] for row in rows[2:]] == [["gp", "1"], ["rnd", "1"], ["gp", "2"], ["rnd", "2"]]
    low, high = wilson_interval(1, 2)
    assert rows[2] == ["gp", "1", "50.0", f"{100 * low:.1f}..{100 * high:.1f}", "2", "1"]
    assert rows[3][-1] == ""
    assert {len(row) for row in rows} == {6}
