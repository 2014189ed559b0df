"""The example programs run, and print what they are there to show."""

import re
import runpy
from pathlib import Path

import pytest
import sklearn.ensemble
from support.made_up import part_of_shipped

import lic_drake
from lic_drake.paths import shipped_library

EXAMPLES = Path(__file__).resolve().parents[2] / "scripts" / "examples"
SHOWN = {
    "one_reach": "m to go, largest taxel force",
    "select_and_reach": "reached",
    "own_estimator": "the forest chooses",
    "own_constraint": "bound: b0",
    "own_category": "reached",
    "own_controller": "Yielding: ",
}

PARTS = {"cylinder-clutter": 1, "passage-clutter": 12}
"""Numbers of environments of the shipped libraries that are enough here."""


def test_every_example_is_run():
    assert {*SHOWN, "rollouts"} == {path.stem for path in EXAMPLES.glob("[a-z]*.py")}


@pytest.fixture
def _quick(tmp_path, monkeypatch):
    """The examples learn from parts of the libraries, with fewer trees."""

    def part(category):
        if category not in PARTS:
            return shipped_library(category)
        return part_of_shipped(tmp_path / category, category, PARTS[category]).path

    monkeypatch.setattr(lic_drake, "shipped_library", part, raising=False)
    request = lic_drake.CollectionRequest
    monkeypatch.setattr(
        lic_drake,
        "CollectionRequest",
        lambda **v: request(**{**v, "environments": 1, "max_starts": 2}),
    )
    forest = sklearn.ensemble.RandomForestClassifier
    monkeypatch.setattr(sklearn.ensemble, "RandomForestClassifier", lambda _, **v: forest(5, **v))


@pytest.mark.usefixtures("_quick")
@pytest.mark.parametrize("name", SHOWN)
def test_it_runs(name, registries_restored, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    assert SHOWN[name] in capsys.readouterr().out


def test_bases_that_a_table_teaches_reach_more_and_as_often_as_expected(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(EXAMPLES / "rollouts.py"), run_name="__main__")
    at_random, chosen, expected = map(int, re.findall(r"(\d+)%", capsys.readouterr().out))
    assert chosen > at_random + 20
    assert abs(chosen - expected) < 10
