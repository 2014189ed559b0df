from typing import Any

import numpy as np
import pytest

from lic_drake.clutter.board import ApertureBoard
from lic_drake.clutter.foliage import FoliageApertureClutter
from lic_drake.clutter.sphere import SphereApertureClutter
from lic_drake.errors import ScenarioError


def test_spheres_and_foliage_stand_behind_the_same_kind_of_board() -> None:
    board, spheres, foliage = ApertureBoard(), SphereApertureClutter(), FoliageApertureClutter()
    for other in (spheres, foliage):
        np.testing.assert_array_equal(other.aperture_centres(), board.aperture_centres())
        for ours, theirs in zip(board.bar_boxes(), other.bar_boxes(), strict=True):
            np.testing.assert_array_equal(ours, theirs)


def test_bars_leave_square_openings_around_the_aperture_centres() -> None:
    board = ApertureBoard(columns=3, rows=2, aperture_m=0.3, bar_m=0.04)
    p_WB, edges = board.bar_boxes()
    assert len(p_WB) == 4 + 3
    for p_WA in board.aperture_centres():
        for direction in (np.eye(3)[1], -np.eye(3)[1], np.eye(3)[2], -np.eye(3)[2]):
            for along, inside in ((0.129, False), (0.131, True), (0.169, True)):
                p_WQ = p_WA + along * direction
                hit = np.any(np.all(np.abs(p_WQ - p_WB) <= 0.5 * edges, axis=1))
                assert hit == inside


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"rows": 21}, "rows must be from 1 to 20, got 21"),
        ({"bar_m": -1.0}, "bar_m must be a positive number, got -1"),
        ({"bar_m": 0.2}, "leave nothing of apertures"),
        ({"board_centre": [0.0, float("nan"), 0.0]}, r"board_centre must be \[x, y, z\]"),
        ({"num_blocked": 20}, "must leave one of 20 apertures open"),
    ],
)
def test_values_that_make_no_sense_are_refused(values: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        ApertureBoard(**values)
