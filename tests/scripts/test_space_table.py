from dataclasses import replace

import numpy as np
from support.trial_rows import make_rows

from lic_drake.evaluate.statistics import mcnemar
from lic_drake.evaluate.trials import TrialTable
from scripts.tables.pr2 import oracle_table, space_table


def test_rates_counts_and_paired_tests_are_those_of_the_trials() -> None:
    outcomes = {
        "rnd": ["00"] * 9 + ["01"],
        "cost": ["1"] + ["00"] * 9,
        "gp": ["1"] * 7 + ["01"] * 3,
    }
    rows = [row for method, texts in outcomes.items() for row in make_rows(method, texts)]
    table = space_table(TrialTable([*rows, *make_rows("gp", ["1", "00"], variant="still")]))
    cells = {row[:3]: row[3:] for row in table.rows if row is not None}
    moves = "move along the board"
    assert cells[moves, "1st attempt", "LIC(GP)"][0] == "70.0"
    assert cells[moves, "1st attempt", "LIC(GP)"][2] == "7/10"
    assert cells[moves, "total of two", "LIC(GP)"][2] == "10/10"
    assert cells[moves, "total of two", "RND"][2] == "1/10"
    won = [True] * 10, [True] + [False] * 9
    assert cells[moves, "total of two", "LIC(GP)"][4] == f"{mcnemar(*map(_array, won)):.2g}"
    assert cells[moves, "1st attempt", "RND"][3] == ""
    assert cells["stay", "total of two", "LIC(GP)"] == ("50.0", *cells_of_half(), "1/2", "", "")


def cells_of_half() -> tuple[str]:
    """Wilson's 90 % interval of 1 in 2, from its closed form."""
    z2 = 1.6448536269514722**2
    centre = 0.5
    half = (z2**0.5 / (2 + z2)) * (2 * 0.25 + z2 / 4) ** 0.5
    return (f"{100 * (centre - half):.1f}..{100 * (centre + half):.1f}",)


def _array(values: list[bool]) -> np.ndarray:
    return np.array(values)


def test_the_oracle_is_right_where_any_aperture_leads_to_the_goal() -> None:
    rows = [*make_rows("rnd", ["00", "1", "1"]), *make_rows("gp", ["01", "00", "1"])]
    trials = TrialTable([replace(row, variant="still") for row in rows])
    columns = {
        "environment": np.array([0, 0, 1, 1]),
        "success": np.array([False, True, False, False]),
    }
    cells = {row[:2]: row[2:] for row in oracle_table(trials, columns).rows if row is not None}
    assert cells["", "oracle: any open aperture"][2] == "1/2"
    assert cells["1st attempt", "LIC(GP)"][2] == "0/2"
    assert cells["total of two", "LIC(GP)"][2] == "1/2"
    assert cells["total of two", "any of the strategies"][2] == "2/2"
