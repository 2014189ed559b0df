import json
import os
import subprocess
from pathlib import Path

import pandas as pd
import pytest
from support.fake_reach import make_request

from lic_drake.cli.main import main
from lic_drake.experience.grid import REQUEST_FILE, write_request


def test_info_prints_rates_with_counts_and_interval(
    library: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["experience", "info", str(library)]) == 0
    text = capsys.readouterr().out
    successes = int(pd.read_parquet(library)["success"].sum())
    assert f"{successes} of 36 = {successes / 36:.1%} (90 % interval " in text
    assert "3 environments (training), 4 goals, 3 starts" in text
    assert make_request().scenario.digest in text


def test_info_as_json_has_the_same_numbers(
    library: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["experience", "info", str(library), "--json"]) == 0
    values = json.loads(capsys.readouterr().out)
    assert values["reaches"] == 36
    assert values["success_rate"] == values["successes"] / 36
    assert values["success_interval"][0] < values["success_rate"] < values["success_interval"][1]


def test_check_of_a_sound_library_exits_with_0(
    library: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["experience", "check", str(library)]) == 0
    assert capsys.readouterr().out.splitlines()[0::6] == [
        "reaches     36 in 3 files",
        "complete",
    ]


def test_check_against_a_larger_request_counts_what_is_missing(
    tmp_path: Path, library: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    larger = tmp_path / "larger.yaml"
    write_request(make_request(environments=5), larger)
    command = ["experience", "check", str(library), "--request", str(larger)]
    assert main(command) == 1
    output = capsys.readouterr().out
    assert "missing     24 of 60, in environments 3-4\n" in output
    assert output.endswith("\nINCOMPLETE\n")
    assert main([*command, "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["missing"] == 24


def test_check_says_what_is_missing_and_how_to_go_on(
    library: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_request(make_request(environments=9), library / REQUEST_FILE)
    (library / "training-000001.parquet").unlink()
    assert main(["experience", "check", str(library)]) == 1
    text = capsys.readouterr().out
    assert "missing     84 of 108, in environments 1, 3-8\n" in text
    assert text.endswith(f"INCOMPLETE; go on with: lic collect {library}\n")


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
    assert "damaged     2\n" in text
    assert "training-000002.parquet is damaged" in text
    repair = text.splitlines()[-1].removeprefix("DAMAGED; repair with: ")
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
    assert "missing     24 of 36, in environments 1-2\n" in capsys.readouterr().out


def test_merge_writes_one_file(
    tmp_path: Path, library: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "all.parquet"
    assert main(["experience", "merge", str(output), str(library), str(library)]) == 0
    assert capsys.readouterr().out == f"36 reaches in {output}\n"
    assert len(pd.read_parquet(output)) == 36
    assert main(["experience", "merge", str(output), str(library)]) == 2
    assert "exists; delete it" in capsys.readouterr().err
