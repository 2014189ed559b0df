"""Settings of a Gaussian process that is conditioned on local rows."""

from itertools import product

import numpy as np
from threadpoolctl import threadpool_limits

from lic_drake.estimate.gaussian_process import GaussianProcess
from lic_drake.estimate.likelihood import Hyperparameters
from lic_drake.estimate.local import Neighbourhoods

# Decay over a length scale, and noise variance of a reach relative to the variance of all.
_DECAYS = (0.06, 0.12, 0.25, 0.5)
_NOISES = (0.03, 0.12, 0.5, 2.0, 8.0)
_NUM_TASKS = 20
_TASK_ROWS = 300
_TASK_QUERIES = 20


def choose_process(near: Neighbourhoods, *, average: bool = True) -> GaussianProcess:
    """Returns a process with the settings that best predict local rows held out.

    The scales of the features relative to each other are those by which rows are near. Left are
    how fast the correlation decays and how noisy a reach is: taken are those with the least squared
    error at 20 random situations whose environments are held out, each predicted from the 300
    nearest rows of other environments. The marginal likelihood, for which the rows of a part of
    the library serve, takes repeated outcomes in one environment as independent evidence: with D2
    its scales differed a hundredfold from part to part.

    Args:
        near: The library.
        average: See `GaussianProcess`.
    """
    variance = max(float(np.var(near.f)), 1e-4)
    candidates = [
        GaussianProcess(
            average=average,
            hyperparameters=Hyperparameters(
                theta=decay / near.length_scale,
                signal_variance=variance,
                noise_floor=0.0,
                reach_variance=noise * variance,
            ),
        )
        for decay, noise in product(_DECAYS, _NOISES)
    ]
    error = np.zeros(len(candidates))
    with threadpool_limits(limits=1, user_api="blas"):
        for i in range(min(_NUM_TASKS, len(near.f))):
            here = near.environment == near.environment[i]
            if np.all(here):
                break
            centre = near.in_scales(near.Z[i])
            seen = near.nearest(centre, _TASK_ROWS, ~here)
            asked = near.nearest(centre, _TASK_QUERIES, here)
            for k, candidate in enumerate(candidates):
                process = candidate.conditioned_on(near.Z[seen], near.f[seen])
                error[k] += np.sum((process.values(near.Z[asked]) - near.f[asked]) ** 2)
    return candidates[int(np.argmin(error))]
