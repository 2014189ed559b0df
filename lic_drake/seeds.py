"""Named seed streams, the only source of randomness in the package.

Environments for training, evaluation, calibration and hold-out come from different streams, so that
no library contains an evaluation environment.
"""

import zlib

import numpy as np

from lic_drake.errors import RequestError

STREAMS = ("training", "evaluation", "calibration", "holdout", "imagination")
"""Names of the environment streams; the last one is what a strategy imagines."""


def make_generator(stream: str, purpose: str, *indices: int) -> np.random.Generator:
    """Returns the generator for a (stream, purpose, indices) combination.

    Args:
        stream: One of `STREAMS`.
        purpose: What is sampled, such as a clutter category or "goal".
        indices: Integers from 0 to 2^32 - 1; always equally many for a purpose, because NumPy
            treats (5,) and (5, 0) as equal.

    Raises:
        RequestError: The stream is unknown or an index is out of range.
    """
    if stream not in STREAMS:
        raise RequestError(f"unknown seed stream {stream!r}; choose one of {', '.join(STREAMS)}")
    if not all(0 <= index < 2**32 for index in indices):
        raise RequestError(f"seed indices must be from 0 to 2^32 - 1, got {list(indices)}")
    # Unlike Python's hash(), CRC-32 is the same in every process.
    return np.random.default_rng(
        [STREAMS.index(stream), zlib.crc32(purpose.encode()), *map(int, indices)]
    )
