import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from lic_drake.reach.pointing_starts import pointing_starts
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.start import Starts
from lic_drake.select.objective import Objective
from lic_drake.show.aperture_map import draw_aperture_map, estimate_apertures

BLOCKED = load_scenario("sphere-aperture-clutter", "{clutter: {num_blocked: 6}}")
STARTS = pointing_starts(BLOCKED, BLOCKED.sample_instance("holdout", 0))


class HeightAlone(Objective):
    """Estimates that are the height of the tool, beyond 1 for the highest."""

    def values(self, conditions: Starts) -> np.ndarray:
        return conditions.x0[:, 2]


def test_the_estimate_of_an_aperture_is_the_best_from_there_as_a_probability() -> None:
    objective = HeightAlone(model=None, p_WG=np.zeros(3))  # type: ignore[arg-type]
    best = estimate_apertures(objective, STARTS)
    reachable = np.array(
        [np.any(np.all(np.isclose(STARTS.grid.x0[:, :3], p), axis=1)) for p in STARTS.p_WA]
    )
    np.testing.assert_allclose(best[reachable], np.clip(STARTS.p_WA[reachable, 2], 0.0, 1.0))
    assert np.all(np.isnan(best[~reachable]))


def test_open_apertures_show_numbers_and_blocked_ones_are_hatched() -> None:
    ax = Figure().subplots()
    probability = np.linspace(0.1, 0.8, len(STARTS.p_WA))
    draw_aperture_map(
        ax,
        STARTS.p_WA,
        probability,
        STARTS.all_apertures,
        STARTS.aperture_m,
        np.array([0.84, -0.1, 0.8]),
        [("attempt 1", STARTS.p_WA[3])],
    )
    texts = [text.get_text() for text in ax.texts]
    assert sum(text.endswith("%") for text in texts) == 14
    assert f"{100 * probability[3]:.0f} %" in texts
    assert "attempt 1" in texts
    hatched = [p for p in ax.patches if isinstance(p, Rectangle) and p.get_hatch()]
    assert len(hatched) == 6
    assert ax.xaxis_inverted()  # The robot's left is on the left.
