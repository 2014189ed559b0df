from dataclasses import replace

import numpy as np

from lic_drake.reach.pointing_starts import pointing_starts
from lic_drake.reach.scenario import load_scenario
from lic_drake.select.pointing_places import LATTICE_M, find_neighbours, make_lattice

SCENARIO = load_scenario("sphere-aperture-clutter")


def test_a_lattice_has_where_the_aperture_was_one_of_a_collection() -> None:
    assert SCENARIO.task.stand is not None
    stand = replace(SCENARIO.task.stand, training_y_m=[0.013], training_torso_m=[0.11])
    starts = pointing_starts(SCENARIO, SCENARIO.sample_instance("holdout", 0), stand)
    p_WA = starts.p_WA[0]
    places = make_lattice(starts, np.array([*p_WA, 1.0, 0.0, 0.0, 0.0]))
    for learned in starts.all_apertures:
        b0 = p_WA - learned + [0.0, 0.013, 0.11]
        inside = abs(b0[1]) <= 0.3 and stand.torso_min_m <= b0[2] <= stand.torso_max_m
        assert np.any(np.all(np.isclose(places.b0, b0), axis=1)) == inside
    for values in places.b0.T[1:]:
        assert 0.0 < np.diff(np.unique(values)).max() <= LATTICE_M + 1e-6
    np.testing.assert_allclose(places.b0.min(axis=0), [0.0, stand.y_min_m, stand.torso_min_m])
    np.testing.assert_allclose(places.b0.max(axis=0), [0.0, stand.y_max_m, stand.torso_max_m])


def test_neighbours_are_on_the_stand_and_each_is_there_once() -> None:
    stand = SCENARIO.task.stand
    starts = pointing_starts(SCENARIO, SCENARIO.sample_instance("holdout", 0), stand)
    lattice = make_lattice(starts, np.array([*starts.p_WA[0], 1.0, 0.0, 0.0, 0.0]))
    corner = np.isclose(lattice.torso_m, 0.2) & (lattice.p_WR[:, 1] < -0.29)
    found = find_neighbours(starts.stand, lattice.take(corner), 0.025)
    expected = [[y, z] for y in (-0.3, -0.275) for z in (0.175, 0.2, 0.225)]
    np.testing.assert_allclose(found.b0[:, 1:], expected)
