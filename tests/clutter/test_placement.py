import numpy as np
import pytest
from scipy.spatial.distance import pdist

from lic_drake.clutter.placement import place_discs
from lic_drake.errors import ScenarioError

LOWER, UPPER = np.zeros(2), np.ones(2)


def test_the_wanted_distance_is_kept_where_it_binds() -> None:
    p = place_discs(np.random.default_rng(0), 60, LOWER, UPPER, 0.08)
    distances = pdist(p)
    assert distances.min() >= 0.08
    # Without the rule 60 points in the unit square would have about 36 pairs nearer than this.
    free = np.random.default_rng(0).uniform(size=(60, 2))
    assert np.count_nonzero(pdist(free) < 0.08) > 15


def test_discs_are_drawn_one_after_the_other_so_more_of_them_keep_the_first() -> None:
    few = place_discs(np.random.default_rng(5), 10, LOWER, UPPER, 0.05)
    many = place_discs(np.random.default_rng(5), 40, LOWER, UPPER, 0.05)
    np.testing.assert_array_equal(few, many[:10])


def test_no_disc_at_all_is_fine() -> None:
    assert place_discs(np.random.default_rng(0), 0, LOWER, UPPER, 10.0).shape == (0, 2)


def test_one_disc_fits_where_a_second_does_not() -> None:
    assert place_discs(np.random.default_rng(0), 1, LOWER, UPPER, 2.0).shape == (1, 2)
    with pytest.raises(
        ScenarioError, match=r"only 1 of 2 objects fit into 1 m\^2 at a distance of 2 m"
    ):
        place_discs(np.random.default_rng(0), 2, LOWER, UPPER, 2.0)
