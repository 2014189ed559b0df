import re
from pathlib import Path

import numpy as np
import pytest
from support.made_up import small_cameras

from lic_drake.clutter.foliage import FoliageApertureClutter
from lic_drake.errors import RenderingError
from lic_drake.perception.config import load_cameras
from lic_drake.reach.scenario import load_scenario
from lic_drake.seeds import make_generator
from scripts.perception.errors import (
    ApertureError,
    GoalError,
    measure_scene,
    perception_report,
    true_states,
)

SCENARIO = load_scenario("foliage-aperture-clutter")


def aperture(truth: str, state: str, probability: float, error_m: float) -> ApertureError:
    return ApertureError(
        scene=0,
        noise=True,
        aperture=0,
        truth=truth,
        state=state,
        probability_open=probability,
        error_m=error_m,
        chi_squared=error_m * 1e3,
    )


def test_true_states_are_counted_as_they_were_drawn() -> None:
    clutter = FoliageApertureClutter(
        num_stems=0, num_branches=0, leaves_per_stem=0, num_blocked=5, num_partly_covered=4
    )
    for index in range(5):
        states = true_states(clutter, clutter.sample(make_generator("training", "s", index)))
        assert [states.count(s) for s in ("open", "partly", "blocked")] == [11, 4, 5]


def test_a_report_has_medians_rates_and_who_was_taken_for_what() -> None:
    apertures = [
        aperture("open", "open", 1.0, 0.001),
        aperture("open", "partly", 0.4, 0.002),
        aperture("blocked", "blocked", 0.0, 0.009),
        aperture("partly", "unseen", 0.5, np.nan),
    ]
    goals = [GoalError(scene=0, noise=True, error_m=np.nan, chi_squared=np.nan)]
    exact = [GoalError(scene=0, noise=False, error_m=0.004, chi_squared=2.0)]
    bright = [
        ApertureError(**{**vars(a), "noise": False, "state": a.truth, "error_m": 0.001})
        for a in apertures
    ]
    text = perception_report(apertures + bright, goals + exact)
    rows = dict(re.findall(r"^\| ([^|]+) \| .* \| ([^|]+) \|$", text, re.MULTILINE))
    assert rows["aperture's centre: median error, 95 %"].startswith("2.0 mm, 8.3 mm (3 of 4 found)")
    assert rows["goal: median error, 95 %"] == "none of 1 found"
    assert rows["open or not: right (90 % interval)"].startswith("75.00 % of 4")
    assert rows["probability of being open: Brier score"] == "0.1525"
    assert rows["mean squared error by covariance, apertures (3)"] == "4.00"
    assert "| open | 1 | 1 | 0 | 0 |" in text
    assert "| partly | 0 | 0 | 0 | 1 |" in text


def test_a_scene_is_measured_with_and_without_errors(tmp_path: Path) -> None:
    cameras = load_cameras(small_cameras(tmp_path / "small.yaml"))
    try:
        apertures, goals = measure_scene(SCENARIO, cameras, 0)
    except RenderingError as error:
        pytest.skip(str(error))
    assert [a.noise for a in apertures] == [False] * 20 + [True] * 20
    assert [g.noise for g in goals] == [False, True]
    assert max(a.error_m for a in apertures[:20]) < 0.003
    assert 0.003 > goals[0].error_m
    assert max(a.error_m for a in apertures) < 0.04
    assert all(a.state == a.truth for a in apertures)
