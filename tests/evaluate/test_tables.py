import re

import pytest
from support.trial_rows import make_rows, paper_rows

from lic_drake.evaluate.paper import TABLES, PaperTable
from lic_drake.evaluate.table import Table
from lic_drake.evaluate.tables import margins_table, success_table, t_test_table
from lic_drake.evaluate.trials import TrialTable

TABLE_I, TABLE_III, TABLE_IV = TABLES.values()
SMALL = TrialTable(
    make_rows("rnd", ["1", "01", "00", "00", "00", "00", "00", "00"])
    + make_rows("cost", ["00", "1", "1", "00", "00", "00", "00", "00"])
    + make_rows("gp", ["1", "1", "1", "1", "1", "01", "00", "00"])
)


def cells(table: Table) -> dict[tuple[str, str], dict[str, str]]:
    """Cells by the first two columns and the heading."""
    rows = [row for row in table.rows if row is not None]
    return {row[:2]: dict(zip(table.heading, row, strict=True)) for row in rows}


@pytest.mark.parametrize("paper", TABLES.values(), ids=lambda paper: paper.number)
def test_the_papers_own_counts_give_its_tables(paper: PaperTable) -> None:
    table = success_table(TrialTable(paper_rows(paper, goals=10)), paper)
    rows = [row for row in table.rows if row is not None]
    assert len(rows) == 3 * len(paper.columns)
    for row in rows:
        if row[:2] == ("total", "LIC(K-NN)") and paper is TABLE_III:
            # Its sum is wrong in the paper.
            assert (row[2], row[4]) == ("80.45 (1609/2000)", "81.35 (1627/2000)")
        else:
            assert row[2:4] == row[4:6]


def test_rates_come_with_counts_and_wilson_intervals_in_the_papers_order() -> None:
    table = success_table(TrialTable(paper_rows(TABLE_I, goals=10)), TABLE_I)
    found = cells(table)
    assert [key for key in found if key[0] == "1st attempt"] == [
        ("1st attempt", name) for name in ("RND", "COST", "LIC(GP)", "LIC(K-NN)")
    ]
    first = found["1st attempt", "RND"]
    assert first["ours, %"] == "61.00 (1220/2000)"
    # The half width that the paper's Fig. 8 shows is 1.8 points.
    assert first["90 % interval"] == "59.2..62.8"
    assert found["2nd attempt", "LIC(GP)"]["ours, %"] == "29.95 (133/444)"
    assert found["total", "LIC(GP)"]["ours, %"] == "84.45 (1689/2000)"
    assert "ours on 2000 goals" in table.caption
    assert "200 random environments" in table.caption


def test_strategies_are_paired_with_those_to_their_left() -> None:
    found = cells(success_table(SMALL, TABLE_I))
    expected = {
        ("1st attempt", "RND"): ("", ""),
        ("1st attempt", "COST"): ("1", ""),
        # Four goals against none; four against one.
        ("1st attempt", "LIC(GP)"): ("0.12", "0.25"),
        ("2nd attempt", "COST"): ("", ""),
        ("2nd attempt", "LIC(GP)"): ("", ""),
        ("total", "COST"): ("1", ""),
        ("total", "LIC(GP)"): ("0.12", "0.12"),
    }
    for key, ps in expected.items():
        assert (found[key]["p against RND"], found[key]["p against COST"]) == ps


def test_what_the_paper_did_not_try_is_a_dash() -> None:
    found = cells(success_table(SMALL, TABLE_IV))
    assert found["total", "LIC(GP)"]["paper, %"] == "-"
    assert found["total", "RND"]["paper, %"] == "29.70 (297/1000)"


def test_table_ii_of_the_papers_counts_is_the_papers() -> None:
    table = t_test_table(TrialTable(paper_rows(TABLE_I, goals=10)))
    assert len(table.rows) == 5
    for row in table.rows:
        assert row is not None
        _, t_ours, p_ours, t_paper, p_paper, p_paired = row
        assert t_ours == t_paper
        assert float(p_ours) == pytest.approx(float(p_paper), rel=0.01)
        # In these made-up trials the better strategy succeeds wherever the other one does.
        assert float(p_paired) < float(p_ours)
    assert table.rows[0][:2] == ("RND, LIC(GP)", "t(3998) = -8.103")
    assert table.rows[0][2] == "7.059e-16"


def test_margins_of_the_papers_counts_are_the_papers() -> None:
    found = cells(margins_table(TrialTable(paper_rows(TABLE_I, goals=10)), TABLE_I))
    assert len(found) == 8
    for row in found.values():
        assert row["ours"] == row["paper"]
        low, high = map(float, re.findall(r"[+-][\d.]*\d", row["90 % interval"]))
        assert low < float(row["ours"]) < high
    assert found["1st attempt", "LIC(GP) - RND"]["paper"] == "+16.80"
    assert found["total", "LIC(GP) - COST"]["paper"] == "+6.30"
