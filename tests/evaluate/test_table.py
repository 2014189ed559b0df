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
    assert TABLE.to_markdown().splitlines() == [
        "Rates, 90 % intervals.",
        "",
        "| strategy | rate, % |",
        "| --- | --- |",
        "| RND | 61.0 |",
        "| LIC_1 | -3.5..+4 |",
        "",
        "- One & two.",
        "- Three.",
    ]


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
    ],
)
def test_latex_text(text: str, latex: str) -> None:
    assert latex_text(text) == latex


TRIALS = TrialTable([*make_rows("rnd", ["01", "00"]), *make_rows("gp", ["1", "01"])])


def test_rates_are_of_the_first_attempts_and_tested_against_rnd_on_the_same_goals() -> None:
    rates = {(r["method"], r["attempts"]): r for r in summarize_trials(TRIALS, 2)}
    successes = {key: rate["successes"] for key, rate in rates.items()}
    assert successes == {("rnd", 1): 0, ("gp", 1): 1, ("rnd", 2): 1, ("gp", 2): 2}
    assert rates["rnd", 1]["p_value"] is None
    # Ten goals that only gp reaches and one that only rnd does: the sign test's (1 + 11) / 2^10.
    rows = make_rows("rnd", ["0"] * 10 + ["1"]) + make_rows("gp", ["1"] * 10 + ["0"])
    p_values = {r["method"]: r["p_value"] for r in summarize_trials(TrialTable(rows), 1)}
    assert p_values["gp"] == 12 / 2**10


def test_the_table_has_a_row_for_each_strategy_and_number_of_attempts() -> None:
    low, high = wilson_interval(1, 2)
    interval = f"{100 * low:.1f}..{100 * high:.1f}"
    _, _, *lines = format_rates(summarize_trials(TRIALS, 2)).splitlines()
    assert lines[0] == f"| gp | 1 | 50.0 | {interval} | 2 | 1 |"
    assert lines[3] == f"| rnd | 2 | 50.0 | {interval} | 2 |  |"
    assert len(lines) == 4
