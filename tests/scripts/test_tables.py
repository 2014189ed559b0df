from pathlib import Path

from support.trial_rows import fill_records

from scripts.common import write_tables


def test_each_table_of_the_paper_is_written(tmp_path: Path) -> None:
    results = fill_records(tmp_path / "results")
    for number in (1, 2, 3, 4):
        write_tables(results, number)
    written = sorted(path.name for path in (results / "tables").iterdir())
    assert written == [f"table_{n}.{suffix}" for n in (1, 2, 3, 4) for suffix in ("md", "tex")]
