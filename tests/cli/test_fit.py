import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
import pytest

from lic_drake.cli.main import main

COLUMNS = ("--decide", "a", "b", "--given", "s")
GROUPS = ("--group", "scene")


def make_table(n: int = 320) -> pa.Table:
    """Attempts in scenes of eight; success is where a is near s."""
    rng = np.random.default_rng(0)
    scene = np.arange(n) // 8
    s, a, b = rng.uniform(size=n // 8)[scene], rng.uniform(size=n), rng.uniform(size=n)
    success = rng.uniform(size=n) < np.exp(-20.0 * (a - s) ** 2)
    return pa.table(
        {"a": a, "b": b, "s": s, "scene": [f"no {k}" for k in scene]}
        | {"success": success.astype(int)}
    )


def replaced(name: str, values: object) -> pa.Table:
    table = make_table(16)
    return table.set_column(table.column_names.index(name), name, pa.array(values))


def fit(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    code = main(["fit", *arguments])
    out, err = capsys.readouterr()
    return code, out, err


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_it_answers_with_decision_probability_and_map(
    suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, picture = tmp_path / f"table.{suffix}", tmp_path / "out" / "map.png"
    write = {"csv": pyarrow.csv.write_csv, "parquet": pq.write_table}[suffix]
    write(make_table(), path)
    common = [str(path), *COLUMNS, *GROUPS, "--method", "knn", "--json"]
    code, out, _ = fit(capsys, *common)
    assert code == 0
    learned = json.loads(out)
    assert (learned["rollouts"], learned["groups"], learned["held_out_choices"]) == (320, 40, 40)
    assert learned["success_rate_of_choices"] > learned["success_rate"] + 0.1
    code, out, _ = fit(capsys, *common, "--at", "s=0.6", "--map", str(picture))
    answer = json.loads(out)
    assert code == 0 and answer["at"] == {"s": 0.6}
    assert answer["decision"]["a"] == pytest.approx(0.6, abs=0.2)
    low, high = answer["interval"]
    assert low < answer["probability"] < high
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_what_is_assumed_or_missing_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pq.write_table(make_table(80), tmp_path / "t.parquet")
    arguments = [str(tmp_path / "t.parquet"), *COLUMNS, "--method", "knn", "--at", "s=0.5"]
    code, out, err = fit(capsys, *arguments)
    assert code == 0 and "probability" not in out
    assert "each row is taken for a scene of its own" in err
    assert "no probability is known" in err and "30 are needed" in err


TABLES = {
    "good": make_table(16),
    "text": replaced("b", ["left"] * 16),
    "vectors": replaced("b", [[1.0, 2.0]] * 16),
    "nan": replaced("s", [0.5] * 13 + [np.nan, np.inf, None]),
    "counts": replaced("success", [0, 1] * 7 + [2, 3]),
    "winners": replaced("success", [True] * 16),
    "losers": replaced("success", [0] * 16),
    "alone": replaced("scene", [7] * 16),
    "nameless": replaced("scene", [None] * 3 + ["x"] * 13),
    "stuck": replaced("b", [0.3] * 16),
    "long": pa.table(
        {
            **{name: np.linspace(0.0, 1.0, 8001) for name in ("a", "b", "s")},
            **{"success": np.arange(8001) % 2, "scene": np.arange(8001)},
        }
    ),
}
WRONG = [
    ("none", "", "there is no file"),
    ("folder.txt", "", "from a .csv or .parquet file"),
    ("broken", "", "cannot read"),
    ("good", "--decide a colour", "no column colour; it has a, b, s, scene, success"),
    ("good", "--success won", "no column won; it has"),
    ("good", "--group place", "no column place; it has"),
    ("good", "--given a s", "column a is named twice"),
    ("text", "", "column b holds string, but must hold numbers"),
    ("vectors", "", "column b holds list<"),
    ("nan", "", "3 of 16 rows have no finite s; leave those rows out, or fill them in"),
    ("counts", "", "2 of 16 rows have a success other than 0 and 1, such as 2"),
    ("winners", "", "all 16 rows are successes"),
    ("losers", "", "all 16 rows are failures"),
    ("alone", "", "all rows are of one scene"),
    ("nameless", "", "3 of 16 rows have no scene"),
    ("stuck", "", "b is 0.3 in all rows, so there is nothing to decide"),
    ("good", "--at", "expected at least one argument"),
    ("good", "--at s", "COLUMN=NUMBER, got s"),
    ("good", "--at s=left", "COLUMN=NUMBER, got s=left"),
    ("good", "--at s=0.3 s=0.4", "two values of s"),
    ("good", "--at a=0.3", "a is not given; given are s"),
    ("good", "--given s b --decide a --at s=0.6", "the situation lacks b; the table has"),
    ("good", "--at s=90", "s is 90, but the table has only"),
    ("good", "--at s=nan", "s is nan, but the table has only"),
    ("good", "--map m.png", "give both, and --at"),
    ("good", "--method jungle", "choose one of gp, knn"),
    ("long", "--method gp", "at most 8000 distinct rows, got 8001; use the estimator 'knn'"),
]


@pytest.mark.parametrize(("table", "options", "said"), WRONG)
def test_what_is_wrong_is_one_line_that_says_what_to_do(
    table: str, options: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / (table if "." in table else f"{table}.parquet")
    if table in TABLES:
        pq.write_table(TABLES[table], path)
    elif table == "broken":
        path.write_text("no table")
    try:
        code, out, err = fit(capsys, str(path), *COLUMNS, *GROUPS, *options.split())
    except SystemExit as end:  # Of argparse.
        code, (out, err) = end.code, capsys.readouterr()
    assert code == 2 and out == ""
    assert said in err.splitlines()[-1]
