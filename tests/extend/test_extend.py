"""A category, an arm and an estimator, each added in one short file outside the package."""

import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydrake.multibody.plant import MultibodyPlant

from lic_drake.cli.main import main
from lic_drake.clutter.instance import ClutterInstance
from lic_drake.estimate.registry import make_estimator
from lic_drake.experience.collect import CollectionRequest
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.session import run_reach
from lic_drake.robots.planar import planar_arm
from lic_drake.robots.registry import get_robot

EXTEND = Path(__file__).resolve().parents[2] / "notebooks" / "extend"
SCENARIO = EXTEND / "shelf.yaml"
Extensions = dict[str, ModuleType]


def corners(instance: ClutterInstance, i: int) -> np.ndarray:
    """Corners of a box seen from above, shape (4, 2), counter-clockwise."""
    half = 0.5 * instance.size[i, :2] * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    c, s = np.cos(instance.yaw[i]), np.sin(instance.yaw[i])
    return instance.p_WO[i, :2] + half @ np.array([[c, s], [-s, c]])


def are_apart(a: np.ndarray, b: np.ndarray) -> bool:
    """Separating axes of two rectangles."""
    for one in (a, b):
        for edge in np.diff(one[:3], axis=0):
            if (a @ edge).max() <= (b @ edge).min() or (b @ edge).max() <= (a @ edge).min():
                return True
    return False


@pytest.mark.parametrize("path", sorted(EXTEND.glob("*.py")), ids=lambda path: path.stem)
def test_each_is_one_file_of_less_than_60_lines(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) < 60


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(environment=st.integers(0, 2**31))
def test_boxes_on_the_shelf_overlap_neither_each_other_nor_the_walls(
    extend: Extensions, environment: int
) -> None:
    instance = load_scenario(SCENARIO).sample_instance("training", environment)
    assert (instance.num_objects, int(instance.movable.sum())) == (15, 12)
    boxes = [corners(instance, i) for i in range(instance.num_objects)]
    # The back and the sides touch each other.
    pairs = [(i, j) for i in range(12) for j in range(i + 1, 15)]
    assert all(are_apart(boxes[i], boxes[j]) for i, j in pairs)


def test_the_long_arm_is_where_drake_says(extend: Extensions) -> None:
    arm = get_robot("long-arm")
    assert arm.reach_m == pytest.approx(planar_arm().reach_m + 0.06)
    np.testing.assert_allclose(arm.stiffness, 0.5 * planar_arm().stiffness)
    plant = MultibodyPlant(1e-3)
    instance = arm.add_to_plant(plant)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    for q in np.random.default_rng(0).uniform(arm.q_min, arm.q_max, (20, 3)):
        plant.SetPositions(context, q)
        X_WE = plant.GetFrameByName("tip", instance).CalcPoseInWorld(context)
        np.testing.assert_allclose(arm.calc_pose(q).p_RE, X_WE.translation(), atol=1e-9)
        R_RL, p_RL = arm.calc_pose(q)[:2]
        for link, name in enumerate(arm.link_names):
            X_WL = plant.GetBodyByName(name, instance).EvalPoseInWorld(context)
            np.testing.assert_allclose(R_RL[link], X_WL.rotation().matrix(), atol=1e-9)
            np.testing.assert_allclose(p_RL[link], X_WL.translation(), atol=1e-9)


def test_the_long_arm_reaches_a_goal_among_boxes(extend: Extensions) -> None:
    request = CollectionRequest(scenario=load_scenario(SCENARIO), max_goals=6, max_starts=9)
    record = run_reach(request.reaches(0)[40])
    assert (record.category, record.robot) == ("shelf-clutter", "long-arm")
    assert record.outcome == "reached"


def surface(Z: np.ndarray) -> np.ndarray:
    """A known P(success) of a goal (x, y) and a start (y, phi)."""
    return 1.0 / (1.0 + np.exp(20.0 * (Z[:, 0] - 0.65) + 6.0 * np.abs(Z[:, 1] - Z[:, 2])))


@pytest.fixture
def rows() -> tuple[np.ndarray, np.ndarray]:
    """5,000 reaches drawn from it."""
    rng = np.random.default_rng(0)
    Z = rng.uniform([0.45, -0.4, -0.4, -1.5], [0.85, 0.4, 0.4, 1.5], (5000, 4))
    return Z, (rng.random(5000) < surface(Z)).astype(float)


def test_boosting_learns_a_known_surface(
    extend: Extensions, rows: tuple[np.ndarray, np.ndarray]
) -> None:
    Z, f = rows
    fitted = make_estimator("boosting").fit(Z, f)
    rng = np.random.default_rng(1)
    unseen = rng.uniform([0.5, -0.3, -0.3, -1.2], [0.8, 0.3, 0.3, 1.2], (500, 4))
    error = np.mean(np.abs(fitted.predict_proba(unseen)[:, 1] - surface(unseen)))
    assert error < 0.33 * np.mean(np.abs(f.mean() - surface(unseen)))


def test_the_gradient_is_the_slope_of_the_averaged_estimate(
    extend: Extensions, rows: tuple[np.ndarray, np.ndarray]
) -> None:
    fitted = make_estimator("boosting").fit(*rows)
    z, scale = np.array([0.62, 0.1, -0.1, 0.3]), rows[0].std(axis=0)
    value, gradient = fitted.value_and_gradient(z)
    assert value == fitted.values(z[None])[0]
    for i, slope in enumerate(gradient):
        # The box average over +-h, moved by d: its difference by d, summed on a fine grid.
        h = 0.2 * scale[i]
        line = np.tile(z, (4001, 1))
        line[:, i] += np.linspace(-2.0 * h, 2.0 * h, 4001)
        average = np.convolve(fitted.values(line), np.full(2001, 1.0 / 2001), mode="valid")
        d = 4.0 * h / 4000
        numerical = (average[1001] - average[999]) / (2.0 * d)
        assert slope == pytest.approx(numerical, abs=0.02 * np.abs(gradient).max())


def test_boosting_without_failures_expects_none(extend: Extensions) -> None:
    fitted = make_estimator("boosting").fit(np.zeros((3, 4)), np.ones(3))
    assert fitted.values(np.zeros((1, 4))) == [1.0]


def test_the_command_line_collects_learns_and_selects_with_all_three(
    environment: dict[str, str],
    extend: Extensions,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    for name, value in environment.items():  # The worker process has nothing else.
        monkeypatch.setenv(name, value)
    library = str(tmp_path / "library")
    limits = ("--environments", "1", "--max-goals", "3", "--max-starts", "2", "--workers", "1")
    fewer = "{clutter: {num_boxes: 2}, stop: {timeout_s: 0.2, success_distance_m: 0.35}}"
    scenario = ("--scenario", str(SCENARIO), "--set", fewer)
    assert main(["collect", library, *scenario, *limits]) == 0
    capsys.readouterr()
    records = ExperienceLibrary(library).records()
    assert {(r.category, r.robot) for r in records} == {("shelf-clutter", "long-arm")}
    assert 0 < sum(record.success for record in records) < len(records) == 6
    select = "select --goal 0.6 0.2 --method boosting --json --library"
    assert main([*select.split(), library]) == 0
    chosen = json.loads(capsys.readouterr().out)
    assert chosen["method"] == "boosting"
    assert 0.0 <= chosen["estimated_success"] <= 1.0
    assert chosen["start"][0] == 0.335


def test_an_extension_that_is_not_there_is_one_clear_line(environment: dict[str, str]) -> None:
    environment["LIC_EXTENSIONS"] = "shelf,jungle"
    result = subprocess.run(
        [sys.executable, "-m", "lic_drake", "reach"], capture_output=True, text=True,
        env=environment,
    )  # fmt: skip
    assert result.returncode == 2
    assert result.stderr.count("\n") == 1
    assert "'jungle'" in result.stderr
    assert "PYTHONPATH" in result.stderr
