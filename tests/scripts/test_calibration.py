import numpy as np
import pytest
from scipy.stats import chi2_contingency

from lic_drake.evaluate.statistics import Count
from lic_drake.reach.scenario import load_scenario
from scripts.calibration.run import likelihood_ratio, out_of_reach


def test_the_likelihood_ratio_is_that_of_a_contingency_table() -> None:
    ours, paper = Count(305, 500), Count(1220, 2000)
    table = [[c.successes, c.trials - c.successes] for c in (ours, Count(350, 500))]
    expected = chi2_contingency(table, correction=False, lambda_="log-likelihood").statistic
    assert likelihood_ratio(ours, Count(350, 500)) == pytest.approx(expected)
    assert likelihood_ratio(ours, paper) == pytest.approx(0.0, abs=1e-9)
    assert likelihood_ratio(Count(0, 20), Count(0, 50)) == 0.0


def test_goals_beyond_the_arm_are_out_of_reach() -> None:
    scenario = load_scenario("cylinder-clutter")
    x, y = np.meshgrid(np.linspace(0.41, 0.81, 401), np.linspace(-0.4, 0.4, 801))
    area = np.mean(np.hypot(x, y) > 0.818 + 0.015)
    assert out_of_reach(scenario, 100, 20) == pytest.approx(area, abs=0.02)
    assert area < 0.05
    assert out_of_reach(load_scenario("cylinder-aperture-clutter"), 200, 1) == 0.0
