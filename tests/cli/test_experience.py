import json
import os
import subprocess
from pathlib import Path

import pandas as pd
import pytest
from support.fake_reach import make_record, make_request

from lic_drake.cli.main import main
from lic_drake.experience.collect import REQUEST_FILE, write_request
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.reach.scenario import load_scenario


def test_info_prints_the_same_numbers_as_text_and_json(
    library: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["experience", "info", str(library)]
    assert main([*command, "--json"]) == 0
    values = json.loads(capsys.readouterr().out)
    assert values["successes"] == int(pd.read_parquet(library)["success"].sum())
    assert values["success_rate"] == values["successes"] / 36
    assert values["success_interval"][0] < values["success_rate"] < values["success_interval"][1]
    assert values["scenario"] == make_request().scenario.digest
    assert main(command) == 0
    lines = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert lines.keys() == values.keys()
    assert (lines["reaches"], lines["goals"], lines["streams"]) == ("36", "4", "training")


def test_check_of_a_shipped_library_by_its_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["experience", "check", "passage-clutter"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "reaches     1680" in lines
    assert lines[-1] == "verdict     complete"


def test_check_says_what_is_missing_and_how_to_go_on(
    library: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_request(make_request(environments=9), library / REQUEST_FILE)
    (library / "training-000001.parquet").unlink()
    assert main(["experience", "check", str(library)]) == 1
    text = capsys.readouterr().out
    assert "missing     84\n" in text and "incomplete  1, 3, 4, 5, 6, 7, 8\n" in text
    assert text.endswith(f"INCOMPLETE; resume with: lic collect {library}\n")


def test_the_command_that_check_prints_repairs_a_damaged_library_and_keeps_the_files(
    tmp_path: Path, library: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    library = library.rename(tmp_path / "my library")
    for name in ("training-000001.parquet", "training-000002.parquet"):
        (library / name).write_bytes((library / name).read_bytes()[:-20])
    assert main(["collect", str(library)]) == 2
    assert "training-000001.parquet is damaged" in capsys.readouterr().err
    assert main(["experience", "check", str(library)]) == 1
    text = capsys.readouterr().out
    assert "training-000002.parquet is damaged" in text
    repair = text.splitlines()[-1].partition("DAMAGED; repair with: ")[2]
    folder = tmp_path / "bin"
    folder.mkdir()
    (folder / "lic").write_text('#!/bin/sh\necho "$@"\n')
    (folder / "lic").chmod(0o755)
    path = f"{folder}{os.pathsep}{os.environ['PATH']}"
    result = subprocess.run(
        ["sh", "-c", repair], env={"PATH": path}, capture_output=True, text=True, check=True
    )
    assert result.stdout == f"collect {library}\n"
    assert len(list((library / "_damaged").iterdir())) == 2
    assert main(["experience", "check", str(library)]) == 1
    assert "missing     24\n" in capsys.readouterr().out


def test_merge_writes_one_file(
    tmp_path: Path, library: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "all.parquet"
    assert main(["experience", "merge", str(output), str(library), str(library)]) == 0
    assert capsys.readouterr().out == f"36 reaches in {output}\n"
    assert len(pd.read_parquet(output)) == 36
    assert main(["experience", "merge", str(output), str(library)]) == 2
    assert "exists, or does not end in .parquet; delete it" in capsys.readouterr().err


def test_recompute_counts_and_names_differences_in_all_rows_if_there_are_few(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # Rows that were made up, so simulating them gives others.
    scenario = load_scenario("cylinder-clutter", "{stop: {timeout_s: 0.04}}")
    records = [make_record(item) for item in make_request(scenario=scenario).reaches(0)]
    few = ExperienceLibrary(tmp_path).write_shard("few", records, scenario)
    assert main(["experience", "recompute", str(few), "--seed", "1"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].endswith(f"of {len(records)} rows are identical to the last bit")
    assert lines[1][:16] in {record.key for record in records}


HEADER = "success,goal_x,goal_y,start_y,start_phi\n"


def test_added_rows_are_told_by_info_and_change_what_is_selected(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shipped, passages = ExperienceLibrary(shipped_library("passage-clutter")), tmp_path / "passages"
    ExperienceLibrary(passages).write_shard("few", shipped.records()[:280], shipped.scenario())
    # A robot that succeeds only from starts that the simulation advises against.
    path = tmp_path / "lab.csv"
    lines = [
        f"{int(y > 4)},0.695,0.0,{y / 40:.3f},{phi / 20}\n"
        for y in range(-16, 13, 2)
        for phi in range(0, 27, 2)
    ]
    path.write_text(HEADER + "".join(lines))

    def select() -> float:
        command = "select --goal 0.695 0.0 --method knn1 --json --library"
        assert main([*command.split(), str(passages)]) == 0
        return float(json.loads(capsys.readouterr().out)["start"][1])

    before = select()
    add = ["experience", "add", str(passages), str(path), "--source", "lab"]
    assert main([*add, "--weight", "100"]) == 0
    assert capsys.readouterr().out.startswith("added 210 rows from lab, ")
    assert before < 0.0 < 0.1 < select()
    assert main(["experience", "info", str(passages)]) == 0
    text = capsys.readouterr().out
    assert "lab reaches 210, " in text and "weights 100" in text


def test_a_wrong_row_is_one_line_on_stderr_and_nothing_is_written(
    library: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "wrong.csv"
    path.write_text(HEADER + "1,0.6,0,0,1\n0,0.6,0,0,60\n")
    assert main(["experience", "add", str(library), str(path), "--source", "lab"]) == 2
    error = capsys.readouterr().err
    assert error == (
        "lic: error: row 2: start_phi is 60, but must be a number from -3.1416 to 3.1416 rad;"
        " correct it or leave the row out\n"
    )
    assert len(list(library.glob("*.parquet"))) == 3
