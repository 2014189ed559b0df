"""What the PR2's skin feels, and what it does not."""

import numpy as np
import pytest
from support.pr2_reaches import ARM, SCENARIO, felt, spheres

from lic_drake.control.taxels import make_taxels
from lic_drake.robots.pr2 import Q_HOME

LAYOUT = make_taxels(ARM, SCENARIO.scene.taxels_per_m)


# The middles of faces that nothing covers: upper arm, forearm and hand.
PLACES = {
    "r_upper_arm_roll_link": ([0.29, 0.0, -0.0815], [0.0, 0.0, -1.0]),
    "r_forearm_roll_link": ([0.236, 0.0, -0.0445], [0.0, 0.0, -1.0]),
    "r_wrist_roll_link": ([0.1885, 0.0, 0.0], [1.0, 0.0, 0.0]),
}


@pytest.mark.parametrize("name", PLACES)
def test_a_contact_is_felt_where_it_is_and_nowhere_else(name: str) -> None:
    link = ARM.link_names.index(name)
    p_LT, n_L = map(np.array, PLACES[name])
    # A fixed sphere, 3 mm deep in the skin.
    R_RL, p_RL = ARM.calc_pose(Q_HOME)[:2]
    centre = p_RL[link] + R_RL[link] @ (p_LT + (0.05 - 3e-3) * n_L)
    _, force = felt(spheres(centre, radius=0.05), Q_HOME)
    loaded = np.flatnonzero(force)
    assert len(loaded) >= 1
    assert set(LAYOUT.link[loaded]) == {link}
    strongest = np.argmax(force)
    np.testing.assert_allclose(LAYOUT.n_L[strongest], n_L, atol=1e-9)
    assert np.linalg.norm(LAYOUT.p_LT[strongest] - p_LT) < 1.5 * LAYOUT.pitch_m


def test_the_arm_does_not_feel_the_robots_own_body() -> None:
    rng = np.random.default_rng(0)
    touching = 0
    made, force = felt(spheres(), Q_HOME)
    assert not np.any(force)
    context = made.diagram.CreateDefaultContext()
    results = made.scene.plant.get_contact_results_output_port()
    for _ in range(40):
        q = rng.uniform(ARM.q_min, ARM.q_max)
        made.set_start(context, q, np.zeros(3))
        contacts = results.Eval(made.scene.plant.GetMyContextFromRoot(context))
        touching += contacts.num_point_pair_contacts() + contacts.num_hydroelastic_contacts() > 0
        assert not np.any(made.diagram.GetOutputPort("taxel_force").Eval(context))
    assert touching >= 2
