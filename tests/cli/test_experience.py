import json
from pathlib import Path

import pandas as pd
import pytest
from fake_reach import make_request

from lic_drake.cli.main import main
from lic_drake.experience.grid import write_request


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
    assert capsys.readouterr().out.endswith("missing     0\nsound\n")


def test_check_against_a_larger_request_counts_what_is_missing(
    tmp_path: Path, library: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    larger = tmp_path / "larger.yaml"
    write_request(make_request(environments=5), larger)
    command = ["experience", "check", str(library), "--request", str(larger)]
    assert main(command) == 1
    assert capsys.readouterr().out.endswith("missing     24\nNOT SOUND\n")
    assert main([*command, "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["missing"] == 24


def test_check_names_a_damaged_file(library: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (library / "training-000001.parquet").write_bytes(b"PAR1")
    assert main(["experience", "check", str(library)]) == 1
    text = capsys.readouterr().out
    assert "damaged     1\n" in text
    assert "training-000001.parquet is damaged" in text


def test_merge_writes_one_file(
    tmp_path: Path, library: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "all.parquet"
    assert main(["experience", "merge", str(output), str(library), str(library)]) == 0
    assert capsys.readouterr().out == f"36 reaches in {output}\n"
    assert len(pd.read_parquet(output)) == 36
    assert main(["experience", "merge", str(output), str(library)]) == 2
    assert "exists; delete it" in capsys.readouterr().err
