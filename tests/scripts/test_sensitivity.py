from pathlib import Path

import pytest
from support.trial_rows import make_rows

from lic_drake.evaluate.trials import TrialTable
from lic_drake.reach.scenario import load_scenario
from scripts.sensitivity import run


def test_variants_are_different_scenarios() -> None:
    digests = [load_scenario("cylinder-clutter", text).digest for text in run.VARIANTS.values()]
    assert len(set(digests)) == len(digests)
    assert digests[0] == load_scenario("cylinder-clutter").digest


def test_a_row_compares_first_attempts() -> None:
    rows = make_rows("rnd", ["0", "0", "0", "1"]) + make_rows("cost", ["0", "0", "1", "1"])
    cells = run.row("v", TrialTable(rows + make_rows("gp", ["1", "1", "1", "0"])))
    assert cells[:4] == ("v", "25.0", "50.0", "75.0")
    assert cells[4].startswith("25.0 (") and cells[5] == "1"


def test_a_variant_is_collected_learned_from_and_evaluated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run, "VARIANTS", {"brief": "{stop: {timeout_s: 0.2}}"})
    monkeypatch.setattr(run, "LEARNING", ["--environments", "2", "--max-goals", "1"])
    monkeypatch.setattr(run, "EVALUATION", ["--environments", "1", "--attempts", "1"])
    places = ["--reaches", str(tmp_path / "reaches"), "--results", str(tmp_path)]
    monkeypatch.setattr("sys.argv", ["run.py", *places, "--workers", "1"])
    run.main()
    assert "| brief | 0.0 | 0.0 | 0.0 |" in (tmp_path / "sensitivity.md").read_text()
