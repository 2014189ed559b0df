import numpy as np
import pytest

from scripts.bounds.choices import Choices, choice_bounds

# Two environments with three and two starts; features are goal, y and phi.
CHOICES = Choices(
    success=np.array([True, False, False, False, True]),
    environment=np.array([0, 0, 0, 1, 1]),
    Z=np.array([[0.6, 0.1, y, 0.0] for y in (0.0, 0.1, 0.2, 0.0, 0.1)]),
)


def test_bounds_of_a_small_example() -> None:
    # The reference likes y = 0 best: right in the first environment, wrong in the second.
    reference = -CHOICES.Z[:, 2]
    rates = {(b.name, b.attempts): b.rate for b in choice_bounds(CHOICES, reference)}
    assert rates["RND", 1] == pytest.approx((1 / 3 + 1 / 2) / 2)
    assert rates["RND", 2] == pytest.approx((2 / 3 + 1) / 2)
    assert rates["best start by more experience, held out", 1] == pytest.approx(0.5)
    assert rates["oracle", 1] == rates["oracle", 2] == 1.0


def test_starts_of_equal_score_share_the_choice() -> None:
    np.testing.assert_allclose(CHOICES.chosen_rate(np.zeros(5)), [1 / 3, 1 / 2])
