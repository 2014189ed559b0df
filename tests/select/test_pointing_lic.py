from dataclasses import replace

import numpy as np
import pytest
from support.pr2_reaches import SCENARIO
from support.pr2_reference import link_poses

from lic_drake.errors import RequestError
from lic_drake.estimate.features import FeatureMap
from lic_drake.experience.pairs import SHOWN
from lic_drake.reach.pointing_starts import PointingStarts, pointing_starts
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.start import Start, Starts
from lic_drake.reach.starts import make_starts, planar_starts
from lic_drake.select.baselines import CostSelector, RandomSelector, corridor_cost
from lic_drake.select.objective import SuccessModel
from lic_drake.select.pointing_lic import RETRY_M, PointingLbfgsb, PointingLic, is_apart
from lic_drake.select.registry import make_selector
from lic_drake.select.situation import FailedReach, Situation

BLOCKED = load_scenario("sphere-aperture-clutter", "{clutter: {num_blocked: 10}}")

IN_SPACE = FeatureMap(goal=("goal_y", "goal_z"), start=("start_y", "start_z", "start_qx"))


class Ridge:
    """Estimates that fall with the distance of the start from a place in the robot's frame."""

    def values(self, Z: np.ndarray) -> np.ndarray:
        return np.asarray(np.exp(-np.abs(Z - [0.0, 0.0, -0.33, 0.8, 0.3]) @ self.scale))

    def value_and_gradient(self, z: np.ndarray) -> tuple[float, np.ndarray]:
        value = float(self.values(z[None])[0])
        return value, -value * self.scale * np.sign(z - [0.0, 0.0, -0.33, 0.8, 0.3])

    scale = np.array([0.0, 0.0, 3.0, 3.0, 0.3])


MODEL = SuccessModel(estimator=Ridge(), features=IN_SPACE)  # type: ignore[arg-type]


def situation(environment: int, *failed: FailedReach) -> Situation:
    starts = make_starts(BLOCKED, BLOCKED.sample_instance("holdout", environment))
    return Situation(p_WG=BLOCKED.sample_goal("holdout", environment), starts=starts, failed=failed)


def starts_of(asked: Situation) -> PointingStarts:
    assert isinstance(asked.starts, PointingStarts)
    return asked.starts


@pytest.mark.parametrize("kind", [PointingLic, PointingLbfgsb])
@pytest.mark.parametrize("environment", range(4))
def test_the_answer_is_possible_and_at_least_the_best_of_the_grid(
    kind: type[PointingLic], environment: int
) -> None:
    asked = situation(environment)
    selector = kind(MODEL)
    chosen = selector.select(asked)
    # By kinematics that do not read the model.
    X_WE = link_poses((*chosen.start.b0[:2], 0.0), chosen.start.b0[2], chosen.start.q)[7]
    np.testing.assert_allclose(X_WE[:3, 3], chosen.start.x0[:3], atol=1e-9)
    np.testing.assert_allclose(X_WE[:3, 0], [1.0, 0.0, 0.0], atol=1e-9)
    assert np.min(np.linalg.norm(starts_of(asked).p_WA - chosen.start.x0[:3], axis=1)) < 1e-9
    condition = Starts.of(chosen.start)
    objective = selector.objective(asked)
    value = objective.values(condition)[0]
    assert value == pytest.approx(chosen.probability)
    assert value >= objective.values(asked.starts.grid).max()
    assert chosen.seconds < 10.0


def test_the_optimisation_gains_over_the_grid() -> None:
    gains = []
    for environment in range(4):
        asked = situation(environment)
        best = PointingLic(MODEL).objective(asked).values(asked.starts.grid).max()
        chosen = PointingLic(MODEL).select(asked)
        assert chosen.probability is not None
        gains.append(chosen.probability - best)
    assert max(gains) > 0.02


def test_a_peak_between_places_of_the_lattice_is_found() -> None:
    """The lattice's best place is on a hill of 0.93; beside its places stands a peak of 1."""

    class Peaks:
        def values(self, Z: np.ndarray) -> np.ndarray:
            hill = 0.93 - 2.0 * np.abs(Z[:, 2:4] - [-0.24, 0.9]).sum(axis=1)
            return np.maximum(hill, 1.0 - 8.0 * np.abs(Z[:, 2:4] - [-0.3235, 0.851]).sum(axis=1))

        def value_and_gradient(self, z: np.ndarray) -> tuple[float, np.ndarray]:
            return float(self.values(z[None])[0]), np.zeros(5)

    model = SuccessModel(estimator=Peaks(), features=IN_SPACE)  # type: ignore[arg-type]
    chosen = PointingLic(model).select(situation(3))
    assert chosen.probability == pytest.approx(1.0, abs=0.03)


def test_a_translated_situation_has_a_translated_answer() -> None:
    """Board, goal and the range of the base move 0.1 m to the left: so does the answer."""
    clutter = "{{clutter: {{board_centre: [0.53, {0}, 0.89]}}, task: {{stand: {{y_min_m: {1},"
    clutter += " y_max_m: {2}, training_y_m: [{1}]}}}}}}"
    chosen = []
    for shift in (0.0, 0.1):
        scenario = load_scenario(
            "sphere-aperture-clutter", clutter.format(-0.29 + shift, -0.2 + shift, shift)
        )
        starts = make_starts(scenario, scenario.sample_instance("holdout", 0))
        asked = Situation(p_WG=np.array([0.84, -0.2 + shift, 0.9]), starts=starts)
        chosen.append(PointingLic(MODEL).select(asked))
    here, there = chosen
    np.testing.assert_allclose(there.start.x0 - here.start.x0, [0.0, 0.1, *np.zeros(5)], atol=2e-4)
    np.testing.assert_allclose(there.start.b0[:2] - here.start.b0[:2], [0.0, 0.1], atol=2e-4)
    assert there.start.b0[2] == pytest.approx(here.start.b0[2], abs=2e-4)
    assert there.probability == pytest.approx(here.probability, abs=1e-4)


def test_a_further_attempt_goes_through_another_aperture() -> None:
    first = PointingLic(MODEL).select(situation(0))
    failed = FailedReach.from_start(first.start)
    second = PointingLic(MODEL).select(situation(0, failed))
    assert np.linalg.norm(second.start.x0[:3] - first.start.x0[:3]) > 0.19


def test_lic_2_knows_where_the_first_reach_began() -> None:
    features = IN_SPACE
    observed = ("first_start_y", "first_start_z")

    class Away:
        """Likes to begin far from where the first reach began."""

        def values(self, Z: np.ndarray) -> np.ndarray:
            return np.asarray(np.linalg.norm(Z[:, 4:6] - Z[:, 2:4], axis=1))

        def value_and_gradient(self, z: np.ndarray) -> tuple[float, np.ndarray]:
            apart = z[4:6] - z[2:4]
            gradient = np.zeros(7)
            gradient[4:6] = apart / np.linalg.norm(apart)
            gradient[2:4] = -gradient[4:6]
            return float(np.linalg.norm(apart)), gradient

    model = SuccessModel(
        estimator=Away(),  # type: ignore[arg-type]
        features=type(features)(goal=features.goal, start=features.start, observed=observed),
    )
    asked = situation(1)
    p_WA = starts_of(asked).p_WA
    k = 0
    x0 = np.array([*p_WA[k], 1.0, 0.0, 0.0, 0.0])
    shown = dict.fromkeys(SHOWN, 0.0) | {"start_y": x0[1], "start_z": x0[2]}
    failed = FailedReach(start=Start(x0, np.array([0.0, 0.1, 0.2])), shown=shown)
    chosen = PointingLic(MODEL, model).select(situation(1, failed))
    reachable = np.unique(asked.starts.grid.x0[:, :3], axis=0)
    farthest = reachable[np.argmax(np.linalg.norm(reachable - x0[:3], axis=1))]
    np.testing.assert_allclose(chosen.start.x0[:3], farthest)


def test_rnd_draws_among_all_and_cost_takes_the_nearest_aperture_to_the_goal() -> None:
    asked = situation(2)
    rng = np.random.default_rng(0)
    drawn = [RandomSelector(rng=rng).select(asked) for _ in range(60)]
    assert len({tuple(chosen.start.x0[:3]) for chosen in drawn}) >= 8
    assert len({chosen.start.b0[2] for chosen in drawn}) >= 5
    cost = make_selector("cost", BLOCKED.arm())
    assert isinstance(cost, CostSelector)
    chosen = cost.select(asked)
    costs = corridor_cost(asked.starts.grid.x0, asked.p_WG)
    assert corridor_cost(chosen.start.x0[None], asked.p_WG)[0] == pytest.approx(costs.min())
    # Of the same aperture the place that is nearest to where base and torso are.
    same = asked.starts.grid.take(np.isclose(costs, costs.min()))
    here = np.array([0.0, 0.0, BLOCKED.task.torso_m])
    moved = np.linalg.norm(chosen.start.b0 - here)
    assert moved == pytest.approx(np.linalg.norm(same.b0 - here, axis=1).min())


def test_no_place_between_those_of_the_grid_is_better() -> None:
    asked = situation(3)
    starts, selector = starts_of(asked), PointingLic(MODEL)
    chosen = selector.select(asked)
    rng = np.random.default_rng(1)
    stand = starts.stand
    for _ in range(300):
        b0 = np.array(
            [
                0.0,
                rng.uniform(stand.y_min_m, stand.y_max_m),
                rng.uniform(stand.torso_min_m, stand.torso_max_m),
            ]
        )
        found = starts.pre_select(starts.p_WA[rng.integers(len(starts.p_WA))], b0)
        if found is not None:
            at = Starts(found[0][None], b0[None])
            value = selector.objective(asked).values(at)[0]
            assert chosen.probability is not None and chosen.probability > value - 0.01


def test_a_further_attempt_with_lic_2_does_not_begin_where_the_first_one_failed() -> None:
    model = SuccessModel(
        estimator=Blind(),  # type: ignore[arg-type]
        features=replace(IN_SPACE, observed=("first_start_y", "first_start_z")),
    )
    selector = PointingLic(MODEL, model)
    first = selector.select(situation(0))
    shown = dict.fromkeys(SHOWN, 0.0)
    failed = FailedReach(start=first.start, shown=shown)
    second = selector.select(situation(0, failed))
    moved = np.linalg.norm(second.start.b0 - first.start.b0)
    assert np.linalg.norm(second.start.x0[:3] - first.start.x0[:3]) > 0.19 or moved >= RETRY_M
    # As seen again, the aperture is the same one.
    seen = FailedReach(
        start=Start(first.start.x0 + [0, 0.01, *np.zeros(5)], first.start.b0), shown=shown
    )
    at = Starts.of(first.start)
    assert not is_apart(situation(0, seen), at)[0]


class Blind:
    """Estimates with LIC-2's features that do not care for the failed reach."""

    def values(self, Z: np.ndarray) -> np.ndarray:
        return Ridge().values(Z[:, [0, 1, 4, 5, 6]])

    def value_and_gradient(self, z: np.ndarray) -> tuple[float, np.ndarray]:
        value, gradient = Ridge().value_and_gradient(z[[0, 1, 4, 5, 6]])
        whole = np.zeros(7)
        whole[[0, 1, 4, 5, 6]] = gradient
        return value, whole


def test_a_planar_situation_is_refused() -> None:
    plane = load_scenario("cylinder-clutter")
    starts = planar_starts(plane, plane.sample_instance("holdout", 0))
    with pytest.raises(RequestError, match="needs a PR2 before a board"):
        PointingLic(MODEL).select(Situation(p_WG=np.array([0.6, 0.0, 0.0]), starts=starts))


def test_a_robot_that_stays_can_still_choose_its_aperture() -> None:
    instance = SCENARIO.sample_instance("holdout", 0)
    starts = pointing_starts(SCENARIO, instance)
    chosen = PointingLic(MODEL).select(Situation(p_WG=np.array([0.84, -0.2, 0.9]), starts=starts))
    np.testing.assert_array_equal(chosen.start.b0[:2], [0.0, 0.0])
    assert chosen.start.b0[2] == 0.15
