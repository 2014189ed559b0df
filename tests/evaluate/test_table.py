from math import isnan

import pytest
from support.trial_rows import make_rows

from lic_drake.evaluate.table import Table, format_rates, latex_text, summarize_trials
from lic_drake.evaluate.trials import TrialTable
from lic_drake.intervals import wilson_interval

TABLE = Table(
    caption="Rates, 90 % intervals.",
    heading=("strategy", "rate, %"),
    rows=(("RND", "61.0"), None, ("LIC_1", "-3.5..+4")),
    remarks=("One & two.", "Three."),
)


def test_markdown_has_caption_table_and_remarks() -> None:
    assert TABLE.to_markdown() == (
        "Rates, 90 % intervals.\n"
        "\n"
        "| strategy | rate, % |\n"
        "| --- | --- |\n"
        "| RND | 61.0 |\n"
        "| LIC_1 | -3.5..+4 |\n"
        "\n"
        "- One & two.\n"
        "- Three.\n"
    )
    assert TABLE._repr_markdown_() == TABLE.to_markdown()


def test_latex_is_a_plain_table() -> None:
    assert TABLE.to_latex().splitlines() == [
        r"\begin{table}",
        r"\centering",
        r"\caption{Rates, 90 \% intervals.}",
        r"\begin{tabular}{ll}",
        r"\hline",
        r"strategy & rate, \% \\",
        r"\hline",
        r"RND & 61.0 \\",
        r"\hline",
        r"LIC\_1 & $-$3.5--+4 \\",
        r"\hline",
        r"\end{tabular}",
        r"\end{table}",
        r"\begin{itemize}",
        r"\item One \& two.",
        r"\item Three.",
        r"\end{itemize}",
    ]


@pytest.mark.parametrize(
    ("text", "latex"),
    [
        ("7.06e-16", r"$7.06\times10^{-16}$"),
        ("p = 4e-05.", r"p = $4\times10^{-5}$."),
        ("t(3998) = -8.103", "t(3998) = $-$8.103"),
        ("-2.1..-0.3", "$-$2.1--$-$0.3"),
        ("LIC-1, K-NN, 3-D, 2-1", "LIC-1, K-NN, 3-D, 2-1"),
        ("$5 & #1, 3 %", r"\$5 \& \#1, 3 \%"),
        ("x_inf", r"x\_inf"),
        ("ends here.. not", "ends here.. not"),
        ("-", "-"),
    ],
)
def test_latex_text(text: str, latex: str) -> None:
    assert latex_text(text) == latex


def test_rows_must_fit_the_headings() -> None:
    with pytest.raises(ValueError, match="2 headings, but a row of 1"):
        Table(caption="", heading=("a", "b"), rows=(("c",),))


# The summary of an evaluation


TRIALS = TrialTable([*make_rows("rnd", ["01", "00"]), *make_rows("gp", ["1", "01"])])


def test_rates_count_successes_within_the_first_attempts() -> None:
    counts = {(r.method, r.attempts): r.count for r in summarize_trials(TRIALS, 2)}
    assert counts == {
        ("rnd", 1): (0, 2),
        ("gp", 1): (1, 2),
        ("rnd", 2): (1, 2),
        ("gp", 2): (2, 2),
    }


def test_every_strategy_but_rnd_is_tested_against_it_on_the_same_goals() -> None:
    p_values = {r.method: r.p_value for r in summarize_trials(TRIALS, 1)}
    assert isnan(p_values["rnd"])
    assert p_values["gp"] == 1.0
    # Ten goals that only gp reaches and one that only rnd does: the sign test's (1 + 11) / 2^10.
    rows = make_rows("rnd", ["0"] * 10 + ["1"]) + make_rows("gp", ["1"] * 10 + ["0"])
    p_values = {r.method: r.p_value for r in summarize_trials(TrialTable(rows), 1)}
    assert p_values["gp"] == 12 / 2**10
    alone = summarize_trials(TrialTable(make_rows("gp", ["1", "0"])), 1)
    assert isnan(alone[0].p_value)


def test_the_table_has_a_row_for_each_strategy_and_number_of_attempts() -> None:
    lines = format_rates(summarize_trials(TRIALS, 2)).splitlines()
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines]
    assert [row[:2] for row in rows[2:]] == [["gp", "1"], ["rnd", "1"], ["gp", "2"], ["rnd", "2"]]
    low, high = wilson_interval(1, 2)
    assert rows[2] == ["gp", "1", "50.0", f"{100 * low:.1f}..{100 * high:.1f}", "2", "1"]
    assert rows[3][-1] == ""
    assert {len(row) for row in rows} == {6}
