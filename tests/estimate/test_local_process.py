import numpy as np
import pytest

from lic_drake.estimate.averaging import average_rows
from lic_drake.estimate.local import Neighbourhoods
from lic_drake.estimate.local_process import choose_process


def _near(Z, f, environment, length_scale) -> Neighbourhoods:
    order = np.random.default_rng(0).permutation(len(f))
    return Neighbourhoods(
        Z=Z[order],
        f=f[order],
        environment=environment[order],
        weight=np.ones(len(f)),
        situation=slice(0, 2),
        length_scale=np.asarray(length_scale),
    )


def test_scales_relative_to_each_other_are_those_of_the_neighbourhoods(scattered) -> None:
    length_scale = np.array([0.1, 0.2, 0.05, 0.4])
    process = choose_process(
        _near(scattered.Z, scattered.f, scattered.environment, length_scale), average=False
    )
    decay = process.hyperparameters.theta * length_scale
    np.testing.assert_allclose(decay, decay[0])
    assert not process.average


def test_a_surface_without_chance_gets_less_noise_than_coin_tosses(world) -> None:
    grid = world.grid()
    Z, environment = np.tile(grid, (6, 1)), np.repeat(np.arange(6), len(grid))
    sure = (world.probability(Z) > 0.5).astype(float)
    coins = (np.random.default_rng(0).random(len(Z)) < 0.5).astype(float)
    scale = [0.1, 0.1, 0.1, 0.3]
    noise = {
        name: choose_process(_near(Z, f, environment, scale)).hyperparameters
        for name, f in (("sure", sure), ("coins", coins))
    }
    assert noise["sure"].reach_variance < 0.01
    assert noise["coins"].reach_variance > 1.0


def test_outcomes_repeated_within_environments_are_not_taken_for_evidence(world) -> None:
    """As in D2, where the same second reaches follow every failed first one."""
    library = world.library(environments=4)
    Z, f = np.tile(library.Z, (5, 1)), np.tile(library.f, 5)
    environment = np.tile(library.environment, 5)
    process = choose_process(_near(Z, f, environment, [0.1, 0.1, 0.1, 0.3]))
    rows = average_rows(library.Z, library.f)
    single = choose_process(_near(library.Z, library.f, library.environment, [0.1, 0.1, 0.1, 0.3]))
    truth = world.probability(rows.Z)
    error = [
        np.mean((p.conditioned_on(*data).values(rows.Z) - truth) ** 2)
        for p, data in ((process, (Z, f)), (single, (library.Z, library.f)))
    ]
    assert error[0] < 2.0 * error[1] < 0.5 * np.var(truth)


@pytest.mark.parametrize("outcome", [0.0, 1.0])
def test_if_every_reach_ends_alike_that_is_the_estimate(scattered, outcome: float) -> None:
    f = np.full(60, outcome)
    process = choose_process(_near(scattered.Z, f, scattered.environment, np.ones(4)))
    values = process.conditioned_on(scattered.Z, f).values(scattered.Z[:5] + 0.1)
    np.testing.assert_allclose(values, outcome, atol=1e-9)


def test_a_single_environment_leaves_nothing_to_hold_out(scattered) -> None:
    near = _near(scattered.Z, scattered.f, np.zeros(60), np.ones(4))
    assert choose_process(near).hyperparameters.reach_variance > 0.0
