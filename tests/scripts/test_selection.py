import sys

import numpy as np
import pytest
from support.select_surfaces import random_model
from support.starts import APERTURES, ARM

from lic_drake.estimate.features import PLANAR_LIC1
from lic_drake.select.lic import LicSelector
from lic_drake.select.situation import Situation
from scripts.selection import run
from scripts.selection.run import best_feasible, sample


def test_the_best_sample_is_the_best_of_those_that_are_feasible() -> None:
    samples = sample(APERTURES, 300, np.random.default_rng(1))
    asked = Situation(p_WG=np.array([0.6, 0.1, 0.0]), starts=APERTURES)
    program = LicSelector(random_model(0, PLANAR_LIC1)).program(asked)
    feasible = np.array([len(ARM.solve_ik(x0)) > 0 for x0 in samples.in_R])
    feasible &= np.abs(samples.in_R[:, 1]) <= 0.4
    assert 10 < feasible.sum() < 300
    assert best_feasible(program, samples) == program.estimates(samples)[feasible].max()
    assert best_feasible(program, samples.take(np.zeros(0, dtype=int))) == -np.inf


def test_a_table_says_who_found_what(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = "run.py --situations 1 --samples 300 --estimators knn"
    monkeypatch.setattr(sys, "argv", arguments.split())
    assert run.main() == 0
    rows = [line for line in capsys.readouterr().out.splitlines() if line.startswith("| knn")]
    assert [row.split(" | ")[1] for row in rows] == [
        *("discrete", "samples", "lattice", "L-BFGS-B", "program", "program, pattern search")
    ]
