from pathlib import Path

import pytest
from support.trial_rows import fill_records

from lic_drake.errors import LibraryError
from scripts.common import (
    CATEGORIES,
    load_trials,
    make_tables,
    run_table_script,
    write_tables,
)


@pytest.fixture
def records(tmp_path: Path) -> Path:
    return fill_records(tmp_path / "results")


def test_the_tables_of_the_paper_are_four(records: Path) -> None:
    starts = [make_tables(records, number)[0].caption.split(".")[0] for number in CATEGORIES]
    assert starts == ["Table I", "Table II", "Table III", "Table IV"]
    assert [len(make_tables(records, number)) for number in CATEGORIES] == [2, 1, 2, 2]


def test_tables_are_written_as_markdown_and_latex(records: Path) -> None:
    paths = write_tables(records, 1)
    assert paths == [records / "tables" / "table_1.md", records / "tables" / "table_1.tex"]
    markdown, latex = (path.read_text() for path in paths)
    assert "| 1st attempt | LIC(GP) | 77.80 (1556/2000) |" in markdown
    assert "LIC(GP) - RND | +16.80" in markdown
    assert latex.count(r"\begin{tabular}") == latex.count(r"\end{tabular}") == 2
    # Written again, they are the same.
    assert [path.read_text() for path in write_tables(records, 1)] == [markdown, latex]


def test_missing_trials_come_with_the_command_that_makes_them(tmp_path: Path) -> None:
    with pytest.raises(LibraryError) as caught:
        load_trials(tmp_path, "passage-clutter")
    assert str(caught.value) == (
        f"no trials at {tmp_path}/passage-clutter/trials.parquet; make them with: lic evaluate"
        f" {tmp_path}/passage-clutter --library models/experience/passage-clutter"
        " --environments 2000 --goals 1 --attempts 2"
    )


def test_the_script_writes_and_names_its_files(
    records: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_table_script(3, "Table III.\n", ["--results", str(records)]) == 0
    names = [Path(line).name for line in capsys.readouterr().out.splitlines()]
    assert names == ["table_3.md", "table_3.tex"]
    assert "1609/2000" in (records / "tables" / "table_3.md").read_text()


def test_the_script_says_in_one_line_what_is_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_table_script(4, "Table IV.\n", ["--results", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: no trials at")
    assert error.count("\n") == 1
