"""The example programs run, and print what they are there to show."""

import runpy
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "scripts" / "examples"
SHOWN = {
    "one_reach": "m to go, largest taxel force",
    "select_and_reach": "reached",
    "own_estimator": "the forest chooses",
    "own_constraint": "bound: b0",
    "own_category": "reached",
    "unknown_category": "first choice",
}


def test_every_example_is_run():
    assert set(SHOWN) == {path.stem for path in EXAMPLES.glob("[a-z]*.py")}


@pytest.mark.parametrize("name", SHOWN)
def test_it_runs(name, registries_restored, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    assert SHOWN[name] in capsys.readouterr().out
