"""LIC's selection in the plane: against dense scans and known optima."""

import numpy as np
import pytest
from support.select_surfaces import Bumps, random_bumps, random_model
from support.starts import APERTURES, ARM, LINE, aperture_starts, assert_feasible, dense_scan

from lic_drake.errors import RequestError
from lic_drake.estimate.features import PLANAR_LIC1, features_of
from lic_drake.reach.start import Start, Starts
from lic_drake.select.lic import LicSelector
from lic_drake.select.objective import SuccessModel
from lic_drake.select.situation import FailedReach, Selection, Situation
from lic_drake.starts import LineStarts

GOAL = np.array([0.6, 0.1, 0.0])
FIRST = Situation(p_WG=GOAL, starts=LINE)
SECOND_MODEL = features_of("cylinder-clutter").second
assert SECOND_MODEL is not None


def lic(surface: Bumps) -> LicSelector:
    return LicSelector(SuccessModel(estimator=surface, features=PLANAR_LIC1))


def value_of(selector: LicSelector, situation: Situation, chosen: Selection) -> float:
    """LIC-1's estimate for a choice, from its estimator alone."""
    x0, b0 = chosen.start.x0, chosen.start.b0
    goal = situation.p_WG[:2] - b0[:2]
    return float(selector.first.estimator.values(np.array([[*goal, x0[1] - b0[1], x0[2]]]))[0])


def best_of_dense_scan(selector: LicSelector, situation: Situation) -> float:
    assert isinstance(situation.starts, LineStarts)
    scan = dense_scan(situation.starts)
    return float(selector.objective(situation).values(scan.take(situation.allowed(scan))).max())


def failed_at(
    x0: np.ndarray, final: tuple[float, float] = (0.45, 0.05), b0: np.ndarray | None = None
) -> FailedReach:
    """A failure that began at x0 and ended with the hand at `final`."""
    known = FailedReach.from_start(Start(x0, np.zeros(3) if b0 is None else b0))
    names = ("final_x", "final_y", "final_phi", "final_vx", "final_vy")
    shown = dict(zip(names, (*final, 0.3, 0.01, -0.02), strict=True))
    return FailedReach(start=known.start, shown={**known.shown, **shown})


# A fixed base in the plane


def test_peak_inside_the_feasible_set_is_found_exactly() -> None:
    peak = np.array([0.013, 1.0])
    chosen = lic(Bumps(peak[None], np.array([0.9]), np.array([0.2, 0.6]))).select(FIRST)
    np.testing.assert_allclose(chosen.start.x0[1:], peak, atol=1e-3)
    assert chosen.probability == pytest.approx(0.9, abs=1e-5)


def test_peak_that_the_arm_cannot_take_gives_the_best_start_at_the_joint_limits() -> None:
    # A hand at y = 0.3 m cannot point straight ahead: phi must be at least 52 degrees there.
    selector = lic(Bumps(np.array([[0.3, 0.0]]), np.array([0.9]), np.array([0.1, 0.4])))
    chosen = selector.select(FIRST)
    assert chosen.probability is not None and chosen.start.q is not None
    assert chosen.probability >= 0.99 * best_of_dense_scan(selector, FIRST)
    margin = np.min(np.minimum(chosen.start.q - ARM.q_min, ARM.q_max - chosen.start.q))
    assert 0.0 <= margin + 1e-9 < np.deg2rad(2.0)


@pytest.mark.parametrize("seed", range(6))
def test_selection_matches_a_dense_scan_and_beats_every_grid_start(seed: int) -> None:
    selector = lic(random_bumps(seed))
    chosen = selector.select(FIRST)
    value = value_of(selector, FIRST, chosen)
    assert value >= selector.objective(FIRST).values(LINE.grid).max() - 1e-8
    assert value >= 0.99 * best_of_dense_scan(selector, FIRST)
    assert chosen.probability == pytest.approx(min(value, 1.0), abs=1e-12)
    assert_feasible(LINE, chosen.start)


@pytest.mark.parametrize(
    ("seed", "failed_y", "nearest"),
    [(0, [], 0.1), (1, [], 0.1), (0, np.arange(-0.34, 0.4, 0.1), 0.05)],
)
def test_a_further_selection_keeps_away_from_failures_and_is_the_best_there(
    seed: int, failed_y: np.ndarray, nearest: float
) -> None:
    # Where failures leave no start at a distance a nearer one is chosen.
    selector = lic(random_bumps(seed))
    starts = [Start(np.array([0.335, y, 1.0])) for y in failed_y] or [selector.select(FIRST).start]
    failed = tuple(map(FailedReach.from_start, starts))
    situation = Situation(p_WG=GOAL, starts=LINE, failed=failed)
    chosen = selector.select(situation)
    assert min(abs(chosen.start.x0[1] - start.x0[1]) for start in starts) > nearest
    value = value_of(selector, situation, chosen)
    assert value >= 0.99 * best_of_dense_scan(selector, situation)


def test_a_start_just_beside_what_failed_is_none_to_improve() -> None:
    # The grid's last start, y = -0.4 m, is one retry distance and a hair from the failed one.
    failed = FailedReach.from_start(Start(np.array([0.335, -0.3 + 1e-7, 0.0])))
    situation = Situation(p_WG=GOAL, starts=LINE, failed=(failed,))
    peak = random_bumps(0)
    peak.centres[:] = [-0.4, -0.3]
    chosen = lic(peak).select(situation)
    assert abs(chosen.start.x0[1] + 0.3) > 0.1


def test_selection_without_a_start_left_is_refused() -> None:
    every = LINE.grid.join(LINE.lattice(np.zeros(0)))
    failed = tuple(FailedReach.from_start(start) for start in every)
    with pytest.raises(RequestError, match="no start is left"):
        lic(random_bumps(0)).select(Situation(p_WG=GOAL, starts=LINE, failed=failed))


# Apertures and a mobile base in the plane


@pytest.mark.parametrize("seed", [0, 1, 3])
def test_at_apertures_the_choice_matches_a_dense_scan_over_aperture_angle_and_base(
    seed: int,
) -> None:
    selector = LicSelector(random_model(seed))
    situation = Situation(p_WG=np.array([0.65, 0.2 - 0.1 * seed, 0.0]), starts=APERTURES)
    chosen = selector.select(situation)
    assert_feasible(APERTURES, chosen.start)
    value = value_of(selector, situation, chosen)
    assert value >= 0.99 * best_of_dense_scan(selector, situation)
    assert chosen.probability == pytest.approx(min(value, 1.0), abs=1e-12)


def test_a_track_that_ends_early_bounds_the_base() -> None:
    # The surface wants the hand 0.3 m to the right of the base, which the track's end forbids.
    starts = aperture_starts([-0.35, 0.05, 0.52])
    assert starts.track is not None
    starts.track.y_max_m = 0.1
    selector = lic(Bumps(np.array([[-0.3, 0.2]]), np.array([0.9]), np.array([0.2, 0.5])))
    situation = Situation(p_WG=GOAL, starts=starts)
    chosen = selector.select(situation)
    assert_feasible(starts, chosen.start)
    assert value_of(selector, situation, chosen) >= 0.99 * best_of_dense_scan(selector, situation)


@pytest.mark.parametrize("after_failure", [False, True])
def test_a_translated_situation_has_the_translated_answer_and_the_same_estimate(
    after_failure: bool,
) -> None:
    # Equation (3): only where things are relative to each other counts.
    second = random_model(8, SECOND_MODEL)
    selector = LicSelector(random_model(7), second if after_failure else None)

    def choose(dx: float, dy: float) -> Selection:
        x0, b0 = np.array([0.335 + dx, 0.05 + dy, 0.2]), np.array([dx, dy, 0.0])
        failed = failed_at(x0, (0.5 + dx, 0.1 + dy), b0)
        return selector.select(
            Situation(
                p_WG=GOAL + [dx, dy, 0.0],
                starts=aperture_starts([-0.35, 0.05, 0.52], (dx, dy)),
                failed=(failed,) if after_failure else (),
            )
        )

    here = choose(0.0, 0.0)
    for offset in ((0.0, 0.7), (3.0, -20.0)):
        there = choose(*offset)
        assert there.probability == pytest.approx(here.probability, abs=1e-6)
        np.testing.assert_allclose(there.start.x0 - [*offset, 0.0], here.start.x0, atol=2e-3)
        np.testing.assert_allclose(there.start.b0 - [*offset, 0.0], here.start.b0, atol=2e-3)


# LIC-2


@pytest.mark.parametrize("starts", [LINE, APERTURES], ids=["line", "apertures"])
def test_lic2_takes_the_best_of_all_starts_after_what_the_failure_showed(
    starts: LineStarts,
) -> None:
    selector = LicSelector(random_model(1), random_model(2, SECOND_MODEL))
    assert selector.second is not None
    answers = []
    for final in ((0.4, -0.2), (0.7, 0.3)):
        failed = failed_at(starts.grid.x0[9], final, starts.grid.b0[9])
        situation = Situation(p_WG=GOAL, starts=starts, failed=(failed,))
        chosen = selector.select(situation)
        assert_feasible(starts, chosen.start)
        base = chosen.start.b0[:2]
        x = [
            *(GOAL[:2] - base),
            *(failed.start.x0[1] - base[1], failed.start.x0[2]),
            *(np.array(final) - base),
            *(chosen.start.x0[1] - base[1], chosen.start.x0[2]),
        ]
        value = float(selector.second.estimator.values(np.array([x]))[0])
        assert chosen.probability == pytest.approx(min(value, 1.0), abs=1e-9)
        assert value >= 0.99 * selector.objective(situation).values(dense_scan(starts)).max()
        answers.append(chosen)
    # What it saw made a difference.
    assert answers[0].probability != answers[1].probability


def test_lic2_may_start_where_the_first_reach_did() -> None:
    # Its estimate is highest just there, whatever it observes.
    peak = np.array([[0.05, 0.9]])
    surface = Bumps(peak, np.array([0.9]), np.array([0.1, 0.3]))
    second = SuccessModel(estimator=surface, features=SECOND_MODEL)
    selector = LicSelector(random_model(1), second)
    situation = Situation(p_WG=GOAL, starts=LINE, failed=(failed_at(np.array([0.335, 0.05, 0.9])),))
    np.testing.assert_allclose(selector.select(situation).start.x0[1:], peak[0], atol=2e-3)


def test_a_failure_that_never_began_leaves_lic1_away_from_it() -> None:
    selector = LicSelector(random_model(1), random_model(2, SECOND_MODEL))
    alone = LicSelector(random_model(1))
    first = alone.select(FIRST)
    failed = failed_at(first.start.x0, (np.nan, np.nan))
    situation = Situation(p_WG=GOAL, starts=LINE, failed=(failed,))
    chosen = selector.select(situation)
    assert abs(chosen.start.x0[1] - first.start.x0[1]) > 0.1
    assert chosen.start == alone.select(situation).start
    assert chosen.probability == alone.select(situation).probability


def test_after_several_failures_the_choice_maximises_the_smallest_of_their_estimates() -> None:
    second = random_model(4, SECOND_MODEL)
    selector = LicSelector(random_model(1), second)
    failed = (
        failed_at(np.array([0.335, -0.2, 0.5]), (0.4, -0.2)),
        failed_at(np.array([0.335, 0.2, 1.2]), (0.7, 0.3)),
        failed_at(np.array([0.335, 0.0, 0.9]), (0.55, 0.0)),
    )
    chosen = selector.select(Situation(p_WG=GOAL, starts=LINE, failed=failed))

    def smallest(some: Starts) -> np.ndarray:
        estimates = []
        for reach in failed:
            seen = [*reach.start.x0[1:], reach.shown["final_x"], reach.shown["final_y"]]
            X = np.column_stack([np.tile([*GOAL[:2], *seen], (len(some), 1)), some.x0[:, 1:]])
            estimates.append(second.estimator.values(X))
        return np.min(estimates, axis=0)

    value = smallest(Starts.of(chosen.start))[0]
    assert chosen.probability == pytest.approx(min(value, 1.0), abs=1e-12)
    assert value >= 0.99 * smallest(dense_scan(LINE)).max()
