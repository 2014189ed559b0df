import numpy as np
import pytest
from support.starts import APERTURES, LINE

from lic_drake.reach.start import Start, Starts
from lic_drake.starts import Region, find_regions

ROLL = (np.array([0.0, -1.0, 0.0, 0.0]), np.array([1.0, 1.0, 0.0, 0.0]))
APERTURE = Region(
    lower=np.array([0.5, 0.1, 0.9, *ROLL[0]]),
    upper=np.array([0.5, 0.1, 0.9, *ROLL[1]]),
    b0_lower=np.array([0.0, -0.3, 0.0]),
    b0_upper=np.array([0.0, 0.3, 0.3]),
)


def test_clipping_in_space_keeps_a_unit_quaternion_about_x() -> None:
    tilted = np.array([0.5001, 0.1, 0.9, 0.6, 0.8, 1e-3, -1e-3])
    x0, b0 = APERTURE.clip(tilted, np.array([1e-4, 0.5, -0.1]))
    np.testing.assert_allclose(x0, [0.5, 0.1, 0.9, 0.6, 0.8, 0.0, 0.0], atol=1e-6)
    assert np.linalg.norm(x0[3:]) == pytest.approx(1.0, abs=1e-15)
    np.testing.assert_array_equal(b0, [0.0, 0.3, 0.0])
    assert APERTURE.holds(x0, b0) and not APERTURE.holds(tilted, b0)


def test_the_cone_holds_the_directions_of_the_region() -> None:
    direction, angle = APERTURES.regions[0].cone
    np.testing.assert_allclose(direction, [1.0, 0.0, 0.0])
    assert angle == pytest.approx(np.deg2rad(45.0))
    direction, angle = APERTURE.cone
    np.testing.assert_allclose(direction, [1.0, 0.0, 0.0])
    assert angle == 0.0


@pytest.mark.parametrize("failed_y", [[], [0.1], [-0.4, 0.0], [0.39, 0.41], [-0.9]])
def test_a_line_without_the_neighbourhood_of_failures(failed_y: list[float]) -> None:
    failed = [Start(np.array([0.335, y, 0.5])) for y in failed_y]
    (line,) = LINE.regions
    parts = line.away_from(failed, 0.1)
    for y in np.linspace(-0.4, 0.4, 321) + 1e-5:
        x0 = np.array([0.335, y, 0.0])
        free = all(abs(y - other) >= 0.1 for other in failed_y) and y <= 0.4
        assert any(part.holds(x0, np.zeros(3), 0.0) for part in parts) == free


def test_each_start_is_found_in_its_region() -> None:
    grid = APERTURES.grid
    found = find_regions(APERTURES.regions, grid)
    assert set(found) == {0, 1, 2}
    for k, start in zip(found, grid, strict=True):
        np.testing.assert_allclose(APERTURES.regions[k].lower[:2], start.x0[:2])
    beside = Starts(grid.x0 + [0.0, 0.01, 0.0], grid.b0)
    assert np.all(find_regions(APERTURES.regions, beside) == -1)
