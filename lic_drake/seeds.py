"""Named seed streams: the only source of randomness in the package.

Environments for training, evaluation, calibration and hold-out come from different streams, so
that an evaluation environment can never be in a library.
"""

import zlib

import numpy as np

from lic_drake.errors import RequestError

STREAMS = ("training", "evaluation", "calibration", "holdout")
"""Names of the environment streams."""


def make_generator(stream: str, purpose: str, *indices: int) -> np.random.Generator:
    """Returns the generator of one (stream, purpose, indices) combination.

    Args:
        stream: One of `STREAMS`.
        purpose: What is drawn, for instance a clutter category or "goal"; any text.
        indices: Integers from 0 to 2^32 - 1, for instance the environment's index; always
            the same number of them for a purpose, because NumPy takes (5,) and (5, 0) for equal.

    Raises:
        RequestError: The stream is unknown or an index is out of range.
    """
    if stream not in STREAMS:
        raise RequestError(f"unknown seed stream {stream!r}; choose one of {', '.join(STREAMS)}")
    if not all(0 <= index < 2**32 for index in indices):
        raise RequestError(f"seed indices must be from 0 to 2^32 - 1, got {list(indices)}")
    # CRC-32 gives every purpose a fixed number; Python's own hash() changes between processes.
    return np.random.default_rng(
        [STREAMS.index(stream), zlib.crc32(purpose.encode()), *map(int, indices)]
    )
