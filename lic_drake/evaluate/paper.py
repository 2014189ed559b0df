"""The paper's Tables I to IV as data, and remarks on where they do not hold.

Park, Kapusta, Kim, Rehg and Kemp, "Learning to Reach into the Unknown: Selecting Initial Conditions
When Reaching in Clutter", section VI-B.
"""

from dataclasses import dataclass

from lic_drake.evaluate.statistics import Count, TTest

LABELS = {"rnd": "RND", "cost": "COST", "gp": "LIC(GP)", "knn": "LIC(K-NN)"}
"""The paper's names of the strategies, in the order of its columns."""


def label(method: str) -> str:
    """Returns the paper's name of a strategy; other strategies go by their own."""
    return LABELS.get(method, method)


@dataclass(frozen=True, kw_only=True)
class PaperColumn:
    """A strategy's column in Table I, III or IV.

    Attributes:
        first: First attempts.
        second: Second attempts, made where the first one failed.
        total: Trials with a success in one of the two attempts.
        percent: The three rates as printed, percent.
    """

    first: Count
    second: Count
    total: Count
    percent: tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class PaperTable:
    """Table I, III or IV: success rates of two consecutive attempts.

    Attributes:
        number: Roman number in the paper.
        category: Clutter category.
        trials: What was tried, in the words of the caption; "" where it says nothing.
        columns: Results by strategy.
    """

    number: str
    category: str
    trials: str
    columns: dict[str, PaperColumn]


TABLE_I = PaperTable(
    number="I",
    category="cylinder-clutter",
    trials="200 random environments with 10 different random goal locations",
    columns={
        "rnd": PaperColumn(
            first=Count(1220, 2000),
            second=Count(263, 780),
            total=Count(1483, 2000),
            percent=(61.0, 33.71, 74.15),
        ),
        "cost": PaperColumn(
            first=Count(1373, 2000),
            second=Count(190, 627),
            total=Count(1563, 2000),
            percent=(68.65, 30.30, 78.15),
        ),
        "gp": PaperColumn(
            first=Count(1556, 2000),
            second=Count(133, 444),
            total=Count(1689, 2000),
            percent=(77.8, 29.96, 84.45),
        ),
        "knn": PaperColumn(
            first=Count(1523, 2000),
            second=Count(152, 477),
            total=Count(1675, 2000),
            percent=(76.15, 31.86, 83.75),
        ),
    },
)
"""Success in cylinder-clutter."""

TABLE_III = PaperTable(
    number="III",
    category="passage-clutter",
    trials="2000 random environments with a goal in its passage",
    columns={
        "rnd": PaperColumn(
            first=Count(808, 2000),
            second=Count(328, 1192),
            total=Count(1136, 2000),
            percent=(40.4, 27.51, 56.8),
        ),
        "cost": PaperColumn(
            first=Count(682, 2000),
            second=Count(536, 1318),
            total=Count(1218, 2000),
            percent=(34.1, 40.66, 60.9),
        ),
        "gp": PaperColumn(
            first=Count(1339, 2000),
            second=Count(340, 661),
            total=Count(1679, 2000),
            percent=(66.95, 51.43, 83.95),
        ),
        "knn": PaperColumn(
            first=Count(1441, 2000),
            second=Count(168, 559),
            total=Count(1627, 2000),
            percent=(72.05, 30.05, 81.35),
        ),
    },
)
"""Success in passage-clutter."""

TABLE_IV = PaperTable(
    number="IV",
    category="cylinder-aperture-clutter",
    trials="",
    columns={
        "rnd": PaperColumn(
            first=Count(172, 1000),
            second=Count(125, 828),
            total=Count(297, 1000),
            percent=(17.2, 15.1, 29.7),
        ),
        "cost": PaperColumn(
            first=Count(652, 1000),
            second=Count(57, 348),
            total=Count(709, 1000),
            percent=(65.2, 16.4, 70.9),
        ),
        "knn": PaperColumn(
            first=Count(675, 1000),
            second=Count(103, 325),
            total=Count(778, 1000),
            percent=(67.5, 31.7, 77.8),
        ),
    },
)
"""Success in cylinder-aperture-clutter."""

TABLES = {table.category: table for table in (TABLE_I, TABLE_III, TABLE_IV)}
"""Success rates by clutter category."""

TABLE_II = {
    ("rnd", "gp"): TTest(3998, -8.103, 7.059e-16),
    ("cost", "gp"): TTest(3998, -5.125, 3.120e-7),
    ("rnd", "knn"): TTest(3998, -7.497, 8.038e-14),
    ("cost", "knn"): TTest(3998, -4.520, 6.368e-6),
    ("gp", "knn"): TTest(3998, 0.605, 0.545),
}
"""Table II, "paired sample t-tests in cylinder-clutter", by pair of strategies."""


@dataclass(frozen=True, kw_only=True)
class Remark:
    """A slip of the paper, or what its tests leave out.

    Attributes:
        place: Number of the table it bears on; "text" for the rest.
        text: What is written and what is right, or what the numbers also say.
    """

    place: str
    text: str


REMARKS = (
    Remark(
        place="I",
        text="The text gives 8.45 % for LIC's total in cylinder-clutter, a misprint of Table I's"
        " 84.45 % (1689/2000).",
    ),
    Remark(
        place="IV",
        text="The text gives 77.8 % for COST's total with apertures; 652 + 57 = 709, so Table IV's"
        " 70.9 % is right.",
    ),
    Remark(
        place="III",
        text="LIC(K-NN): 1441 + 168 = 1609 (80.45 %), not 1627 (81.35 %). Either its second"
        " attempts were 186/559 (33.3 %) or its total is 80.45 %. All other sums are right.",
    ),
    Remark(
        place="I",
        text="The rates of second attempts of RND, LIC(GP) and LIC(K-NN) are off in the last digit:"
        " 33.72, 29.95 and 31.87 % by their counts.",
    ),
    Remark(
        place="III",
        text="The rates of second attempts of RND, COST and LIC(GP) are cut off, not rounded:"
        " 27.52, 40.67 and 51.44 % by their counts.",
    ),
    Remark(
        place="II",
        text="The t-tests are called paired, but they are unpaired two-sample tests with pooled"
        " variance, on the totals of two attempts: so computed, all five values of t agree.",
    ),
    Remark(
        place="III",
        text="GP and K-NN do differ here, which the paper did not test: on first attempts"
        " t(3998) = -3.51, p = 0.0005, K-NN being better, and on the printed totals t(3998) = 2.17,"
        " p = 0.03, GP being better.",
    ),
    Remark(
        place="III",
        text="COST is worse than RND on first attempts, t(3998) = 4.13, p = 4e-5.",
    ),
    Remark(
        place="IV",
        text="LIC(K-NN) does not differ significantly from COST on first attempts, t(1998) = -1.09,"
        " p = 0.28; it does on totals, t(1998) = -3.54, p = 0.0004.",
    ),
    Remark(
        place="text",
        text="The 21 and 14 initial conditions are not the full grids of 9 positions with 7 or 5"
        " orientations (63 and 45): they are those that the arm can take.",
    ),
    Remark(
        place="text",
        text="40 environments, 12 goals and 20 initial conditions make 9,600 reaches in 3-D; 9,025"
        " were run, and the paper does not say why.",
    ),
    Remark(
        place="text",
        text="The learned probability is written P(x_inf = g | c, o, x0), without g among the"
        " conditions, though F takes the situation s = (g, c, o).",
    ),
)
"""What to know before comparing with the paper; each sum and test is checked by our tests."""
