import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from support.select_surfaces import random_model
from support.starts import APERTURES, ARM, LINE

from lic_drake.reach.start import Start
from lic_drake.select.lic import LicSelector
from lic_drake.select.situation import Situation
from lic_drake.show.density import DENSITY_SHAPE, density_lattice, draw_density, estimate_density
from lic_drake.show.figures import ATTEMPT_COLORS
from lic_drake.starts import LineStarts

GOAL = np.array([0.6, 0.1, 0.0])


@pytest.mark.parametrize("starts", [LINE, APERTURES], ids=["line", "apertures"])
def test_a_lattice_covers_the_line_relative_to_the_base_in_every_region(
    starts: LineStarts,
) -> None:
    line = starts.line
    for region in starts.regions:
        lattice = density_lattice(starts, region)
        y, phi = (lattice.in_R[:, i].reshape(DENSITY_SHAPE) for i in (1, 2))
        np.testing.assert_allclose(
            y, np.linspace(line.y_min_m, line.y_max_m, len(y))[:, None] + 0 * y, atol=1e-12
        )
        degrees = np.linspace(line.phi_min_deg, line.phi_max_deg, DENSITY_SHAPE[1])
        np.testing.assert_allclose(np.rad2deg(phi), degrees + 0 * phi, atol=1e-9)
        np.testing.assert_allclose(lattice.in_R[:, 0], line.x_m, atol=1e-12)
        if starts is APERTURES:
            np.testing.assert_allclose(lattice.x0[:, :2] - region.lower[:2], 0.0, atol=1e-12)
        else:
            assert not np.any(lattice.b0)


@pytest.mark.parametrize("starts", [LINE, APERTURES], ids=["line", "apertures"])
def test_estimates_are_the_models_where_the_arm_can_start(
    starts: LineStarts,
) -> None:
    model = random_model(3)
    selector = LicSelector(model)
    lattice = density_lattice(starts, starts.regions[0])
    some = lattice.take(np.arange(0, len(lattice), 97))
    density = estimate_density(selector, Situation(p_WG=GOAL, starts=starts), some)
    feasible = 0
    for start, value in zip(some, density, strict=True):
        if len(ARM.solve_ik(start.x0_R)) == 0:
            assert np.isnan(value)
            continue
        feasible += 1
        z = np.array([[*(GOAL - start.b0)[:2], *start.x0_R[1:]]])
        expected = np.clip(model.estimator.values(z)[0], 0.0, 1.0)
        assert value == pytest.approx(expected, abs=1e-12)
    assert 10 < feasible < len(some)


def test_a_density_shows_each_estimate_at_its_y_and_phi_and_the_choice() -> None:
    ax = Figure().subplots()
    lattice = density_lattice(LINE, LINE.regions[0])
    probability = 0.5 + 0.5 * lattice.x0[:, 1] + 0.1 * lattice.x0[:, 2]
    probability[3] = np.nan
    chosen = Start(np.array([0.335, -0.21, 1.2]))
    assert draw_density(ax, lattice, probability, chosen, 2) is ax
    (mesh,) = [item for item in ax.collections if isinstance(item, QuadMesh)]
    np.testing.assert_allclose(np.ma.filled(mesh.get_array(), np.nan).ravel(), probability)
    assert (mesh.norm.vmin, mesh.norm.vmax) == (0.0, 1.0)
    # Each start lies in the middle of its cell.
    corners = mesh.get_coordinates()
    centres = 0.25 * (corners[1:, 1:] + corners[1:, :-1] + corners[:-1, 1:] + corners[:-1, :-1])
    np.testing.assert_allclose(centres.reshape(-1, 2), lattice.x0[:, 1:], atol=1e-9)
    (star,) = ax.lines
    np.testing.assert_allclose(star.get_xydata(), [[-0.21, 1.2]])
    assert (star.get_color(), star.get_label()) == (ATTEMPT_COLORS[1], "attempt 2")
    assert ax.get_xlabel() == "start position y [m]"
