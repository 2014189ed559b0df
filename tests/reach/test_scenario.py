import copy
import dataclasses
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import yaml

from lic_drake.control.mpc import PRESETS
from lic_drake.errors import ScenarioError
from lic_drake.paths import scenarios_dir, shipped_library
from lic_drake.reach.scenario import load_scenario, parse_scenario
from lic_drake.reach.task import BaseTrack

SHIPPED = sorted(path.stem for path in scenarios_dir().glob("*.yaml"))
TEXT = (scenarios_dir() / "cylinder-clutter.yaml").read_text(encoding="utf-8")


def error_of(overrides: str) -> str:
    with pytest.raises(ScenarioError) as caught:
        load_scenario("cylinder-clutter", overrides)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("name", SHIPPED)
def test_every_shipped_scenario_loads_with_what_its_file_says(name: str) -> None:
    scenario = load_scenario(name)
    content = yaml.safe_load((scenarios_dir() / f"{name}.yaml").read_text(encoding="utf-8"))
    content.get("mpc", {}).pop("preset", None)
    values = dataclasses.asdict(scenario)

    def compare(given: Any, read: Any) -> None:
        for key, value in given.items():
            if isinstance(value, dict):
                compare(value, read[key])
            else:
                assert read[key] == value

    compare(content, values)


def test_the_papers_numbers_are_the_scenarios() -> None:
    # Section IV-A: 40 + 40 cylinders of 1 cm in 0.65 x 2.4 m, goals in 0.4 x 0.8 m, a start line
    # of 0.8 m; section V-A: "don't care" up to 5 N.
    scenario = load_scenario("cylinder-clutter")
    instance = scenario.sample_instance("training", 0)
    assert (instance.movable.sum(), (~instance.movable).sum()) == (40, 40)
    assert set(instance.size[:, 0]) == {0.01}
    clutter, goals = scenario.clutter, scenario.task.goal_area
    np.testing.assert_allclose(np.subtract(clutter.upper, clutter.lower), [0.65, 2.4])
    np.testing.assert_allclose(np.subtract(goals.upper, goals.lower), [0.4, 0.8])
    assert np.ptp([scenario.task.start_line.y_min_m, scenario.task.start_line.y_max_m]) == 0.8
    assert scenario.mpc.force_threshold_N == 5.0


def test_overrides_replace_single_values_at_every_level() -> None:
    plain = load_scenario(scenarios_dir() / "cylinder-clutter.yaml")
    changed = load_scenario(
        "cylinder-clutter",
        "{stop: {timeout_s: 7}, scene: {contact: {object_friction: 0.5}},"
        " task: {goal_area: {upper: [0.9, 0.4]}}}",
    )
    expected = copy.deepcopy(plain)
    expected.stop.timeout_s = 7.0
    expected.scene.contact.object_friction = 0.5
    expected.task.goal_area.upper = [0.9, 0.4]
    assert changed == expected


def test_an_mpc_preset_fills_what_the_file_leaves_open() -> None:
    changed = load_scenario("cylinder-clutter", "{mpc: {preset: ijrr_2013, force_threshold_N: 3}}")
    assert changed.mpc == dataclasses.replace(PRESETS["ijrr_2013"](), force_threshold_N=3.0)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ("{colour: red}", "unknown key 'colour'; known: ['category', 'clutter', "),
        ("{stop: {timeout: 3}}", "stop: "),
        ("{stop: {timeout_s: soon}}", "stop: "),
        ("{stop: 3}", "stop must be a YAML mapping, got 3"),
        ("{stop: {timeout_s: .inf}}", "stop: timeout_s must be from 0 to 3600, got inf"),
        ("{scene: {time_step_s: .nan}}", "scene: time_step_s must be from 1e-05 to 0.1, or 0"),
        ("{clutter: {num_movable: 2.5}}", "clutter: "),
        ("{task: {goal_area: {step_m: 1.0e-9}}}", "at most 1000 positive steps, got"),
        ("{task: {goal_area: null}}", "task: goal_area cannot be null, because an environment of"),
        ("{category: jungle}", "unknown category 'jungle'; choose one of cylinder-clutter"),
        ("{category: [cylinder-clutter]}", "category must be a name, got ['cylinder-clutter']"),
        ("{robot: r2d2}", "unknown robot 'r2d2'; choose one of planar-arm"),
        ("{mpc: {preset: greedy}}", "unknown mpc preset 'greedy'; choose ['haptic_mpc_2013', "),
        ("{mpc: {preset: {a: 1}}}", "unknown mpc preset {'a': 1}"),
        ("[1, 2]", "overrides: must be a YAML mapping, found list"),
        ("stop: {", "overrides: not YAML: "),
    ],
)
def test_what_does_not_fit_is_refused_with_its_place_and_value(
    overrides: str, message: str
) -> None:
    assert message in error_of(overrides)


@pytest.mark.parametrize("name", ["jungle", "none.yaml", "a\x00b.yaml", ""])
def test_a_missing_scenario_names_the_shipped_ones(name: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load_scenario(name)
    assert f"shipped scenarios: {', '.join(SHIPPED)}" in str(caught.value)


def leaves(section: Any) -> Iterator[tuple[Any, str]]:
    """Yields every plain value of nested dataclasses as its owner and its name."""
    for item in dataclasses.fields(section):
        value = getattr(section, item.name)
        if dataclasses.is_dataclass(value):
            yield from leaves(value)
        else:
            yield section, item.name


def changed(value: Any) -> Any:
    match value:
        case None:
            return BaseTrack()
        case bool():
            return not value
        case str():
            return value + "2"
        case list():
            return [value[0], math.nextafter(value[1], math.inf)]
        case int():
            return value + 1
        case _:
            return 1.0 if math.isinf(value) else math.nextafter(value, math.inf)


@pytest.mark.parametrize("name", SHIPPED)
def test_the_digest_changes_with_every_value_by_as_little_as_one_bit(name: str) -> None:
    scenario = load_scenario(name)
    digests = [scenario.digest]
    for owner, name in leaves(scenario):
        value = getattr(owner, name)
        setattr(owner, name, "iiwa14" if name == "robot" else changed(value))
        digests.append(scenario.digest)
        setattr(owner, name, value)
    assert len(digests) > 40
    assert len(set(digests)) == len(digests)
    assert scenario.digest == digests[0]


@pytest.mark.parametrize("name", ["sphere-aperture-clutter"])
def test_fields_that_came_later_leave_the_digests_of_the_shipped_libraries_alone(
    name: str,
) -> None:
    content = yaml.safe_load((shipped_library(name) / "_collection.yaml").read_text())
    stored = parse_scenario(yaml.safe_dump(content["scenario"]))
    assert stored == load_scenario(name, "{scene: {calm_move_m: 0, calm_change_N: 0.3}}")
    assert stored.digest == content["scenario_digest"]


def test_a_base_that_moves_needs_apertures() -> None:
    with pytest.raises(ScenarioError, match="a base that moves along a track needs apertures"):
        load_scenario("cylinder-clutter", "{task: {base: {y_min_m: -0.1}}}")
    scenario = load_scenario("cylinder-aperture-clutter")
    assert scenario.task.base is not None


def test_random_goals_are_functions_of_the_environment_in_the_area() -> None:
    scenario = load_scenario("cylinder-clutter", "{task: {goal_area: {random_goals: 4}}}")
    goals = scenario.goals("training", 3)
    assert goals.shape == (4, 3)
    np.testing.assert_array_equal(goals, scenario.goals("training", 3))
    np.testing.assert_array_equal(
        goals, [scenario.sample_goal("training", 3, index) for index in range(4)]
    )
    area = scenario.task.goal_area
    assert np.all(goals[:, :2] >= area.lower) and np.all(goals[:, :2] <= area.upper)
    everything = np.vstack([goals, scenario.goals("training", 4), scenario.goals("holdout", 3)])
    assert len(np.unique(everything, axis=0)) == 12


def test_the_digest_ignores_comments_order_and_how_numbers_are_written() -> None:
    plain = parse_scenario(TEXT)
    content = yaml.safe_load(TEXT)
    backwards = yaml.safe_dump(dict(reversed(content.items())), sort_keys=False)
    assert backwards != yaml.safe_dump(content, sort_keys=False)
    without_comments = yaml.safe_dump(content)
    assert "#" in TEXT and "#" not in without_comments
    integers = without_comments.replace("mass_kg: 1.0\n", "mass_kg: 1\n")
    assert integers != without_comments
    for text in (backwards, without_comments, integers):
        assert parse_scenario(text).digest == plain.digest
