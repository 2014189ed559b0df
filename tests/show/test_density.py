import numpy as np
import pytest
from support.select_surfaces import random_model
from support.starts import APERTURES, ARM, LINE

from lic_drake.reach.starts import ApertureStarts, LineStarts
from lic_drake.select.planar_lic import PlanarLic
from lic_drake.select.situation import Situation
from lic_drake.show.density import DENSITY_SHAPE, density_lattice, estimate_density

GOAL = np.array([0.6, 0.1, 0.0])


@pytest.mark.parametrize("starts", [LINE, APERTURES], ids=["line", "apertures"])
def test_a_density_covers_the_line_relative_to_the_base_in_every_region(
    starts: LineStarts | ApertureStarts,
) -> None:
    line = starts.poses.line
    for region in starts.regions:
        conditions, shape = density_lattice(starts, region)
        assert shape == DENSITY_SHAPE
        y, phi = (conditions.in_R[:, i].reshape(shape) for i in (1, 2))
        np.testing.assert_allclose(
            y, np.linspace(line.y_min_m, line.y_max_m, shape[0])[:, None] + 0 * y, atol=1e-12
        )
        degrees = np.linspace(line.phi_min_deg, line.phi_max_deg, shape[1])
        np.testing.assert_allclose(np.rad2deg(phi), degrees + 0 * phi, atol=1e-9)
        np.testing.assert_allclose(conditions.in_R[:, 0], line.x_m, atol=1e-12)
        if starts is APERTURES:
            np.testing.assert_allclose(conditions.x0[:, :2] - region.lower[:2], 0.0, atol=1e-12)
        else:
            assert not np.any(conditions.p_WR)


@pytest.mark.parametrize("starts", [LINE, APERTURES], ids=["line", "apertures"])
def test_estimates_are_the_models_where_the_arm_can_start(
    starts: LineStarts | ApertureStarts,
) -> None:
    model = random_model(3)
    selector = PlanarLic(ARM, model)
    conditions, _ = density_lattice(starts, starts.regions[0])
    some = conditions.take(np.arange(0, len(conditions), 97))
    density = estimate_density(selector, Situation(p_WG=GOAL, starts=starts), some)
    possible = 0
    for x0, p_WR, value in zip(some.x0, some.p_WR, density, strict=True):
        if ARM.solve_ik(x0 - [*p_WR, 0.0]) is None:
            assert np.isnan(value)
            continue
        possible += 1
        z = np.array([[*(GOAL[:2] - p_WR), x0[1] - p_WR[1], x0[2]]])
        expected = np.clip(model.estimator.values(z)[0], 0.0, 1.0)
        assert value == pytest.approx(expected, abs=1e-12)
    assert 10 < possible < len(some.x0)
