import pytest

from lic_drake.evaluate.table import Table, latex_text

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
        ("1e+20", r"$1\times10^{20}$"),
        ("t(3998) = -8.103", "t(3998) = $-$8.103"),
        ("-2.1..-0.3", "$-$2.1--$-$0.3"),
        ("LIC-1, K-NN, 3-D, 2-1", "LIC-1, K-NN, 3-D, 2-1"),
        ("59.3..70.3", "59.3--70.3"),
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
